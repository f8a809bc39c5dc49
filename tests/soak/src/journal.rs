//! The drives' own logs, sorted by who wrote: each address of each unit has one writer.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use drivebus_sim::SimulatedDrive;

type Taken = BTreeMap<(u8, u16), Vec<u16>>;

/// What the drives say they took from the bus.
#[derive(Debug)]
pub(crate) struct Journal {
    drives: BTreeMap<u8, SimulatedDrive>,
    taken: Mutex<Taken>,
}

impl Journal {
    pub(crate) fn new(drives: Vec<SimulatedDrive>) -> Self {
        let drives = drives.into_iter().map(|drive| (drive.unit(), drive)).collect();
        Self { drives, taken: Mutex::default() }
    }

    /// What `unit` took at `address` since this was last asked, oldest first.
    pub(crate) fn taken(&self, unit: u8, address: u16) -> Vec<u16> {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(drive) = self.drives.get(&unit) {
            for write in drive.take_writes() {
                taken.entry((unit, write.address)).or_default().push(write.value);
            }
        }
        taken.remove(&(unit, address)).unwrap_or_default()
    }

    /// Forgets what `unit` took so far.
    pub(crate) fn forget(&self, unit: u8) {
        if let Some(drive) = self.drives.get(&unit) {
            drive.take_writes();
        }
    }

    /// Words at addresses that nobody wrote to, or that nobody has asked about.
    pub(crate) fn words_lost(&self) -> u64 {
        let units: Vec<u8> = self.drives.keys().copied().collect();
        for unit in units {
            self.taken(unit, u16::MAX);
        }
        self.taken.lock().unwrap_or_else(PoisonError::into_inner).values().map(|words| words.len() as u64).sum()
    }
}
