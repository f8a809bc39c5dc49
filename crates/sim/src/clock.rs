//! The simulation's clock: virtual, jumping to what happens next, or real.
//!
//! Nothing else in this crate reads a clock or sleeps.

use std::thread;
use std::time::{Duration, Instant as SystemInstant};

use drivebus_rtu::Instant;

/// How long before an exact moment to wake up and wait awake: more than the usual lateness of a sleep on Linux
/// (50 µs timer slack and the wake-up itself), little enough to cost nothing.
const WAKE_EARLY: Duration = Duration::from_micros(100);

/// Where the present comes from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Clock {
    /// Time stands still until somebody waits, and then jumps.
    Virtual,
    /// Time since the simulation began.
    Real(SystemInstant),
}

impl Clock {
    /// A real-time clock that starts now.
    pub(crate) fn real() -> Self {
        Self::Real(SystemInstant::now())
    }

    pub(crate) fn is_real(self) -> bool {
        matches!(self, Self::Real(_))
    }

    /// The present, where the world has come to `world`.
    pub(crate) fn now(self, world: Instant) -> Instant {
        match self {
            Self::Virtual => world,
            Self::Real(start) => Instant::ZERO + start.elapsed(),
        }
    }

    /// The system's name of the moment `at`; `None` in virtual time, which it does not know.
    #[cfg(unix)]
    pub(crate) fn system(self, at: Instant) -> Option<SystemInstant> {
        match self {
            Self::Virtual => None,
            Self::Real(start) => start.checked_add(Duration::from_nanos(at.as_nanos())),
        }
    }

    /// Waits in real time until `until`; returns at once in virtual time, where waiting is a jump of the world.
    ///
    /// `exact` ends the wait awake, within a microsecond or so; otherwise the thread may wake up a little late.
    pub(crate) fn wait(self, until: Instant, exact: bool) {
        let Self::Real(start) = self else { return };
        let until = Duration::from_nanos(until.as_nanos());
        let early = if exact { WAKE_EARLY } else { Duration::ZERO };
        if let Some(sleep) = until.checked_sub(start.elapsed() + early) {
            thread::sleep(sleep);
        }
        if exact {
            while start.elapsed() < until {
                std::hint::spin_loop();
            }
        }
    }
}
