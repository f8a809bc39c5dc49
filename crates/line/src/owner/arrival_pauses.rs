//! How an answer comes over this line: in one piece, character by character, or in lumps with pauses between; and so how
//! long the rest of one that broke off is worth waiting for.
//!
//! An adapter hands over what it has when its buffer is full or its timer runs out, a network when it pleases, a machine
//! when it has time. Nothing of that can be asked for, so it is learned: from the pauses inside answers that became whole.
//!
//! Where nothing is lost, the longest pause decides. Where much is lost, each answer that broke off pays for it, so that rare
//! pauses are not worth waiting for: an answer given up too early is asked for again.

use drivebus_rtu::{Duration, Instant, Patience};

use crate::line::Line;

/// Waited on a line of which too little is known. Serial adapters hold bytes back for 16 ms, and a machine that was busy for
/// 50 ms is no rarity; what a network adds it adds more often than once.
const UNKNOWN: Duration = Duration::from_millis(100);

/// Answers that have to become whole, or to break off for good, before they say what is usual.
const ENOUGH: u32 = 8;

/// Answers after which what was usual before is forgotten; up to twice as many are remembered.
const REMEMBERED: u32 = 256;

/// So many times a pause is waited.
const MARGIN: u32 = 2;

/// So many answers have to break off for each that is given up before it goes on: that one may leave three seconds of doubt.
const WORTH: u32 = 64;

/// Pauses are told apart in so many steps, each twice the one before.
const STEPS: usize = 8;

/// The least where bytes are handed over as the wire carries them: a damaged answer may have the right one a few
/// milliseconds behind it, and machines wake late.
const LEAST: Duration = Duration::from_millis(10);

/// Pauses up to this, in nanoseconds, change nothing: twice as long is waited in any case.
const NEVER_MINDED: u64 = 5_000_000;

/// The least where nobody knows how: the timer of an adapter that nobody has set, 16 ms, and a little.
const LEAST_BEHIND_UNKNOWN: Duration = Duration::from_millis(20);

/// What the answers over one line have taught.
#[derive(Debug)]
pub(crate) struct Lumps {
    /// The least that is waited; `None` where answers come whole or not at all.
    least: Option<Duration>,
    /// What is waited.
    pause: Duration,
    /// Answers in the period under way.
    whole: u32,
    current: Period,
    before: Option<Period>,
    broke_off: Option<BrokeOff>,
}

/// What the answers of one period have taught.
#[derive(Debug, Clone, Copy, Default)]
struct Period {
    /// Longest pause.
    longest: Duration,
    /// How many answers had one that was longer than [`NEVER_MINDED`], than twice as long, and so on.
    paused: [u32; STEPS],
    /// How many broke off, or were damaged, and did not go on.
    torn: u32,
}

impl Period {
    fn has_paused(&mut self, pause: Duration) {
        self.longest = self.longest.max(pause);
        for (step, paused) in (0..).zip(&mut self.paused) {
            *paused += u32::from(pause > shortest(step));
        }
    }

    /// The pause that is worth waiting for, after this period and the one `before`.
    fn worth(&self, before: &Self) -> Duration {
        let torn = self.torn + before.torn;
        let paused = self.paused.iter().zip(&before.paused).map(|(now, before)| now + before);
        let rare = (0..).zip(paused).find(|(_, paused)| torn > 0 && paused * WORTH <= torn);
        self.longest.max(before.longest).min(rare.map_or(Duration::MAX, |(step, _)| shortest(step)))
    }
}

/// What pauses of this step are longer than.
const fn shortest(step: u32) -> Duration {
    Duration::from_nanos(NEVER_MINDED << step)
}

/// An answer of which no more was expected.
#[derive(Debug, Clone, Copy)]
struct BrokeOff {
    /// When its last byte came.
    last: Instant,
    /// How many it lacked; 0 where it was as long as it should be.
    lacked: usize,
}

impl Lumps {
    /// Nothing is known of `line` but what it says of itself.
    pub(crate) fn of(line: &dyn Line) -> Self {
        let least = match (line.gapless(), line.char_time(), line.latency()) {
            (true, ..) => None,
            (false, None, Duration::ZERO) => Some(LEAST_BEHIND_UNKNOWN),
            (false, _, latency) => Some(LEAST.saturating_add(latency)),
        };
        Self::with_least(least)
    }

    /// Nothing is known, not even which line.
    pub(crate) fn of_no_line() -> Self {
        Self::with_least(Some(LEAST_BEHIND_UNKNOWN))
    }

    fn with_least(least: Option<Duration>) -> Self {
        let pause = UNKNOWN.max(least.unwrap_or_default());
        Self { least, pause, whole: 0, current: Period::default(), before: None, broke_off: None }
    }

    /// How long to listen on; `usual` is when the unit that is asked has begun to answer, as far as is known. `None` where
    /// answers come whole or not at all.
    pub(crate) fn patience(&self, usual: Option<Duration>) -> Option<Patience> {
        self.least?;
        Some(Patience::new(self.pause, usual.unwrap_or(UNKNOWN)))
    }

    /// What an exchange has taught that asked for an answer of `answer` bytes.
    pub(crate) fn learn(&mut self, arrivals: &Arrivals, answer: Option<usize>, ended: Ended) {
        if ended == Ended::Whole && self.broke_off.is_none() && arrivals.longest <= NEVER_MINDED && self.is_known() {
            self.whole += 1;
        } else {
            self.learn_more(arrivals, answer, ended);
        }
    }

    #[cold]
    fn learn_more(&mut self, arrivals: &Arrivals, answer: Option<usize>, ended: Ended) {
        let lacks = match (ended, answer) {
            (Ended::Damaged { bytes }, Some(answer)) => answer.saturating_sub(bytes),
            _ => 0,
        };
        // What an earlier answer lacked came before this one: it had only paused.
        match (self.broke_off.take(), answer) {
            (Some(broke_off), Some(answer))
                if broke_off.lacked > 0
                    && arrivals.count > 0
                    && arrivals.count + lacks == answer + broke_off.lacked =>
            {
                self.has_paused(arrivals.first.saturating_duration_since(broke_off.last));
            }
            // Beside a whole answer and nothing else, it would have been seen to go on.
            (Some(_), Some(answer)) if ended == Ended::Whole && arrivals.count == answer => {
                self.current.torn += 1;
                self.weigh();
            }
            _ => {}
        }
        match ended {
            Ended::Whole => self.became_whole(arrivals, answer),
            Ended::Damaged { .. } => self.broke_off = Some(BrokeOff { last: arrivals.last, lacked: lacks }),
            Ended::Otherwise => {}
        }
    }

    /// Whether one answer more that came without a pause changes nothing but the number.
    const fn is_known(&self) -> bool {
        self.whole >= ENOUGH && self.whole + 1 < REMEMBERED
    }

    fn became_whole(&mut self, arrivals: &Arrivals, answer: Option<usize>) {
        self.whole += 1;
        if self.whole >= REMEMBERED {
            self.before = Some(std::mem::take(&mut self.current));
            self.whole = 0;
            self.weigh();
        }
        if arrivals.longest > NEVER_MINDED || self.whole == ENOUGH {
            let pause = Duration::from_nanos(arrivals.longest);
            // Beside other bytes it may have been noise that seemed to begin the answer.
            self.has_paused(if answer == Some(arrivals.count) { pause } else { pause.min(UNKNOWN) });
        }
    }

    fn has_paused(&mut self, pause: Duration) {
        self.current.has_paused(pause);
        self.weigh();
    }

    fn weigh(&mut self) {
        let is_known = self.before.is_some() || self.whole + self.current.torn >= ENOUGH;
        let least = if is_known { self.least.unwrap_or_default() } else { UNKNOWN };
        let worth = self.current.worth(&self.before.unwrap_or_default());
        self.pause = worth.saturating_mul(MARGIN).max(least);
    }
}

/// How an exchange ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    /// With the answer.
    Whole,
    /// With so many bytes of one.
    Damaged { bytes: usize },
    /// With anything else.
    Otherwise,
}

/// The bytes of one exchange, as they come.
#[derive(Debug)]
pub(crate) struct Arrivals {
    first: Instant,
    last: Instant,
    count: usize,
    /// The longest time, in nanoseconds, in which nothing came of an answer that had begun.
    longest: u64,
}

impl Arrivals {
    pub(crate) const fn new() -> Self {
        Self { first: Instant::ZERO, last: Instant::ZERO, count: 0, longest: NEVER_MINDED }
    }

    /// When something came last; the start of the clock where nothing did.
    pub(crate) const fn last(&self) -> Instant {
        self.last
    }

    /// `count` bytes came at `now`. `has_begun`: whether an answer had before them, and they were waited for since.
    pub(crate) fn came(&mut self, now: Instant, count: usize, has_begun: impl FnOnce() -> bool) {
        if self.count == 0 {
            self.first = now;
        } else {
            let pause = now.as_nanos().saturating_sub(self.last.as_nanos());
            if pause > self.longest && has_begun() {
                self.longest = pause;
            }
        }
        self.last = now;
        self.count += count;
    }
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::SerialFormat;

    use super::*;
    use crate::nobody::Nobody;

    const ANSWER: usize = 7;

    const fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    fn at(millis: u64) -> Instant {
        Instant::ZERO + self::millis(millis)
    }

    fn lumps(char_time: Option<Duration>, latency: u64) -> Lumps {
        Lumps::of(&Nobody { char_time, latency: millis(latency) })
    }

    fn by_characters() -> Lumps {
        lumps(Some(SerialFormat::DEFAULT.char_time()), 0)
    }

    /// An answer in two lumps, the second so long after the first.
    fn in_two(pause: u64, has_begun: bool) -> Arrivals {
        let mut arrivals = Arrivals::new();
        arrivals.came(at(100), 3, || false);
        arrivals.came(at(100 + pause), ANSWER - 3, || has_begun);
        arrivals
    }

    fn learn(lumps: &mut Lumps, times: u32, pause: u64) {
        (0..times).for_each(|_| lumps.learn(&in_two(pause, true), Some(ANSWER), Ended::Whole));
    }

    #[test]
    fn nothing_is_given_up_early_before_enough_is_known() {
        let mut lines =
            [(by_characters(), LEAST), (lumps(None, 0), LEAST_BEHIND_UNKNOWN), (lumps(None, 16), millis(26))];
        for (lumps, least) in &mut lines {
            for _ in 0..ENOUGH {
                assert_eq!(lumps.pause, UNKNOWN);
                learn(lumps, 1, 0);
            }
            assert_eq!(lumps.pause, *least);
        }
    }

    #[test]
    fn twice_the_longest_pause_is_waited_and_it_is_forgotten_in_the_end() {
        let mut lumps = by_characters();
        learn(&mut lumps, 1, 40);
        learn(&mut lumps, REMEMBERED - 1, 1);
        assert_eq!(lumps.pause, millis(80));
        learn(&mut lumps, REMEMBERED, 1);
        assert_eq!(lumps.pause, LEAST);
    }

    #[test]
    fn time_before_an_answer_begins_is_no_pause() {
        let mut lumps = by_characters();
        (0..ENOUGH).for_each(|_| lumps.learn(&in_two(60, false), Some(ANSWER), Ended::Whole));
        assert_eq!(lumps.pause, LEAST);
    }

    #[test]
    fn what_was_given_up_and_comes_after_all_was_a_pause() {
        let mut lumps = by_characters();
        learn(&mut lumps, ENOUGH, 1);
        let mut broken = Arrivals::new();
        broken.came(at(100), 3, || false);
        lumps.learn(&broken, Some(ANSWER), Ended::Damaged { bytes: 3 });
        assert_eq!(lumps.pause, LEAST, "a byte that was lost is no pause");
        let mut after = Arrivals::new();
        after.came(at(400), ANSWER - 3, || false);
        after.came(at(410), ANSWER, || false);
        lumps.learn(&after, Some(ANSWER), Ended::Whole);
        assert_eq!(lumps.pause, millis(600));
    }

    #[test]
    fn a_pause_beside_noise_counts_no_longer_than_on_a_line_that_nobody_knows() {
        let mut lumps = by_characters();
        (0..ENOUGH).for_each(|_| lumps.learn(&in_two(450, true), Some(ANSWER - 2), Ended::Whole));
        assert_eq!(lumps.pause, 2 * UNKNOWN);
    }

    #[test]
    fn a_line_may_hand_over_as_late_as_it_likes() {
        assert_eq!(Lumps::of(&Nobody { char_time: None, latency: Duration::MAX }).pause, Duration::MAX);
    }
}
