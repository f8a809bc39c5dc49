//! What happened at a gateway: counted, and told in words.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::error::Hex;
use crate::gateway::asked::Asked;
use crate::gateway::audit::Outcome;

/// Words that nobody has fetched; the oldest give way.
const KEPT: usize = 256;

/// What happened at a gateway so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct GatewayStats {
    /// Connections that are open.
    pub clients: usize,
    /// Connections that were let in.
    pub let_in: u64,
    /// Connections that were ended here: what came was no request, came too slowly, or an answer was not taken.
    pub cut_off: u64,
    /// Connections that gave way to others.
    pub gave_way: u64,
    /// Requests.
    pub requests: u64,
    /// Requests that were answered by what the unit said.
    pub answered: u64,
    /// Requests that are not allowed.
    pub refused: u64,
    /// Requests that were answered by an exception: of the unit, or because the line brought no answer of it.
    pub failed: u64,
    /// Requests that were answered by 0BH because their time was up.
    pub late: u64,
    /// Requests of RTU over TCP whose client asked the next one instead of waiting: they are not answered, and what was not sent
    /// of them was taken back.
    pub given_up: u64,
    /// Requests beyond those that one connection may have on their way.
    pub busy: u64,
    /// Requests that were answered by the read that another one began.
    pub together: u64,
    /// Writes that went out and were not refused by their unit.
    pub written: u64,
    /// Motors that were halted for a client that was gone or silent.
    pub halted: u64,
    /// Writes that stand in no audit, though they should: the disk did not follow.
    pub unaudited: u64,
}

/// The same, while it happens.
#[derive(Debug, Default)]
pub(super) struct Counts {
    let_in: AtomicU64,
    cut_off: AtomicU64,
    gave_way: AtomicU64,
    requests: AtomicU64,
    answered: AtomicU64,
    refused: AtomicU64,
    failed: AtomicU64,
    late: AtomicU64,
    given_up: AtomicU64,
    busy: AtomicU64,
    together: AtomicU64,
    written: AtomicU64,
    halted: AtomicU64,
    unaudited: AtomicU64,
    told: Mutex<VecDeque<String>>,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

impl Counts {
    pub(super) fn let_in(&self) {
        count(&self.let_in);
    }

    pub(super) fn cut_off(&self, client: &str, why: &str) {
        count(&self.cut_off);
        self.tell(format!("{client} was cut off: {why}"));
    }

    pub(super) fn gave_way(&self, to: &str) {
        count(&self.gave_way);
        self.tell(format!("as many clients are connected as may: one that asked nothing gave way to {to}"));
    }

    pub(super) fn asked(&self) {
        count(&self.requests);
    }

    pub(super) fn answered(&self, by_unit: bool) {
        count(if by_unit { &self.answered } else { &self.failed });
    }

    /// `why`: what is not allowed.
    pub(super) fn refused(&self, client: &str, why: &str, asked: &Asked) {
        count(&self.refused);
        let shown = &asked.pdu[..asked.pdu.len().min(16)];
        let more = if shown.len() < asked.pdu.len() { " …" } else { "" };
        self.tell(format!("{client} {why}: refused {}{more}", Hex(shown)));
    }

    /// What is at the address of a unit says that it is another one.
    pub(super) fn another(&self, client: &str, unit: u8) {
        self.tell(format!(
            "{client} writes to unit {unit}, and another drive answers at its address: nothing was sent"
        ));
    }

    /// A write ended.
    pub(super) fn written(&self, outcome: Outcome) {
        if matches!(outcome, Outcome::Done | Outcome::Sent | Outcome::Unknown) {
            count(&self.written);
        }
    }

    pub(super) fn unaudited(&self) {
        count(&self.unaudited);
        self.tell("a line of the audit is lost: the disk does not follow".to_owned());
    }

    /// The motor of `unit` is halted, since `client`, which commanded it, `why`.
    pub(super) fn halts(&self, client: &str, unit: u8, why: &str) {
        count(&self.halted);
        self.tell(format!("{client}, which commanded the motor of unit {unit}, {why}: the motor is halted"));
    }

    /// Whether the unit `took` that.
    pub(super) fn halted(&self, client: &str, unit: u8, took: bool) {
        self.tell(if took {
            format!("unit {unit} took the halt for {client}")
        } else {
            format!("unit {unit} was not halted for {client}: another drive answers at its address now")
        });
    }

    /// What shows of a halt that the unit took.
    pub(super) fn shows(&self, client: &str, unit: u8, shown: &str) {
        self.tell(format!("unit {unit}, which was halted for {client}: {shown}"));
    }

    pub(super) fn late(&self) {
        count(&self.late);
    }

    pub(super) fn given_up(&self) {
        count(&self.given_up);
    }

    pub(super) fn busy(&self) {
        count(&self.busy);
    }

    /// One read begins for so many requests.
    pub(super) fn together(&self, askers: usize) {
        self.together.fetch_add(askers.saturating_sub(1) as u64, Ordering::Relaxed);
    }

    pub(super) fn tell(&self, words: String) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.len() == KEPT {
            told.pop_front();
        }
        told.push_back(words);
    }

    pub(super) fn take_told(&self) -> Vec<String> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).drain(..).collect()
    }

    pub(super) fn stats(&self, clients: usize) -> GatewayStats {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        GatewayStats {
            clients,
            let_in: of(&self.let_in),
            cut_off: of(&self.cut_off),
            gave_way: of(&self.gave_way),
            requests: of(&self.requests),
            answered: of(&self.answered),
            refused: of(&self.refused),
            failed: of(&self.failed),
            late: of(&self.late),
            given_up: of(&self.given_up),
            busy: of(&self.busy),
            together: of(&self.together),
            written: of(&self.written),
            halted: of(&self.halted),
            unaudited: of(&self.unaudited),
        }
    }
}
