//! How long a client that commanded motion has been silent. Time is an argument.

use std::time::Duration;

use drivebus_rtu::Instant;

/// Since when it is the client's turn, and how long it may take.
#[derive(Debug)]
pub(super) struct Silence {
    /// `None`: as long as it likes.
    within: Option<Duration>,
    since: Instant,
}

impl Silence {
    /// Of a client that is here since `now`.
    pub(super) const fn new(within: Option<Duration>, now: Instant) -> Self {
        Self { within, since: now }
    }

    /// The client asked, or was answered, `at` that moment.
    pub(super) fn heard(&mut self, at: Instant) {
        self.since = self.since.max(at);
    }

    /// Until when it has to ask something; `None`: it need not, or `waits` for an answer and cannot.
    pub(super) fn ends(&self, waits: bool) -> Option<Instant> {
        self.within.filter(|_| !waits).map(|within| self.since + within)
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    proptest! {
        /// Against all moments, looked through again: silent is who was heard at none of the last `within`.
        #[test]
        fn silent_is_who_was_not_heard_for_so_long(moments in vec(0_u64..10_000, 0..8), within in 1_u64..3_000, now in 0_u64..13_000) {
            let mut silence = Silence::new(Some(Duration::from_millis(within)), at(0));
            for &moment in &moments {
                silence.heard(at(moment));
            }
            prop_assume!(moments.iter().all(|&moment| moment <= now));
            let is_silent = moments.iter().chain([&0]).all(|&moment| moment + within <= now);
            prop_assert_eq!(silence.ends(false).is_some_and(|end| end <= at(now)), is_silent);
            prop_assert_eq!(silence.ends(true), None, "it waits for an answer");
        }
    }

    #[test]
    fn one_that_may_be_silent_always_may() {
        assert_eq!(Silence::new(None, at(0)).ends(false), None);
    }
}
