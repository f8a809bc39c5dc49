//! How late the answers of a unit come that come late at all: so long it is worth to wait whether one is seen, where lengths do
//! not tell it from the next.
//!
//! It says nothing of how long one may come: the next may be later than all before.

use core::time::Duration;

use crate::{Instant, UnitAddress};

/// So many times as long as the latest that was seen it is worth to wait.
const WORTH: u32 = 2;

/// Of a unit of which no answer was late yet so many open ones are watched for.
const UNKNOWN: usize = 3;

/// Units that are remembered; of others nothing is known.
const KEPT: usize = 8;

/// What the units have taught that were late last: the longest time from when an answer was given up to when it came.
#[derive(Debug, Clone)]
pub(super) struct Lateness([Option<(UnitAddress, Duration)>; KEPT]);

impl Lateness {
    pub(super) const UNKNOWN: Self = Self([None; KEPT]);

    /// An answer of `unit` came at `now` that was given up at `given_up`. With more units than are kept, the one that was late
    /// longest ago is forgotten.
    pub(super) fn came(&mut self, now: Instant, unit: UnitAddress, given_up: Instant) {
        let late = self.known(unit).unwrap_or_default().max(now.saturating_duration_since(given_up));
        let is_it = |place: &Option<(UnitAddress, Duration)>| place.is_none_or(|(of, _)| of == unit);
        let place = self.0.iter().position(is_it).unwrap_or(KEPT - 1);
        self.0[place] = Some((unit, late));
        self.0[..=place].rotate_right(1);
    }

    /// How long it is worth to wait for an answer of `unit`, from when it was given up, `most` at most. No time at all where they
    /// take longer; nor, where the unit can be asked `otherwise`, if that may be all of it. Where none was late yet, all of it as
    /// long as no more than [`UNKNOWN`] are `open`.
    pub(super) fn worth(&self, unit: UnitAddress, most: Duration, otherwise: bool, open: usize) -> Duration {
        let Some(late) = self.known(unit) else {
            return if !otherwise && open <= UNKNOWN { most } else { Duration::ZERO };
        };
        match late.saturating_mul(WORTH) {
            worth if worth <= most => worth,
            _ if late <= most && !otherwise => most,
            _ => Duration::ZERO,
        }
    }

    fn known(&self, unit: UnitAddress) -> Option<Duration> {
        self.0.iter().flatten().find(|(of, _)| *of == unit).map(|(_, late)| *late)
    }
}
