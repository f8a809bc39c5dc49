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
        Self::Real { line: line.now(), system: monotonic() }
    }

    /// The system's own.
    pub(super) fn real() -> Self {
        Self::Real { line: Instant::ZERO, system: Instant::ZERO }
    }

    /// Now on the line's clock; `None` where only the line knows.
    pub(super) fn now(&self) -> Option<Instant> {
        match self {
            Self::Real { line, system } => Some(*line + monotonic().saturating_duration_since(*system)),
            Self::Virtual(clock) => clock.as_ref().map(|clock| clock()),
        }
    }
}
