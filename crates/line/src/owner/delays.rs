//! The delays of the units of a line, and what they teach about how long to wait for an answer.

use std::time::Duration;

use drivebus_rtu::UnitAddress;

use crate::by_unit::ByUnit;

/// How many answers are remembered: a few seconds of polling.
const REMEMBERED: usize = 32;

/// How many must be known before they say what is usual.
const ENOUGH: usize = 8;

/// So many times the longest usual delay is waited.
const MARGIN: u32 = 4;

/// Never less than this, in addition to the time the answer's own characters take: an adapter holds bytes back for 16 ms,
/// and a machine that was busy for 50 ms has given up units that were there.
const FLOOR: Duration = Duration::from_millis(100);

/// The delays of the units of a line: from the end of a request to the first character of its answer.
#[derive(Debug, Default)]
pub(crate) struct Delays(ByUnit<Delay>);

#[derive(Debug, Default)]
struct Delay {
    /// The last ones; the oldest is at `next` once all are there.
    last: Vec<Duration>,
    next: usize,
    longest: Duration,
}

impl Delays {
    /// `unit` took `delay` before it answered.
    pub(crate) fn answered(&mut self, unit: UnitAddress, delay: Duration) {
        let known = self.0.of(unit);
        if known.last.len() < REMEMBERED {
            known.last.push(delay);
        } else {
            let forgotten = std::mem::replace(&mut known.last[known.next], delay);
            known.next = (known.next + 1) % REMEMBERED;
            if forgotten >= known.longest && delay < forgotten {
                known.longest = known.last.iter().copied().max().unwrap_or_default();
            }
        }
        known.longest = known.longest.max(delay);
    }

    /// `unit` did not answer in the time that was learned: what was usual is not any more.
    pub(crate) fn silent(&mut self, unit: UnitAddress) {
        *self.0.of(unit) = Delay::default();
    }

    /// The longest delay that is remembered of `unit`, if any is.
    pub(crate) fn longest(&self, unit: UnitAddress) -> Option<Duration> {
        self.0.get(unit).filter(|known| !known.last.is_empty()).map(|known| known.longest)
    }

    /// How long to wait for the first character of an answer of `unit`; `None` while too little is known.
    pub(crate) fn patience(&self, unit: UnitAddress) -> Option<Duration> {
        let known = self.0.get(unit).filter(|known| known.last.len() >= ENOUGH)?;
        Some(known.longest.saturating_mul(MARGIN).max(FLOOR))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(raw: u8) -> UnitAddress {
        UnitAddress::new(raw).unwrap()
    }

    const fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn nothing_is_known_before_enough_answers() {
        let mut delays = Delays::default();
        for _ in 1..ENOUGH {
            delays.answered(unit(1), millis(30));
            assert_eq!(delays.patience(unit(1)), None);
        }
        delays.answered(unit(1), millis(20));
        assert_eq!(delays.patience(unit(1)), Some(millis(120)), "four times the longest");
        assert_eq!(delays.patience(unit(2)), None, "each unit has its own");
    }

    #[test]
    fn old_answers_are_forgotten_and_the_floor_holds() {
        let mut delays = Delays::default();
        delays.answered(unit(1), millis(100));
        for _ in 1..REMEMBERED {
            delays.answered(unit(1), millis(1));
        }
        assert_eq!(delays.patience(unit(1)), Some(millis(400)));
        delays.answered(unit(1), millis(1));
        assert_eq!(delays.patience(unit(1)), Some(FLOOR));
    }

    #[test]
    fn a_time_out_forgets_what_was_usual() {
        let mut delays = Delays::default();
        (0..ENOUGH).for_each(|_| delays.answered(unit(1), millis(1)));
        delays.silent(unit(1));
        assert_eq!(delays.patience(unit(1)), None);
    }
}
