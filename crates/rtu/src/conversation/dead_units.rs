//! Units that do not answer: how seldom they are asked while others share the line with them.

use core::time::Duration;

use super::units::Units;
use crate::{Instant, UnitAddress};

/// After so many calls in a row that brought silence a unit counts as dead. One may be a single bad moment.
const DEAD_AFTER: u32 = 2;

/// The first wait: who switches a drive on sees it answer within a second.
const FIRST_PERIOD: Duration = Duration::from_secs(1);

/// The longest wait: a time-out of half a second takes 6 % of the line then.
const LONGEST_PERIOD: Duration = Duration::from_secs(8);

/// How long an answer shows that its unit is alive. No shorter than the longest period: units are often asked only
/// every few seconds, and the line is shared with them all the same.
const ALIVE: Duration = LONGEST_PERIOD;

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
    /// For how long it is not asked then.
    period: Duration,
}

impl Life {
    fn is_dead(&self) -> bool {
        self.silent >= DEAD_AFTER
    }

    fn is_alive(&self, now: Instant) -> bool {
        !self.is_dead() && self.answered.is_some_and(|then| now.saturating_duration_since(then) < ALIVE)
    }
}

/// The verdict holds for who has the line: of two who asked for it while they waited, the second would be told the same.
impl<const N: usize> Units<N> {
    /// `unit` answered at `now`, or refused.
    pub(super) fn answered(&mut self, unit: UnitAddress, now: Instant) {
        self.of(unit).life = Life { answered: Some(now), ..Life::default() };
    }

    /// A call to `unit`, with all its attempts, brought silence, and ended at `now`.
    pub(super) fn silent(&mut self, unit: UnitAddress, now: Instant) {
        let shared = self.is_shared(now);
        let life = &mut self.of(unit).life;
        life.silent = life.silent.saturating_add(1);
        life.since = now;
        // Only a wait that was waited makes the next one longer. After a power cut all units come back within a second.
        life.period = match life.silent {
            0..=DEAD_AFTER => FIRST_PERIOD,
            _ if shared => (2 * life.period).min(LONGEST_PERIOD),
            _ => life.period,
        };
    }

    /// Whether `unit` may be asked at `now`.
    pub(super) fn verdict(&self, unit: UnitAddress, now: Instant) -> Verdict {
        match self.get(unit).map(|unit| &unit.life) {
            Some(life) if life.is_dead() && self.is_shared(now) => {
                let until = life.since + life.period;
                if now < until { Verdict::Wait(until) } else { Verdict::AskOnce }
            }
            _ => Verdict::Ask,
        }
    }

    /// Whether anybody who answers uses the line.
    fn is_shared(&self, now: Instant) -> bool {
        self.iter().any(|unit| unit.life.is_alive(now))
    }
}
