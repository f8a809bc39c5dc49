//! How often each unit was told to halt over a line: what was decided on before is not sent any more.

use drivebus_rtu::UnitAddress;

use crate::system::clock::monotonic;
use crate::system::sync::atomic::{AtomicU64, Ordering};

/// A count for each unit. It grows when a halt is about to wait for its turn, before anything of it is on the wire.
#[derive(Debug)]
pub(super) struct HaltsTold {
    units: Box<[AtomicU64]>,
}

impl HaltsTold {
    /// Begins at no number that another line had: who asks after the port changed hands is told that it was halted.
    pub(super) fn new() -> Self {
        let first = monotonic().as_nanos();
        Self { units: (0..=u8::MAX).map(|_| AtomicU64::new(first)).collect() }
    }

    /// One more is under way to `unit`.
    pub(super) fn count(&self, unit: UnitAddress) {
        self.units[usize::from(unit.get())].fetch_add(1, Ordering::AcqRel);
    }

    /// The number of `unit` now.
    pub(super) fn of(&self, unit: UnitAddress) -> u64 {
        self.units[usize::from(unit.get())].load(Ordering::Acquire)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_unit_has_a_number_of_its_own_and_each_line_others() {
        let [first, second] = [1, 2].map(|unit| UnitAddress::new(unit).unwrap());
        let told = HaltsTold::new();
        let before = [told.of(first), told.of(second)];
        told.count(first);
        assert_eq!([told.of(first), told.of(second)], [before[0] + 1, before[1]]);
        assert_ne!(HaltsTold::new().of(first), before[0]);
        told.count(UnitAddress::by_name(255));
    }
}
