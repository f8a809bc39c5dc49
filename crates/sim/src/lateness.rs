//! How much before an exact moment to wake up, learnt from how late wake-ups are on this machine.

use std::time::Duration;

/// Awake for longer than this before a moment nobody waits: a machine that wakes up later is late.
const LONGEST: u64 = 100_000;
/// Below this a system call is longer.
const SHORTEST: u64 = 2_000;
/// What a punctual wake-up takes off, in nanoseconds.
const DOWN: u64 = 50;
/// What a late one adds: with 19 times as much, one wake-up of twenty comes later than the margin in the end.
const UP: u64 = 19 * DOWN;

/// The margin: most wake-ups come no later than this.
///
/// Waiting awake is paid with processor time that the measured program may need, so the margin is as short as the
/// machine lets it be: a few µs where a processor never idles, some 50 µs where it has to be woken.
#[derive(Debug)]
pub(crate) struct Lateness {
    nanos: u64,
}

impl Lateness {
    pub(crate) fn new() -> Self {
        Self { nanos: LONGEST / 2 }
    }

    /// A wake-up came this late.
    pub(crate) fn note(&mut self, late: Duration) {
        let late = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        let moved = if late > self.nanos { self.nanos + UP } else { self.nanos - DOWN };
        self.nanos = moved.clamp(SHORTEST, LONGEST);
    }

    /// How long before an exact moment to be awake.
    pub(crate) fn margin(&self) -> Duration {
        Duration::from_nanos(self.nanos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_covers_nineteen_wake_ups_of_twenty() {
        let mut lateness = Lateness::new();
        // 1 to 100 µs in an order that mixes them: 37 and 100 have no common divisor.
        for n in 0..100_000_u64 {
            lateness.note(Duration::from_micros(1 + n * 37 % 100));
        }
        let margin = lateness.margin();
        assert!(margin > Duration::from_micros(92) && margin < Duration::from_micros(98), "{margin:?}");
    }

    #[test]
    fn the_margin_stays_within_its_bounds() {
        let mut lateness = Lateness::new();
        for (late, bound) in [(Duration::ZERO, 2), (Duration::from_secs(1), 100), (Duration::ZERO, 2)] {
            for _ in 0..10_000 {
                lateness.note(late);
            }
            assert_eq!(lateness.margin(), Duration::from_micros(bound));
        }
    }
}
