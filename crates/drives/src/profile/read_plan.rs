//! A read plan: what to read for some entries, and where in the words that come each of them is.
//!
//! Made once and used for every answer: what is asked again and again is neither looked up nor planned again.

use crate::entry::{AccessError, Entry};
use crate::place::Place;
use crate::plan::ReadSpan;
use crate::profile::Profile;
use crate::quantity::Quantity;
use crate::value::Value;

/// The cheapest reads that hold some entries, and the way from their words to values.
///
/// The words of all reads stand one after the other, in the order of [`reads`](Self::reads).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadPlan {
    reads: Vec<ReadSpan>,
    fields: Vec<Field>,
}

/// One entry of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Field {
    /// Where its first word is.
    position: usize,
    quantity: Quantity,
    /// The word that stands for nothing there.
    absent: Option<u16>,
}

impl Profile {
    /// As [`plan`](Self::plan), with what leads from the words back to each of `entries`, in their order.
    ///
    /// # Errors
    ///
    /// [`AccessError`]: one of them can only be written.
    pub fn compile(&self, entries: &[&Entry]) -> Result<ReadPlan, AccessError> {
        let reads = self.plan(entries.iter().copied())?;
        let position = |place: Place| {
            let mut before = 0;
            for read in &reads {
                let holds = (read.address..=read.address + (read.count - 1)).contains(&place.address);
                if read.table == place.table && holds {
                    return before + usize::from(place.address - read.address);
                }
                before += usize::from(read.count);
            }
            before // the plan holds every address
        };
        let fields = entries
            .iter()
            .map(|entry| {
                let position = position(self.read_address(entry)?);
                let is_number = entry.words() == 1 && entry.bits().is_empty() && entry.quantity().choices().is_empty();
                let absent = self.requests.absent.filter(|_| is_number);
                Ok(Field { position, quantity: entry.quantity().clone(), absent })
            })
            .collect::<Result<_, AccessError>>()?;
        Ok(ReadPlan { reads, fields })
    }
}

impl ReadPlan {
    /// What to read, one table after the other, each in address order.
    pub fn reads(&self) -> &[ReadSpan] {
        &self.reads
    }

    /// How many words all reads bring.
    pub fn words(&self) -> usize {
        self.reads.iter().map(|read| usize::from(read.count)).sum()
    }

    /// The value of each entry in `words`, which holds those of all reads; none of an entry whose word is missing.
    pub fn values(&self, words: &[u16]) -> impl Iterator<Item = (&Quantity, Option<Value>)> {
        self.fields.iter().map(|field| {
            let quantity = &field.quantity;
            let value = if quantity.wide {
                words.get(field.position..field.position + 2).and_then(|words| quantity.decode_words(words))
            } else {
                words.get(field.position).map(|&word| quantity.decode(word))
            };
            (quantity, value)
        })
    }

    /// As [`values`](Self::values), and none of an entry whose word is what the drive has where it has nothing.
    pub fn told(&self, words: &[u16]) -> impl Iterator<Item = (&Quantity, Option<Value>)> {
        self.fields.iter().zip(self.values(words)).map(|(field, (quantity, value))| {
            let is_absent = field.absent.is_some() && words.get(field.position).copied() == field.absent;
            (quantity, value.filter(|_| !is_absent))
        })
    }
}
