//! How a unit is halted whose program is gone: what is next, as a function of what came of it and when.
//!
//! | until | what goes to the unit |
//! | --- | --- |
//! | it said who it is | the question, once; silence is no evidence |
//! | it took a halt, and for 10 s | each way to halt it, one after the other, 0.1 s apart; nothing of others |
//! | its own time-out is over | nothing at all: each halt that it refuses feeds that, too |
//! | it took a halt | a halt every 5 s; others may ask it |
//!
//! Where a [`Halter`](crate::options::Halter) knows its family, that one asks who it is, and halts it, in the second row for
//! all of the time that is left, and in the last row once.
//!
//! Here it is decided only; who sends is in `bus::wills`.

use std::time::Duration;

use drivebus_rtu::Instant;

/// From the end of one halt to the next.
const APART: Duration = Duration::from_millis(100);
/// How long halts follow each other at once.
pub(super) const AT_ONCE: Duration = Duration::from_secs(10);
/// How much longer than its own time-out the unit is left alone: it may count from a moment that is not seen here.
const MARGIN: Duration = Duration::from_millis(500);
/// From the end of one halt to the next, where the unit took none for a long time.
const SELDOM: Duration = Duration::from_secs(5);

/// What is next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// Ask the unit who it is.
    Look,
    /// Halt it in this way.
    Halt(usize),
    /// Have it halted by who knows families, within this time.
    HaltAsNamed(Duration),
    /// Let this moment come.
    Wait(Instant),
    /// Nothing: it took a halt, or is another one.
    Over,
}

/// Who halts a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum By {
    /// The bus, frame by frame.
    Frames,
    /// Somebody who knows families.
    Family,
}

/// One unit on its way to a halt.
#[derive(Debug, Clone)]
pub(super) struct Halting {
    ways: usize,
    looks: bool,
    by: By,
    /// After how long a silence the unit acts by itself; zero: it does not.
    silence: Duration,
    /// Whether it still has to say who it is.
    unknown: bool,
    /// When the first halt was due.
    began: Option<Instant>,
    sent: usize,
    due: Instant,
    /// Until when nothing goes to it, once that is known.
    left_alone: Option<Instant>,
    over: bool,
}

impl Halting {
    /// Of a unit with so many `ways` to halt it, which says who it is where it can be asked (`looks`).
    pub(super) fn new(ways: usize, looks: bool, silence: Duration) -> Self {
        Self {
            ways,
            looks,
            by: By::Frames,
            silence,
            unknown: looks,
            began: None,
            sent: 0,
            due: Instant::ZERO,
            left_alone: None,
            over: ways == 0,
        }
    }

    /// The same, of a unit that somebody halts who knows families, where that is so.
    pub(super) fn by_family(self, is_so: bool) -> Self {
        Self { by: if is_so { By::Family } else { By::Frames }, ..self }
    }

    /// What is next at `now`.
    pub(super) fn next(&mut self, now: Instant) -> Next {
        if self.over {
            return Next::Over;
        }
        if now < self.due {
            return Next::Wait(self.due);
        }
        if self.unknown && self.by == By::Frames {
            return Next::Look;
        }
        let began = *self.began.get_or_insert(now);
        if self.by == By::Family {
            let left = AT_ONCE.saturating_sub(now.saturating_duration_since(began));
            return Next::HaltAsNamed(if self.is_late() { Duration::ZERO } else { left });
        }
        Next::Halt(self.sent % self.ways)
    }

    /// Who knows families does not know the one that it was named as.
    pub(super) fn is_of_no_family(&mut self) {
        self.by = By::Frames;
    }

    /// Who knows families came to no end by `now`: in all the time that was given, or else before.
    pub(super) fn was_not_halted(&mut self, now: Instant, in_all_that_time: bool) {
        let is_late = in_all_that_time || self.is_late();
        self.ended(now, is_late);
    }

    /// The unit was asked who it is: whether it said that it `is_another`.
    pub(super) fn looked(&mut self, is_another: bool) {
        self.unknown = false;
        self.over = is_another;
    }

    /// A halt ended at `now`: whether the unit `took` it, and whether the line was `lost` under it.
    pub(super) fn halted(&mut self, now: Instant, took: bool, lost: bool) {
        self.over = took;
        self.sent += 1;
        // Behind a line that is opened again, another unit may have the address.
        self.unknown = lost && self.looks;
        let is_late = self.began.is_some_and(|began| now.saturating_duration_since(began) >= AT_ONCE);
        self.ended(now, is_late);
    }

    fn ended(&mut self, now: Instant, is_late: bool) {
        self.due = now + if is_late { SELDOM } else { APART };
        if is_late && self.left_alone.is_none() {
            let alone = if self.silence.is_zero() { now } else { now + self.silence + MARGIN };
            self.left_alone = Some(alone);
            self.due = self.due.max(alone);
        }
    }

    /// Whether nobody else may ask the unit at `now`.
    pub(super) fn is_kept_from_others(&self, now: Instant) -> bool {
        !self.over && self.left_alone.is_none_or(|alone| now < alone)
    }

    /// Whether it is no longer tried at once.
    pub(super) fn is_late(&self) -> bool {
        self.left_alone.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    /// Goes on until `end`, each halt taking 5 ms and none being taken. Gives when each began, and which way it was.
    fn until(halting: &mut Halting, mut now: Instant, end: Instant) -> Vec<(u64, usize)> {
        let mut halts = Vec::new();
        while now < end {
            match halting.next(now) {
                Next::Halt(way) => {
                    halts.push((now.as_nanos() / 1_000_000, way));
                    now = now + Duration::from_millis(5);
                    halting.halted(now, false, false);
                }
                Next::Wait(due) => now = due,
                Next::Look => halting.looked(false),
                Next::HaltAsNamed(_) => panic!("nobody here knows families"),
                Next::Over => break,
            }
        }
        halts
    }

    #[test]
    fn its_ways_take_turns_until_one_is_taken() {
        let mut halting = Halting::new(2, false, Duration::ZERO);
        assert_eq!(until(&mut halting, at(1_000), at(1_300)), [(1_000, 0), (1_105, 1), (1_210, 0)]);
        assert!(halting.is_kept_from_others(at(1_400)));
        assert_eq!(halting.next(at(1_400)), Next::Halt(1));
        halting.halted(at(1_405), true, false);
        assert_eq!(halting.next(at(1_500)), Next::Over);
        assert!(!halting.is_kept_from_others(at(1_405)));
    }

    #[test]
    fn after_ten_seconds_it_is_left_alone_for_its_own_time_out_and_then_halted_seldom() {
        let mut halting = Halting::new(2, false, Duration::from_secs(7));
        let halts = until(&mut halting, at(0), at(30_000));
        let (fast, slow): (Vec<_>, Vec<_>) =
            halts.into_iter().map(|(moment, _)| moment).partition(|&moment| moment < 11_000);
        assert!(fast.windows(2).all(|pair| pair[1] - pair[0] <= 155), "{fast:?}");
        let last = fast[fast.len() - 1];
        assert!((9_895..=10_105).contains(&last), "{last}");
        assert_eq!(slow[0], last + 5 + 7_500, "nothing feeds its time-out");
        assert!(slow.windows(2).all(|pair| pair[1] - pair[0] == 5_005), "{slow:?}");
        assert!(halting.is_kept_from_others(at(last + 7_504)) && !halting.is_kept_from_others(at(last + 7_505)));
    }

    #[test]
    fn one_without_a_time_out_of_its_own_is_given_back_to_others_after_ten_seconds() {
        let mut halting = Halting::new(1, false, Duration::ZERO);
        until(&mut halting, at(0), at(9_000));
        assert!(halting.is_kept_from_others(at(9_000)) && !halting.is_late());
        until(&mut halting, at(9_000), at(12_000));
        assert!(!halting.is_kept_from_others(at(12_000)) && halting.is_late());
    }

    #[test]
    fn who_is_another_one_gets_nothing() {
        let mut halting = Halting::new(2, true, Duration::ZERO);
        assert_eq!(halting.next(at(0)), Next::Look);
        halting.looked(true);
        assert_eq!(halting.next(at(1)), Next::Over);
        assert!(!halting.is_kept_from_others(at(1)));
    }

    #[test]
    fn who_knows_families_has_ten_seconds_and_then_goes_once_each_five() {
        let mut halting = Halting::new(2, true, Duration::from_secs(7)).by_family(true);
        assert_eq!(halting.next(at(0)), Next::HaltAsNamed(Duration::from_secs(10)), "it asks for itself");
        halting.was_not_halted(at(3_000), false);
        assert_eq!(halting.next(at(3_000)), Next::Wait(at(3_100)));
        assert_eq!(halting.next(at(3_100)), Next::HaltAsNamed(Duration::from_millis(6_900)));
        // By a clock that goes faster than this one.
        halting.was_not_halted(at(4_000), true);
        assert!(halting.is_late());
        assert_eq!(halting.next(at(4_000)), Next::Wait(at(11_500)), "nothing feeds its time-out");
        assert!(halting.is_kept_from_others(at(11_499)) && !halting.is_kept_from_others(at(11_500)));
        let Next::HaltAsNamed(within) = halting.next(at(11_500)) else { panic!("{halting:?}") };
        assert_eq!(within, Duration::ZERO);
        halting.was_not_halted(at(12_000), true);
        assert_eq!(halting.next(at(12_000)), Next::Wait(at(17_000)));
    }

    #[test]
    fn of_a_family_that_nobody_knows_it_is_asked_and_halted_frame_by_frame() {
        let mut halting = Halting::new(1, true, Duration::ZERO).by_family(true);
        assert_eq!(halting.next(at(0)), Next::HaltAsNamed(AT_ONCE));
        halting.is_of_no_family();
        assert_eq!(halting.next(at(0)), Next::Look);
        halting.looked(false);
        assert_eq!(halting.next(at(0)), Next::Halt(0));
    }

    #[test]
    fn behind_a_line_that_was_lost_it_is_asked_again_who_it_is() {
        let mut halting = Halting::new(2, true, Duration::ZERO);
        halting.looked(false);
        assert_eq!(halting.next(at(0)), Next::Halt(0));
        halting.halted(at(1), false, true);
        assert_eq!(halting.next(at(101)), Next::Look);
        halting.looked(false);
        assert_eq!(halting.next(at(101)), Next::Halt(1));
    }
}
