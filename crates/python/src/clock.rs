//! Moments of the core as Python's numbers.

use std::time::{Duration, SystemTime};

use drivebus_line::Bus as CoreBus;
use drivebus_rtu::Instant;

/// The line's clock and the calendar's, at one moment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnixClock {
    ahead: f64,
}

impl UnixClock {
    /// `virtual_ahead` is where a simulation's clock stands on the calendar.
    pub(crate) fn of(core: &CoreBus, virtual_ahead: Option<f64>) -> Self {
        Self { ahead: virtual_ahead.unwrap_or_else(|| calendar_ahead(core)) }
    }

    pub(crate) fn at(self, moment: Instant) -> f64 {
        to_seconds(moment) + self.ahead
    }
}

/// How many seconds the calendar is ahead of the line's clock now.
pub(crate) fn calendar_ahead(core: &CoreBus) -> f64 {
    unix_time().as_secs_f64() - to_seconds(core.now())
}

/// The calendar's time since 1970.
pub(crate) fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}

/// A moment of the line's clock in seconds since it began.
pub(crate) fn to_seconds(moment: Instant) -> f64 {
    moment.saturating_duration_since(Instant::ZERO).as_secs_f64()
}

/// The moment at so many seconds of the line's clock. A line that was lost may have no clock any more: then its beginning.
pub(crate) fn moment(seconds: f64) -> Instant {
    Instant::ZERO + duration(seconds)
}

/// So many seconds; what is no time is none.
pub(crate) fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

/// A moment of the simulation in seconds.
#[expect(clippy::cast_precision_loss, reason = "a float is what Python counts seconds in; 104 days are exact")]
pub(crate) fn seconds(moment: Instant) -> f64 {
    moment.as_nanos() as f64 / 1e9
}
