//! What a test told a drive to refuse: which requests, by which exception, how long.
//!
//! These are no refusals of its family: a drive that is busy, or that got a frame damaged, says so of anything.

use std::time::Duration;

use drivebus_rtu::{ExceptionCode, Instant, function};

use crate::error::SimError;
use crate::random::Random;

/// Which requests a drive is told to refuse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Asked {
    /// All of them.
    #[default]
    Anything,
    /// Reads: 01H to 04H.
    Reads,
    /// All that are no reads.
    Writes,
}

impl Asked {
    fn is(self, function: u8) -> bool {
        let reads = (function::READ_COILS..=function::READ_INPUT).contains(&function);
        match self {
            Self::Anything => true,
            Self::Reads => reads,
            Self::Writes => !reads,
        }
    }
}

/// What a drive is told to refuse: every request, until it is told otherwise, unless less is said.
///
/// A request that is refused is not carried out, and counts as heard. Broadcasts, which nobody answers, are not refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusals {
    code: u8,
    asked: Asked,
    share: f64,
    time: Option<Duration>,
    count: Option<u64>,
    taken: bool,
}

impl Refusals {
    /// Refusals by exception `code`.
    #[must_use]
    pub const fn new(code: u8) -> Self {
        Self { code, asked: Asked::Anything, share: 1.0, time: None, count: None, taken: false }
    }

    /// Only these requests.
    #[must_use]
    pub const fn of(self, asked: Asked) -> Self {
        Self { asked, ..self }
    }

    /// Only this share of them, 0.0..=1.0, by chance from the simulation's seed.
    #[must_use]
    pub const fn share(self, share: f64) -> Self {
        Self { share, ..self }
    }

    /// Only for so long from now.
    #[must_use]
    pub const fn time(self, time: Duration) -> Self {
        Self { time: Some(time), ..self }
    }

    /// Only so many of them.
    #[must_use]
    pub const fn count(self, count: u64) -> Self {
        Self { count: Some(count), ..self }
    }

    /// The drive does what it is asked, and answers by the exception all the same: 05H is an acknowledgement. What it would
    /// refuse by itself it refuses so.
    #[must_use]
    pub const fn taken(self) -> Self {
        Self { taken: true, ..self }
    }

    /// Whether they can be had.
    pub(crate) fn check(&self) -> Result<(), SimError> {
        match *self {
            Self { code: 0, .. } => Err(SimError::NoException),
            Self { share, .. } if !(0.0..=1.0).contains(&share) => Err(SimError::Share { share }),
            _ => Ok(()),
        }
    }
}

/// Refusals under way.
#[derive(Debug)]
pub(super) struct Refusing {
    what: Refusals,
    until: Option<Instant>,
    random: Random,
}

impl Refusing {
    pub(super) fn new(what: Refusals, now: Instant, seed: u64) -> Self {
        Self { what, until: what.time.map(|time| now + time), random: Random::new(seed) }
    }

    /// The exception that a request for `function` at `now` gets, and whether it is carried out all the same.
    pub(super) fn of(&mut self, now: Instant, function: u8) -> Option<(ExceptionCode, bool)> {
        let over = self.until.is_some_and(|until| now >= until) || self.what.count == Some(0);
        if over || !self.what.asked.is(function) || !self.random.happens(self.what.share) {
            return None;
        }
        self.what.count = self.what.count.map(|left| left - 1);
        Some((ExceptionCode(self.what.code), self.what.taken))
    }
}
