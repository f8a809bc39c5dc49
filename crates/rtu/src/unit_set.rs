//! A set of units without a heap: one bit each.

use crate::UnitAddress;

/// Which of all units are in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnitSet([u64; 4]);

impl UnitSet {
    pub(crate) const EMPTY: Self = Self([0; 4]);
    pub(crate) const ALL: Self = Self([u64::MAX; 4]);

    pub(crate) const fn contains(&self, unit: UnitAddress) -> bool {
        self.0[unit.get() as usize / 64] >> (unit.get() % 64) & 1 == 1
    }

    pub(crate) const fn insert(&mut self, unit: UnitAddress) {
        self.0[unit.get() as usize / 64] |= 1 << (unit.get() % 64);
    }

    pub(crate) const fn remove(&mut self, unit: UnitAddress) {
        self.0[unit.get() as usize / 64] &= !(1 << (unit.get() % 64));
    }
}
