//! The time of a bus's line, told without the line.

use std::fmt;

use drivebus_rtu::Instant;

use crate::line::{Line, LineClock};
use crate::system::clock::monotonic;

/// How to tell the line's time without the line, which another thread may be waiting on.
pub(super) enum Clock {
    /// It runs as the system's does; both stood so at one moment.
    Real { line: Instant, system: Instant },
    /// A simulation's: its time moves only while somebody waits. `None`: only the line knows.
    Virtual(Option<LineClock>),
}

impl fmt::Debug for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if matches!(self, Self::Real { .. }) { "Real" } else { "Virtual" })
    }
}

impl Clock {
    pub(super) fn of(line: &dyn Line) -> Self {
        if line.is_virtual() {
            return Self::Virtual(line.clock());
        }
        let before = monotonic();
        let (line, after) = (line.now(), monotonic());
        if (before..=after).contains(&line) {
            // It is the system's, which cannot be read twice at one moment.
            return Self::real();
        }
        Self::Real { line, system: after }
    }

    /// The system's own.
    pub(super) fn real() -> Self {
        Self::Real { line: Instant::ZERO, system: Instant::ZERO }
    }

    /// Now on the line's clock, never ahead of it; `None` where only the line knows.
    pub(super) fn now(&self) -> Option<Instant> {
        match self {
            Self::Real { line, system } => Some(*line + monotonic().saturating_duration_since(*system)),
            Self::Virtual(clock) => clock.as_ref().map(|clock| clock()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::PortError;

    /// A line whose clock stood at `since` when the system's did at 0, and which is held up whenever somebody asks it for the time.
    #[derive(Debug)]
    struct HeldUp {
        since: Duration,
    }

    impl Line for HeldUp {
        fn now(&self) -> Instant {
            let now = monotonic();
            while monotonic().saturating_duration_since(now) < Duration::from_millis(2) {}
            now + self.since
        }

        fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
            unreachable!()
        }

        fn receive(&mut self, _: &mut [u8], _: Instant) -> Result<usize, PortError> {
            unreachable!()
        }

        fn sleep(&mut self, _: Instant) {}

        fn name(&self) -> String {
            String::new()
        }
    }

    #[test]
    fn the_systems_clock_is_told_to_the_nanosecond_however_long_it_took_to_ask() {
        let clock = Clock::of(&HeldUp { since: Duration::ZERO });
        let before = monotonic();
        let told = clock.now().unwrap();
        assert!((before..=monotonic()).contains(&told));
    }

    #[test]
    fn another_clock_is_never_told_ahead() {
        let since = Duration::from_secs(3_600);
        let told = Clock::of(&HeldUp { since }).now().unwrap();
        assert!(told <= monotonic() + since);
    }
}
