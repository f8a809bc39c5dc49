//! Units that do not answer: how seldom they are asked while others share the line with them.

use core::time::Duration;

use crate::Instant;

/// After so many calls in a row that brought silence a unit counts as dead. One may be a single bad moment.
const DEAD_AFTER: u32 = 2;

/// The first wait: who switches a drive on sees it answer within a second.
const FIRST_PERIOD: Duration = Duration::from_secs(1);

/// The longest wait, in times of the first: a time-out of half a second takes 6 % of the line then.
const LONGEST: u8 = 8;

/// How long an answer shows that its unit is alive. No shorter than the longest period: units are often asked only
/// every few seconds, and the line is shared with them all the same.
const ALIVE: Duration = FIRST_PERIOD.saturating_mul(LONGEST as u32);

/// Whether a unit may be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// As always.
    Ask,
    /// Once, without retries.
    AskOnce,
    /// Not before this moment, because the others have the line until then.
    Wait(Instant),
}

/// Whether a unit answers.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Life {
    answered: Option<Instant>,
    /// Calls in a row that brought silence.
    silent: u32,
    /// When the last of them ended.
    since: Instant,
    /// For how long it is not asked then, in times of the first period.
    periods: u8,
}

impl Life {
    /// It answered at `now`, or refused.
    pub(super) fn answered(&mut self, now: Instant) {
        *self = Self { answered: Some(now), ..Self::default() };
    }

    /// A call to it, with all its attempts, brought silence, and ended at `now`. `shared`: others who answer use the line.
    pub(super) fn silent(&mut self, now: Instant, shared: bool) {
        self.silent = self.silent.saturating_add(1);
        self.since = now;
        // Only a wait that was waited makes the next one longer. After a power cut all units come back within a second.
        self.periods = match self.silent {
            0..=DEAD_AFTER => 1,
            _ if shared => (2 * self.periods).min(LONGEST),
            _ => self.periods,
        };
    }

    /// Whether it may be asked at `now`, where others who answer use the line.
    pub(super) fn verdict(&self, now: Instant) -> Verdict {
        let until = self.since + FIRST_PERIOD * self.periods.into();
        match self.is_dead() {
            false => Verdict::Ask,
            true if now < until => Verdict::Wait(until),
            true => Verdict::AskOnce,
        }
    }

    pub(super) fn is_dead(&self) -> bool {
        self.silent >= DEAD_AFTER
    }

    pub(super) fn is_alive(&self, now: Instant) -> bool {
        !self.is_dead() && self.answered.is_some_and(|then| now.saturating_duration_since(then) < ALIVE)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::UnitAddress;
    use crate::conversation::units::Units;

    type All = Units<247>;

    fn unit(raw: u8) -> UnitAddress {
        UnitAddress::new(raw).unwrap()
    }

    /// With these units.
    fn units() -> All {
        let mut units = All::new();
        assert!((1..=8).all(|raw| units.enter(unit(raw))));
        units
    }

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn who_answers_is_asked_as_always() {
        let mut units = units();
        assert_eq!(units.verdict(unit(1), at(0)), Verdict::Ask, "never asked");
        units.answered(unit(2), at(0));
        units.silent(unit(1), at(100));
        assert_eq!(units.verdict(unit(1), at(101)), Verdict::Ask, "silent once");
        units.answered(unit(1), at(200));
        units.silent(unit(1), at(300));
        assert_eq!(units.verdict(unit(1), at(301)), Verdict::Ask, "silent once in a row");
    }

    #[test]
    fn the_dead_are_asked_once_in_periods_that_double() {
        let mut units = units();
        units.silent(unit(1), at(0));
        let mut now = 100;
        for period in [1_000, 2_000, 4_000, 8_000, 8_000] {
            units.silent(unit(1), at(now));
            units.answered(unit(2), at(now + period / 2));
            let until = now + period;
            assert_eq!(units.verdict(unit(1), at(now + period / 2)), Verdict::Wait(at(until)));
            assert_eq!(units.verdict(unit(1), at(until - 1)), Verdict::Wait(at(until)));
            assert_eq!(units.verdict(unit(1), at(until)), Verdict::AskOnce);
            now = until + 500;
        }
        units.answered(unit(1), at(now));
        assert_eq!(units.verdict(unit(1), at(now)), Verdict::Ask);
        units.silent(unit(1), at(now + 1));
        units.silent(unit(1), at(now + 2));
        assert_eq!(units.verdict(unit(1), at(now + 3)), Verdict::Wait(at(now + 1_002)), "from the beginning");
    }

    #[test]
    fn with_nobody_else_alive_the_dead_are_asked_as_always() {
        let mut units = units();
        for now in 0..10 {
            units.silent(unit(1), at(now));
            units.silent(unit(2), at(now));
        }
        assert_eq!(units.verdict(unit(1), at(10)), Verdict::Ask);
        // The power is back, and one of them is the first to answer: the other one is asked within the first period.
        units.answered(unit(2), at(20));
        assert_eq!(units.verdict(unit(1), at(20)), Verdict::Wait(at(1_009)));
        assert_eq!(units.verdict(unit(2), at(20)), Verdict::Ask);
        // Nobody has asked the other one any more.
        assert_eq!(units.verdict(unit(1), at(8_019)), Verdict::AskOnce);
        assert_eq!(units.verdict(unit(1), at(8_020)), Verdict::Ask);
    }

    const TIMEOUT: u64 = 500;
    const ATTEMPTS: u64 = 3;

    /// Calls one after the other on a line where unit 1 is dead and the others answer in 5 ms; after each, a pause.
    /// Gives when unit 1 was asked, from the first bit to the end of the wait, in ms.
    fn run(calls: &[(u8, u64)]) -> Vec<(u64, u64)> {
        let mut units = units();
        let mut now = 0;
        let mut asked = Vec::new();
        for &(raw, pause) in calls {
            let waits = match units.verdict(unit(raw), at(now)) {
                Verdict::Ask => ATTEMPTS,
                Verdict::AskOnce => 1,
                Verdict::Wait(_) => 0,
            };
            if raw != 1 {
                assert_eq!(waits, ATTEMPTS, "who answers is never held back");
                now += 5;
                units.answered(unit(raw), at(now));
            } else if waits > 0 {
                asked.push((now, now + waits * TIMEOUT));
                now += waits * TIMEOUT;
                units.silent(unit(1), at(now));
            }
            now += pause;
        }
        asked
    }

    /// Checks what unit 1 cost the others in `asked`: two whole calls, and then one time-out in each period.
    fn at_most_one_time_out_in_each_period(asked: &[(u64, u64)]) {
        for (index, &(start, end)) in asked.iter().enumerate() {
            let attempts = if index < 2 { ATTEMPTS } else { 1 };
            assert_eq!(end - start, attempts * TIMEOUT, "ask {index} of {asked:?}");
        }
        let periods = [1_000, 2_000, 4_000].into_iter().chain(std::iter::repeat(8_000));
        for (pair, period) in asked.windows(2).skip(1).zip(periods) {
            assert!(pair[1].0 - pair[0].1 >= period, "asked again after less than {period} ms: {pair:?}");
        }
    }

    #[test]
    fn five_minutes_of_polling_eight_units_one_of_them_dead() {
        let calls: Vec<_> = (1..=8).cycle().take(20_000).map(|raw| (raw, 10)).collect();
        let asked = run(&calls);
        at_most_one_time_out_in_each_period(&asked);
        // 20 000 calls of up to 15 ms are some five minutes: 35 periods of 8 s and a time-out, and five asks before them.
        assert!((36..=40).contains(&asked.len()), "{}", asked.len());
    }

    proptest! {
        #[test]
        fn the_dead_cost_one_time_out_in_a_period(
            calls in prop::collection::vec((1u8..5, 0u64..300), 0..2_000),
        ) {
            // One that is alive is asked before and between, never longer ago than an answer counts.
            let calls: Vec<_> = calls.into_iter().flat_map(|call| [(7, 0), call]).collect();
            at_most_one_time_out_in_each_period(&run(&calls));
        }
    }
}
