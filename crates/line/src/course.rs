//! The attempts of one call: how long they may take, what one leaves to the next, and after which failure there is a next.

use std::time::Duration;

use drivebus_rtu::{Answer, Destination, Instant, Request, UnitAddress};

use crate::PortErrorKind;
use crate::error::{CallError, Failure};
use crate::exchange::{Ask, Done};
use crate::owner::{Asked, Owner};

/// How many more attempts than questions there may be: those that end with a probe.
const PROBED_IN_VAIN: u32 = 4;

/// What the attempts of one call leave to the next.
pub(crate) struct Course {
    /// How long the caller allowed them to take.
    allowed: Duration,
    /// When that is over: from the first look on, and then from the first question on.
    until: Option<Instant>,
    attempts: u32,
    /// How often it was asked; a question that is repeated to be sure of its answer counts once.
    asked: u32,
    /// What is left of the retries, in halves: a damaged answer, which took no time-out, costs one.
    left: u32,
    /// What was asked of the unit, if the last of it was a read of this call, which it left open.
    left_open: Option<Asked>,
}

impl Course {
    /// With `retries` more questions than one, each with a wait of `timeout`.
    ///
    /// The time that the caller allowed, the time-out for each of these times, is allowed once for making sure of the
    /// unit and once, from the first question on, for asking.
    pub(crate) fn new(timeout: Duration, retries: u32) -> Self {
        let allowed = timeout.saturating_mul(retries.saturating_add(1));
        let left = retries.saturating_mul(2);
        Self { allowed, until: None, attempts: 0, asked: 0, left, left_open: None }
    }

    /// Whether there is time left at `now`.
    pub(crate) fn is_in_time(&mut self, now: Instant) -> bool {
        now < *self.until.get_or_insert(now + self.allowed)
    }

    /// It is asked at `now`.
    pub(crate) fn asks(&mut self, now: Instant) {
        if self.asked == 0 {
            self.until = Some(now + self.allowed);
        }
        self.asked += 1;
    }

    /// How often it was asked.
    pub(crate) fn asked(&self) -> u32 {
        self.asked
    }

    /// Asks, and remembers whether the same may be asked again.
    pub(crate) fn ask(
        &mut self,
        owner: &mut Owner,
        ask: &Ask<'_>,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        self.asks(owner.now());
        let result = owner.exchange(ask, give_up, take);
        self.left_open = match (&result, ask.destination, ask.request) {
            (Err(error), Destination::Unit(unit), Request::ReadHolding { .. }) if is_unanswered(&error.failure) => {
                Some(owner.asked(unit))
            }
            _ => None,
        };
        result
    }

    /// Whether all that `unit` owes is the answer to this very question, so that it may be asked again as it is. Says so
    /// once.
    pub(crate) fn owes_only_this(&mut self, owner: &Owner, unit: UnitAddress) -> bool {
        self.left_open.take().is_some_and(|then| then == owner.asked(unit))
    }

    /// Whether there is another attempt after one that ended with `error`, before which it had been `asked` so often.
    pub(crate) fn goes_on(&mut self, error: &CallError, asked: u32) -> bool {
        self.attempts += 1;
        let cost = match self.asked > asked {
            true if is_damaged(&error.failure) => 1,
            true => 2,
            false => 0,
        };
        let is_over = (cost > 0 && self.left == 0) || self.attempts > self.asked.saturating_add(PROBED_IN_VAIN);
        self.left = self.left.saturating_sub(cost);
        !is_over && is_passing(&error.failure) && self.is_in_time(error.ended)
    }
}

/// Whether the same read may well succeed the next time.
fn is_passing(failure: &Failure) -> bool {
    match failure {
        Failure::Busy { .. } | Failure::Doubtful | Failure::Disagreeing { .. } => true,
        Failure::Port(error) => error.kind == PortErrorKind::Lost,
        other => is_unanswered(other),
    }
}

/// Whether the request went out, and no right answer came.
pub(crate) fn is_unanswered(failure: &Failure) -> bool {
    matches!(failure, Failure::NoAnswer { .. } | Failure::Unreached) || is_damaged(failure)
}

/// Whether an answer came that was none.
fn is_damaged(failure: &Failure) -> bool {
    matches!(failure, Failure::Wrong(_) | Failure::Corrupt(_))
}
