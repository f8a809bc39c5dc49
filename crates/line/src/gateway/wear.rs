//! How often places that wear may be written over the network: memory that keeps a value bears some hundred thousand writes.
//! A client that writes in a loop has used that up within days.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;

/// So many writes of one place at once are use, and not a loop.
pub(super) const AT_ONCE: u32 = 5;
/// After that, one more each time that this is over: 5 000 a year.
pub(super) const ONE_MORE: Duration = Duration::from_secs(6_000);

/// The writes that wore something, of all clients together: it is one memory.
#[derive(Debug, Default)]
pub(super) struct Wear {
    /// By unit and address, when all of its writes will be there again.
    full: Mutex<BTreeMap<(u8, u16), Instant>>,
}

impl Wear {
    /// Whether each of `places` of `unit` may be written `now`; if so, it counts as written.
    pub(super) fn takes(&self, unit: u8, places: impl Iterator<Item = u16> + Clone, now: Instant) -> Result<(), u16> {
        let mut full = self.full.lock().unwrap_or_else(PoisonError::into_inner);
        let latest = now + ONE_MORE * (AT_ONCE - 1);
        if let Some(worn) = places.clone().find(|&place| full.get(&(unit, place)).is_some_and(|&full| full > latest)) {
            return Err(worn);
        }
        for place in places {
            let at = full.entry((unit, place)).or_insert(now);
            *at = (*at).max(now) + ONE_MORE;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_at_once_and_then_seldom() {
        let (wear, start) = (Wear::default(), Instant::ZERO + Duration::from_secs(1));
        let writes =
            |unit, seconds: u64| wear.takes(unit, [7].into_iter(), start + Duration::from_secs(seconds)).is_ok();
        assert_eq!((0..9).filter(|&at| writes(1, at)).count(), 5);
        assert!(writes(2, 9), "another drive");
        assert!(wear.takes(1, [8].into_iter(), start).is_ok(), "another place");
        assert!(!writes(1, 5_999) && writes(1, 6_001) && !writes(1, 6_002));
        // Six were written, which is over at 36 000 s: two more are there at 20 000 s, and then one from 24 000 s on, each 6 000 s.
        assert_eq!((20_000..120_000).step_by(100).filter(|&at| writes(1, at)).count(), 2 + 16);
    }
}
