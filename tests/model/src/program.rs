//! The program: what it may ask and when, and what it makes of what comes. The rules are those of `crates/line`; which of
//! the things that they permit it does, and when it gives up, is left open.

use std::hash::{Hash, Hasher};

use drivebus_rtu::{Agreement, Answer, Attribution, Duration, Instant};

use crate::fingerprint::{self, offset};
use crate::frames::{Content, Kind};
use crate::scenario::{Adapter, Scenario};
use crate::world::{State, Wrong, address};

/// What is known of the adapter (`crates/line/src/owner/echo.rs`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Knowledge {
    /// Nothing yet.
    Auto,
    /// It sends requests back.
    Present,
    /// It does not.
    Absent,
}

impl Knowledge {
    /// When a port was opened.
    pub fn at_opening(adapter: Adapter) -> Self {
        if adapter == Adapter::Known { Self::Absent } else { Self::Auto }
    }
}

/// One call of the program.
#[derive(Debug, Clone)]
pub struct Call {
    /// Who is asked.
    pub unit: usize,
    /// What is asked.
    pub kind: Kind,
    /// The number of its first request.
    pub(crate) first: u16,
    /// The number of its latest.
    pub(crate) latest: u16,
    pub(crate) asked: u8,
    pub(crate) agreement: Agreement,
    /// Whether one answer is enough, so that it may be asked again as it is after silence.
    pub(crate) is_immediate: bool,
    /// Whether it was put so that no open answer could pass for its own. A refusal is not believed then.
    pub(crate) apart: bool,
    /// Whether it was asked in quarantine because its answer cannot be mistaken.
    pub(crate) ends_doubt: bool,
    /// What came last, and whether any of those that came alike in a row was given to this call.
    pub(crate) row: Option<(Content, bool)>,
    /// When it is given up.
    pub(crate) due: Instant,
    /// A stop before it, which is confirmed if this look shows that the adapter sends nothing back; and whether it then is
    /// true.
    pub(crate) stop_before: Option<Result<(), Wrong>>,
}

/// Where the program stands.
#[derive(Debug, Clone)]
pub(crate) enum Standing {
    /// It may ask anything.
    Free,
    /// Its request is on the wire.
    InFlight(Call),
    /// A read was answered, and once is not enough.
    Hearing(Call),
    /// A read that owes only this call's answer was left open.
    LeftOpen(Call),
    /// A stop was confirmed, perhaps by the adapter: that has to be looked for.
    MustLook(Call, Result<(), Wrong>),
}

/// How a question may be put.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// At once, whatever is in doubt.
    InDoubt,
    /// As it is, because no open answer could pass for its own.
    Apart,
    /// As it is, with what its answer will be worth.
    Plain(Attribution),
}

/// The program.
#[derive(Debug, Clone)]
pub struct Program {
    pub(crate) standing: Standing,
    heeds: bool,
    /// What is known of the adapter.
    pub knowledge: Knowledge,
}

impl Program {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let knowledge = Knowledge::at_opening(scenario.adapter);
        Self { standing: Standing::Free, heeds: scenario.heeds, knowledge }
    }

    /// Unit, kind and number of the request in flight.
    pub fn in_flight(&self) -> Option<(usize, Kind, u16)> {
        match &self.standing {
            Standing::InFlight(call) => Some((call.unit, call.kind, call.latest)),
            _ => None,
        }
    }

    /// The call that is not over.
    pub fn call(&self) -> Option<&Call> {
        match &self.standing {
            Standing::Free => None,
            Standing::InFlight(call)
            | Standing::Hearing(call)
            | Standing::LeftOpen(call)
            | Standing::MustLook(call, _) => Some(call),
        }
    }

    /// The first request of the call that is not over.
    pub fn first(&self) -> Option<u16> {
        self.call().map(|call| call.first)
    }

    /// Whether a stop was confirmed, and it has to be seen first whether the adapter did it.
    pub(crate) fn must_look(&self) -> bool {
        matches!(self.standing, Standing::MustLook(..))
    }

    /// The unit whose stop was confirmed, where it is not known yet whether the adapter did it.
    pub(crate) fn stop_to_look_for(&self) -> Option<usize> {
        match &self.standing {
            Standing::MustLook(call, _) => Some(call.unit),
            Standing::InFlight(look) if look.stop_before.is_some() => Some(look.unit),
            _ => None,
        }
    }

    /// Whatever was asked is not waited for any more.
    pub(crate) fn forget_call(&mut self) {
        self.standing = Standing::Free;
    }

    /// How `kind` may be asked of `unit` now, if it may (`Owner::next` in `crates/line/src/owner.rs`).
    pub fn may_ask(&self, state: &State, unit: usize, kind: Kind) -> Option<Question> {
        if let Standing::MustLook(call, _) = &self.standing {
            return (kind == Kind::Look && call.unit == unit).then_some(Question::InDoubt);
        }
        let (now, unit, request) = (state.now, address(unit), kind.request());
        match kind {
            Kind::Stop => return Some(Question::InDoubt),
            Kind::Look => return (self.knowledge == Knowledge::Auto).then_some(Question::InDoubt),
            _ if !self.heeds => return Some(Question::InDoubt),
            _ => {}
        }
        let in_quarantine = state.master.in_quarantine(now, unit);
        let attribution = state.master.attribution(now, unit, &request);
        let is_apart = state.master.tells_apart(now, unit, &request);
        if kind.is_read() && is_apart && (in_quarantine || attribution.may_be_mistaken()) {
            return Some(Question::Apart);
        }
        let must_look = request.expected().may_repeat_request() || in_quarantine;
        if self.knowledge == Knowledge::Auto && must_look {
            return None;
        }
        match attribution {
            Attribution::Wait(_) | Attribution::Others(_) => None,
            sure => Some(Question::Plain(sure)),
        }
    }

    /// Whether the same may be asked once more: because once is not enough (`Call::hear`), or because all that the unit owes
    /// is the answer to it (`Course::owes_only_this`). Whether it then goes out in doubt.
    pub fn may_repeat(&self) -> Option<bool> {
        match &self.standing {
            Standing::LeftOpen(_) => Some(true),
            Standing::Hearing(_) => Some(false),
            _ => None,
        }
    }

    /// Until when `unit` cannot be asked something, where only time helps.
    pub fn waits_until(&self, state: &State, unit: usize, scenario: &Scenario) -> Vec<Instant> {
        let until = |kind: &Kind| match state.master.attribution(state.now, address(unit), &kind.request()) {
            Attribution::Wait(until) => Some(until),
            _ => None,
        };
        scenario.kinds.iter().filter_map(until).collect()
    }

    /// After the latest request has asked `unit` something new.
    pub(crate) fn asked(&self, state: &State, unit: usize, kind: Kind, put: Question, timeout: Duration) -> Self {
        let number = state.requests;
        let sure = if let Question::Plain(sure) = put { sure } else { Attribution::Certain };
        let agreement = Agreement::new(sure, 1);
        let stop_before = match &self.standing {
            Standing::MustLook(_, wrong) => Some(*wrong),
            _ => None,
        };
        let call = Call {
            unit,
            kind,
            first: number,
            latest: number,
            asked: 1,
            is_immediate: agreement.is_immediate(),
            apart: put == Question::Apart,
            agreement,
            ends_doubt: ends_doubt(state, unit, kind),
            due: state.now + timeout,
            row: None,
            stop_before,
        };
        Self { standing: Standing::InFlight(call), ..*self }
    }

    /// After the latest request has asked the same once more.
    pub(crate) fn asked_again(&self, state: &State, timeout: Duration) -> Self {
        let standing = match self.standing.clone() {
            Standing::Hearing(call) | Standing::LeftOpen(call) => Standing::InFlight(Call {
                latest: state.requests,
                asked: call.asked + 1,
                ends_doubt: ends_doubt(state, call.unit, call.kind),
                due: state.now + timeout,
                ..call
            }),
            other => other,
        };
        Self { standing, ..*self }
    }

    /// Hears `answer`, which the master takes for the call's, and says whether it came often enough.
    pub(crate) fn hears(&mut self, answer: &Answer<'_>) -> bool {
        match &mut self.standing {
            Standing::InFlight(call) => call.agreement.hear(address(call.unit), answer),
            _ => false,
        }
    }

    pub(crate) fn hash_at<H: Hasher>(&self, now: Instant, hasher: &mut H) {
        std::mem::discriminant(&self.standing).hash(hasher);
        self.knowledge.hash(hasher);
        if let Some(call) = self.call() {
            (call.unit, call.kind, call.asked, call.is_immediate, call.apart, call.ends_doubt, call.row).hash(hasher);
            (offset(now, call.due), call.stop_before).hash(hasher);
            fingerprint::of(now, &call.agreement).hash(hasher);
        }
    }
}

/// Whether `kind` is asked of `unit` in quarantine, because its answer cannot be mistaken.
fn ends_doubt(state: &State, unit: usize, kind: Kind) -> bool {
    let (now, unit) = (state.now, address(unit));
    state.master.in_quarantine(now, unit) && state.master.tells_apart(now, unit, &kind.request())
}
