//! When a poll asks whom. Time is an argument; nothing here waits, sends, or knows what an answer holds.
//!
//! A cycle asks each target once, in their order. Cycles follow one another, or begin at beats: moments that are whole
//! intervals after the first one, so that no delay adds up. A beat that is over before the line is free again is missed
//! and counted, and never made up for: the cycle of the beat that is due by then comes next.

use std::time::Duration;

use drivebus_rtu::Instant;

/// How long a cycle takes at least in which nothing went over the line: all targets are dead, or the port is lost.
const NOTHING_TO_HEAR: Duration = Duration::from_millis(50);

/// What to do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// Ask this target, and say what became of it by [`Schedule::asked`].
    Ask(usize),
    /// Let this moment come.
    Pause(Instant),
}

/// Where a poll is in its cycle.
#[derive(Debug)]
pub(crate) struct Schedule {
    targets: usize,
    interval: Option<Duration>,
    /// The first beat.
    start: Option<Instant>,
    /// The number of the beat that the next cycle belongs to.
    beat: u64,
    /// The target that is asked next.
    next: usize,
    /// When the cycle under way began.
    began: Instant,
    /// Before this moment the next cycle does not begin, whatever the interval.
    not_before: Instant,
    /// Whether anything went over the line in this cycle.
    heard: bool,
    cycles: u64,
    late: u64,
    /// How many beats were missed right before the cycle under way.
    missed: u64,
}

impl Schedule {
    /// Of `targets`, at least one, in cycles of `interval`, longer than nothing; `None`: one right after the other.
    pub(crate) fn new(targets: usize, interval: Option<Duration>) -> Self {
        Self {
            targets,
            interval,
            start: None,
            beat: 0,
            next: 0,
            began: Instant::ZERO,
            not_before: Instant::ZERO,
            heard: false,
            cycles: 0,
            late: 0,
            missed: 0,
        }
    }

    /// What to do at `now`. Asking twice at one moment changes nothing.
    pub(crate) fn step(&mut self, now: Instant) -> Step {
        if self.next > 0 {
            return Step::Ask(self.next);
        }
        let start = *self.start.get_or_insert(now);
        if let Some(interval) = self.interval {
            let interval = u64::try_from(interval.as_nanos()).unwrap_or(u64::MAX).max(1);
            let due = start + Duration::from_nanos(interval.saturating_mul(self.beat));
            let due = due.max(self.not_before);
            if now < due {
                return Step::Pause(due);
            }
            let current = now.as_nanos().saturating_sub(start.as_nanos()) / interval;
            let missed = current.saturating_sub(self.beat);
            self.late += missed;
            self.missed += missed;
            self.beat = self.beat.max(current);
        } else if now < self.not_before {
            return Step::Pause(self.not_before);
        }
        self.began = now;
        Step::Ask(0)
    }

    /// The target that [`step`](Self::step) named was asked, and that was over at `now`. `heard` says whether the line
    /// was used for it.
    pub(crate) fn asked(&mut self, now: Instant, heard: bool) {
        self.heard |= heard;
        self.next += 1;
        if self.next < self.targets {
            return;
        }
        self.not_before = if self.heard { now } else { self.began + NOTHING_TO_HEAR };
        self.next = 0;
        self.beat += 1;
        self.cycles += 1;
        self.heard = false;
        self.missed = 0;
    }

    /// Who is asked next, whenever that is.
    pub(crate) fn next(&self) -> usize {
        self.next
    }

    /// How many cycles are over.
    pub(crate) fn cycles(&self) -> u64 {
        self.cycles
    }

    /// How many beats were missed between the cycle under way and the one before it.
    pub(crate) fn missed(&self) -> u64 {
        self.missed
    }

    /// How many beats were missed.
    pub(crate) fn late(&self) -> u64 {
        self.late
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    /// One cycle from `now`, each target taking one of `takes` milliseconds. Gives when it began and when it ended.
    fn cycle(schedule: &mut Schedule, mut now: Instant, takes: &[u64]) -> (Instant, Instant) {
        if let Step::Pause(until) = schedule.step(now) {
            assert!(until > now, "a pause goes on");
            now = until;
        }
        let began = now;
        for (target, &millis) in takes.iter().enumerate() {
            assert_eq!(schedule.step(now), Step::Ask(target), "in their order, each once");
            now = now + Duration::from_millis(millis);
            schedule.asked(now, true);
        }
        (began, now)
    }

    #[test]
    fn without_an_interval_nothing_lies_between_two_cycles() {
        let mut schedule = Schedule::new(2, None);
        let mut now = at(7);
        for _ in 0..3 {
            let (began, ended) = cycle(&mut schedule, now, &[10, 20]);
            assert_eq!((began, ended), (now, now + Duration::from_millis(30)));
            now = ended;
        }
        assert_eq!((schedule.cycles(), schedule.late()), (3, 0));
    }

    #[test]
    fn with_nothing_to_hear_a_poll_does_not_run_away() {
        for interval in [None, Some(Duration::from_nanos(1))] {
            let mut schedule = Schedule::new(2, interval);
            for cycle in 0..5 {
                let now = at(3 + 50 * cycle);
                for _ in 0..2 {
                    assert!(matches!(schedule.step(now), Step::Ask(_)));
                    schedule.asked(now, false);
                }
                assert_eq!(schedule.step(now), Step::Pause(now + NOTHING_TO_HEAR));
            }
        }
    }

    #[test]
    fn one_who_is_heard_lets_the_cycle_go_on() {
        let mut schedule = Schedule::new(2, None);
        for heard in [true, false] {
            assert!(matches!(schedule.step(at(5)), Step::Ask(_)));
            schedule.asked(at(5), heard);
        }
        assert_eq!(schedule.step(at(5)), Step::Ask(0));
    }

    #[test]
    fn each_target_of_a_cycle_is_told_what_was_missed_before_it() {
        let mut schedule = Schedule::new(2, Some(Duration::from_millis(100)));
        let mut told = Vec::new();
        // The beats of 100 and 200 are over at 350, that of 300 is not.
        for now in [0, 350, 400] {
            for target in 0..2 {
                assert_eq!((schedule.step(at(now)), schedule.step(at(now))), (Step::Ask(target), Step::Ask(target)));
                told.push(schedule.missed());
                schedule.asked(at(now), true);
            }
        }
        assert_eq!(told, [0, 0, 2, 2, 0, 0]);
    }

    #[test]
    fn a_beat_that_is_over_is_missed_and_the_one_that_is_due_comes_late() {
        let mut schedule = Schedule::new(1, Some(Duration::from_millis(100)));
        assert_eq!(cycle(&mut schedule, at(0), &[30]), (at(0), at(30)));
        assert_eq!(cycle(&mut schedule, at(30), &[350]), (at(100), at(450)));
        assert_eq!(schedule.late(), 0);
        // The beats of 200 and 300 are over, that of 400 is not.
        assert_eq!(cycle(&mut schedule, at(450), &[10]), (at(450), at(460)));
        assert_eq!(schedule.late(), 2);
        assert_eq!(cycle(&mut schedule, at(460), &[10]), (at(500), at(510)), "back on the beat");
        // Nobody asked for a while.
        assert_eq!(cycle(&mut schedule, at(1_000), &[10]), (at(1_000), at(1_010)));
        assert_eq!((schedule.late(), schedule.cycles()), (6, 5));
    }

    proptest! {
        #[test]
        fn beats_never_drift_and_are_made_or_missed(
            interval in 1_u64..50,
            start in 0_u64..1_000,
            takes in prop::collection::vec((0_u64..120, 0_u64..30), 1..60),
        ) {
            let mut schedule = Schedule::new(2, Some(Duration::from_millis(interval)));
            let (mut now, mut last, mut made) = (at(start), None, 0);
            for (first, second) in takes {
                let (began, ended) = cycle(&mut schedule, now, &[first, second]);
                let beat = (began.as_nanos() - at(start).as_nanos()) / (interval * 1_000_000);
                prop_assert!(last.is_none_or(|last| beat > last), "one cycle for a beat");
                if began > now {
                    prop_assert_eq!(began, at(start + beat * interval), "who waits begins on the beat");
                }
                made += 1;
                prop_assert_eq!(made + schedule.late(), beat + 1, "each beat is made or missed");
                (now, last) = (ended, Some(beat));
            }
        }

        #[test]
        fn all_are_asked_equally_often(targets in 1_usize..9, steps in 0_usize..100, interval in 0_u64..40) {
            let interval = (interval > 0).then(|| Duration::from_millis(interval));
            let mut schedule = Schedule::new(targets, interval);
            let mut asked = vec![0_usize; targets];
            let mut now = at(0);
            while asked.iter().sum::<usize>() < steps {
                match schedule.step(now) {
                    Step::Ask(target) => {
                        asked[target] += 1;
                        now = now + Duration::from_millis(7);
                        schedule.asked(now, true);
                    }
                    Step::Pause(until) => now = until,
                }
                let (least, most) = (asked.iter().min().copied(), asked.iter().max().copied());
                prop_assert!(most <= least.map(|least| least + 1), "{:?}", asked);
            }
        }
    }
}
