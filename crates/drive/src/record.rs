//! What was sent to a unit, what it said of itself, and where its parameters were written: one memory, which all handles of the
//! unit share.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_drives::State;

use crate::same_unit::Identity;

/// What is remembered of one unit. A clone is the same one.
#[derive(Debug, Clone, Default)]
pub struct Record(Arc<Mutex<Kept>>);

#[derive(Debug, Default)]
struct Kept {
    sent: Sent,
    /// What it said, by the name of the family in whose words it was asked.
    identities: BTreeMap<String, Identity>,
    /// Parameters that were written to RAM, by code, and not to EEPROM since.
    in_ram: BTreeSet<String>,
    /// How often each parameter was written to EEPROM.
    stores: BTreeMap<String, u64>,
}

/// What was sent to a unit that moves its motor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Sent {
    /// How many starts were sent, or were about to be.
    pub starts: u64,
    /// How many halts, of whatever kind, were about to go out.
    pub halts_begun: u64,
    /// How many halts have gone out.
    pub halts: u64,
    /// How it was started last; unknown after a jog or a word by its address. `None`: it was not.
    pub started_as: Option<State>,
    /// Whether it was started by what no document of its family prints, and so may be halted by that.
    pub started_unverified: bool,
}

impl Record {
    /// EEPROM writes of one parameter that are taken for use; more look like a loop.
    pub const STORES_BEFORE_NOTICE: u64 = 5;

    /// What was sent.
    pub fn sent(&self) -> Sent {
        self.kept().sent
    }

    /// Notes what was sent, as `note` does.
    pub fn note(&self, note: impl FnOnce(&mut Sent)) {
        note(&mut self.kept().sent);
    }

    /// What the unit said in the words of the family of that name; nothing yet, where nobody asked since `connection` began.
    pub fn identity(&self, family: &str, connection: u64) -> Identity {
        let mut kept = self.kept();
        match kept.identities.get(family) {
            Some(known) if known.connection() == connection => known.clone(),
            _ => {
                let fresh = Identity::new(connection);
                kept.identities.insert(family.to_owned(), fresh.clone());
                fresh
            }
        }
    }

    /// Whether the parameter of this code was written to RAM, and not to EEPROM since: what it reads as is then not stored.
    pub fn is_in_ram(&self, code: &str) -> bool {
        self.kept().in_ram.contains(code)
    }

    /// The codes of all that are in RAM alone.
    pub fn in_ram(&self) -> Vec<String> {
        self.kept().in_ram.iter().cloned().collect()
    }

    /// The parameter of this code is about to be written to RAM: the drive may take it although its answer is lost.
    pub fn put_in_ram(&self, code: &str) {
        self.kept().in_ram.insert(code.to_owned());
    }

    /// The parameter of this code was written to EEPROM. How often that was, this time included.
    pub fn stored(&self, code: &str) -> u64 {
        let mut kept = self.kept();
        kept.in_ram.remove(code);
        let times = kept.stores.entry(code.to_owned()).or_default();
        *times += 1;
        *times
    }

    /// How often the parameter of this code was written to EEPROM.
    pub fn stores(&self, code: &str) -> u64 {
        self.kept().stores.get(code).copied().unwrap_or_default()
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_handles_of_a_unit_have_one_memory() {
        let record = Record::default();
        let other = record.clone();
        other.note(|sent| sent.halts += 1);
        assert_eq!(record.sent().halts, 1);
        record.identity("gd350", 0).settle(0, drivebus_rtu::Instant::ZERO);
        assert!(other.identity("gd350", 0).is_sure(0));
        // Another family asks otherwise, and behind another port another unit may answer.
        assert!(!other.identity("vfd500", 0).is_sure(0));
        assert!(!other.identity("gd350", 1).is_sure(1));
    }

    #[test]
    fn a_parameter_is_in_ram_until_it_is_stored() {
        let record = Record::default();
        record.put_in_ram("P00.11");
        assert!(record.clone().is_in_ram("P00.11") && !record.is_in_ram("P00.12"));
        assert_eq!((record.stored("P00.11"), record.stored("P00.11")), (1, 2));
        assert!(!record.is_in_ram("P00.11"));
        assert_eq!((record.stores("P00.11"), record.stores("P00.12")), (2, 0));
    }
}
