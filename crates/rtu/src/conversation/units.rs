//! What is known of each unit, in a table without a heap.

use super::dead_units::{Life, Verdict};
use super::first_contact::Met;
use super::probes::Probing;
use super::watched::Watched;
use crate::{Instant, UnitAddress};

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

/// The units that were asked. With room for all 247 each is found without a search, and with 256 the
/// reserved ones are, too.
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
        let free = if Self::has_all() {
            Some(direct(unit)).filter(|&place| place < N)
        } else {
            self.numbers.iter().position(Option::is_none)
        };
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

    /// `unit` answered at `now`, or refused.
    pub(super) fn answered(&mut self, unit: UnitAddress, now: Instant) {
        self.of(unit).life.answered(now);
    }

    /// A call to `unit`, with all its attempts, brought silence, and ended at `now`.
    pub(super) fn silent(&mut self, unit: UnitAddress, now: Instant) {
        let shared = self.is_shared(now);
        self.of(unit).life.silent(now, shared);
    }

    /// Whether `unit` may be asked at `now`.
    ///
    /// It holds for who has the line: of two who asked for it while they waited, the second would be told the same.
    pub(super) fn verdict(&self, unit: UnitAddress, now: Instant) -> Verdict {
        match self.get(unit).map(|unit| &unit.life) {
            Some(life) if life.is_dead() && self.is_shared(now) => life.verdict(now),
            _ => Verdict::Ask,
        }
    }

    /// Whether anybody who answers uses the line.
    fn is_shared(&self, now: Instant) -> bool {
        self.iter().any(|unit| unit.life.is_alive(now))
    }

    const fn has_all() -> bool {
        N >= UnitAddress::MAX.get() as usize
    }

    fn place(&self, unit: UnitAddress) -> Option<usize> {
        if Self::has_all() {
            return Some(direct(unit)).filter(|&place| matches!(self.numbers.get(place), Some(Some(_))));
        }
        self.numbers.iter().position(|number| *number == Some(unit))
    }
}

fn direct(unit: UnitAddress) -> usize {
    usize::from(unit.get().wrapping_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reserved_unit_has_a_place_of_its_own_or_none() {
        let (mut by_specification, mut all) = (Units::<247>::new(), Units::<256>::new());
        for raw in 0..=u8::MAX {
            let unit = UnitAddress::by_name(raw);
            assert_eq!(by_specification.enter(unit), !unit.is_reserved(), "{raw}");
            assert_eq!(by_specification.get(unit).is_some(), !unit.is_reserved(), "{raw}");
            assert!(all.get(unit).is_none() && all.enter(unit) && all.get(unit).is_some(), "{raw}");
        }
        assert_eq!((by_specification.iter().count(), all.iter().count()), (247, 256));
    }
}
