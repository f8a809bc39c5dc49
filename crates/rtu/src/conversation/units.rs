//! What is known of each unit, in a table without a heap.

use super::among_others::Watched;
use super::dead_units::Life;
use super::first_contact::Met;
use super::probes::Probing;
use crate::UnitAddress;

/// Everything that is known of one unit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Unit {
    /// Requests that went out to it.
    pub(super) asked: u32,
    pub(super) probing: Probing,
    pub(super) life: Life,
    pub(super) met: Met,
    pub(super) watched: Watched,
}

/// The units that were asked. With room for all 247 each is found without a search.
#[derive(Debug, Clone)]
pub(super) struct Units<const N: usize> {
    records: [Unit; N],
    numbers: [Option<UnitAddress>; N],
    /// Of units that no room is left for; nobody is asked that has none.
    spare: Unit,
}

impl<const N: usize> Units<N> {
    pub(super) fn new() -> Self {
        Self { records: [Unit::default(); N], numbers: [None; N], spare: Unit::default() }
    }

    /// Makes room for `unit`; whether there was any.
    pub(super) fn enter(&mut self, unit: UnitAddress) -> bool {
        if self.place(unit).is_some() {
            return true;
        }
        let free = if Self::has_all() { Some(direct(unit)) } else { self.numbers.iter().position(Option::is_none) };
        if let Some(number) = free.and_then(|free| self.numbers.get_mut(free)) {
            *number = Some(unit);
        }
        free.is_some()
    }

    /// What is known of `unit`, if it was asked.
    pub(super) fn get(&self, unit: UnitAddress) -> Option<&Unit> {
        self.place(unit).map(|place| &self.records[place])
    }

    /// The same, to be changed.
    pub(super) fn of(&mut self, unit: UnitAddress) -> &mut Unit {
        match self.place(unit) {
            Some(place) => &mut self.records[place],
            None => &mut self.spare,
        }
    }

    /// All that were asked.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Unit> {
        self.numbers.iter().zip(&self.records).filter_map(|(number, unit)| number.and(Some(unit)))
    }

    /// The same, to be changed.
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Unit> {
        self.records.iter_mut()
    }

    const fn has_all() -> bool {
        N >= UnitAddress::MAX.get() as usize
    }

    fn place(&self, unit: UnitAddress) -> Option<usize> {
        if Self::has_all() {
            return Some(direct(unit)).filter(|&place| self.numbers[place].is_some());
        }
        self.numbers.iter().position(|number| *number == Some(unit))
    }
}

fn direct(unit: UnitAddress) -> usize {
    usize::from(unit.get()) - 1
}
