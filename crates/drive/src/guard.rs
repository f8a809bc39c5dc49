//! What words that are written by their address would command: held against the command registers of the unit's families,
//! and of all others.
//!
//! The same word means different things to different families: 5 stops an INVT drive and lets a VFD500 coast. And a
//! register that is nothing to one family starts a unit of another, which somebody may have hung there.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drives::{Memory, Place, Table};

use crate::families::Families;
use crate::family::Family;

/// The bit of an address that says where a parameter is kept, where a family does not say which one it is: that of most.
const USUAL_MEMORY_BIT: u16 = 1 << 15;

/// Why words may not be written by their address. Nothing was sent.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[non_exhaustive]
pub enum Forbidden<'f> {
    /// A unit of these families takes commands there, and the word is none of them.
    #[error("{word:04X}H at {place} is no command of {}", .family.profile().title())]
    Undefined {
        /// The first of the families that the unit may be of and that have commands there.
        family: &'f Family,
        /// Where the word was to be written.
        place: Place,
        /// The word, 0..=0xFFFF.
        word: u16,
        /// The words that this family defines there, and what it calls them.
        codes: &'f BTreeMap<u16, String>,
    },
    /// Nothing that is known of the unit's families stands there, and others take commands there.
    #[error("{place} takes commands of {}, and nothing of {} is there", titles(.others), .family.profile().title())]
    Foreign {
        /// The first of the families that the unit may be of.
        family: &'f Family,
        /// Where a word was to be written.
        place: Place,
        /// The families whose command register it is.
        others: &'f [Arc<Family>],
    },
}

fn titles(families: &[Arc<Family>]) -> String {
    families.iter().map(|family| family.profile().title()).collect::<Vec<_>>().join(", ")
}

impl Families {
    /// Whether `words` may be written from `first` on to a unit that may be one of `unit`.
    ///
    /// In a register that takes commands of such a unit, each word has to be one that one of `unit` defines there: the
    /// place counts with and without the bit that says where a parameter is kept. Elsewhere any word may be written,
    /// unless other families take commands there and nothing of `unit` is known to stand there. Where `unit` is empty,
    /// there is nothing to hold the words against.
    ///
    /// ```
    /// use drivebus_drive::{Families, Forbidden};
    /// use drivebus_drives::Profile;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let families = Families::shipped();
    /// let gd350 = [families.family(&Profile::builtin("gd350")?)];
    ///
    /// // 5 stops it, and 15 is no command of it. At 7000H a VFD500 takes its commands.
    /// assert!(families.check(&gd350, 0x2000.into(), &[5]).is_ok());
    /// let why = families.check(&gd350, 0x2000.into(), &[15]).unwrap_err();
    /// assert_eq!(why.to_string(), "000FH at 2000H is no command of INVT Goodrive350");
    /// let why = families.check(&gd350, 0x7000.into(), &[5]).unwrap_err();
    /// assert!(matches!(why, Forbidden::Foreign { .. }));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// [`Forbidden`], of the first word that may not be written.
    pub fn check<'f>(&'f self, unit: &'f [Arc<Family>], first: Place, words: &[u16]) -> Result<(), Forbidden<'f>> {
        // Behind the last address there is nothing that could be written.
        let addresses = first.address..=u16::MAX;
        addresses.zip(words).try_for_each(|(address, &word)| self.check_word(unit, Place { address, ..first }, word))
    }

    fn check_word<'f>(&'f self, unit: &'f [Arc<Family>], place: Place, word: u16) -> Result<(), Forbidden<'f>> {
        let mut commanded = unit.iter().filter_map(|family| Some((family, family.codes_at(place)?)));
        let Some((family, codes)) = commanded.next() else {
            return self.check_foreign(unit, place);
        };
        let is_defined = codes.contains_key(&word) || commanded.any(|(_, codes)| codes.contains_key(&word));
        if is_defined { Ok(()) } else { Err(Forbidden::Undefined { family, place, word, codes }) }
    }

    /// Of a place where `unit` takes no commands.
    fn check_foreign<'f>(&'f self, unit: &'f [Arc<Family>], place: Place) -> Result<(), Forbidden<'f>> {
        let Some(family) = unit.first() else { return Ok(()) };
        let places = || std::iter::once(place).chain(unit.iter().map(|each| each.plain(place)));
        let is_known = || places().any(|place| unit.iter().any(|each| each.has(place)));
        let speaks = |others: &&[Arc<Family>]| others.iter().any(|each| each.protocol() == family.protocol());
        let others = places().map(|place| self.commanded_at(place)).find(speaks);
        match others {
            Some(others) if !is_known() => Err(Forbidden::Foreign { family, place, others }),
            _ => Ok(()),
        }
    }
}

impl Family {
    /// The commands that its units take at `place`, or there without the bit that says where a parameter is kept; `None`
    /// where they take none.
    fn codes_at(&self, place: Place) -> Option<&BTreeMap<u16, String>> {
        let registers = self.command_registers();
        registers.get(&place).or_else(|| registers.get(&self.plain(place)))
    }

    /// `place` without the bit that says where a parameter is kept.
    ///
    /// Nobody knows that a family has none: where no document says which bit it is, the usual one is taken for it.
    fn plain(&self, place: Place) -> Place {
        let bit = self.profile().memory().map_or(USUAL_MEMORY_BIT, Memory::mask);
        match place.table {
            Table::Holding => Place { address: place.address & !bit, ..place },
            Table::Input | Table::Coil | Table::Discrete => place,
        }
    }
}

#[cfg(test)]
mod tests;
