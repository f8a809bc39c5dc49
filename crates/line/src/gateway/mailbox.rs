//! What one connection's desk is told by its reader and by the line's workers, in the order in which it came.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use drivebus_rtu::Instant;

use crate::gateway::asked::Asked;
use crate::gateway::desk::Failed;
use crate::system::clock::monotonic;

/// Requests that a reader may have read beyond those that the desk has taken: then it reads no more.
const AHEAD: usize = 64;

/// What came of a request: the PDU of its answer, or why there is none.
pub(super) type Answered = Result<Vec<u8>, Failed>;

/// One thing that the desk is told.
#[derive(Debug)]
pub(super) enum Mail {
    /// The client asks, since that moment.
    Asked(Asked, Instant),
    /// What came of a request.
    Came(u64, Answered),
}

/// The mailbox of one desk.
#[derive(Debug, Default)]
pub(super) struct Mailbox {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    mail: VecDeque<Mail>,
    asked: usize,
    /// Why nothing comes any more: words for people, empty where the client ended it.
    over: Option<String>,
}

/// What the desk finds.
#[derive(Debug)]
pub(super) enum Found {
    Mail(Mail),
    /// Nothing, until then.
    Nothing,
    /// The connection is over.
    Over(String),
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Leaves a request, once there is room. False: the connection is over.
    pub(super) fn ask(&self, asked: Asked, at: Instant) -> bool {
        let mut state = self.lock();
        while state.asked >= AHEAD && state.over.is_none() {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.over.is_some() {
            return false;
        }
        state.asked += 1;
        state.mail.push_back(Mail::Asked(asked, at));
        self.changed.notify_all();
        true
    }

    /// Leaves what came of request `number`. Nobody is waited for: as many come as are on their way.
    pub(super) fn come(&self, number: u64, answered: Answered) {
        self.lock().mail.push_back(Mail::Came(number, answered));
        self.changed.notify_all();
    }

    /// Ends the connection. The first one to say why counts.
    pub(super) fn end(&self, why: String) {
        self.lock().over.get_or_insert(why);
        self.changed.notify_all();
    }

    /// Whether the client asks something that the desk has not taken yet.
    pub(super) fn has_asked(&self) -> bool {
        self.lock().asked > 0
    }

    /// The next thing, by `until`. That the connection is over goes before all else.
    pub(super) fn next(&self, until: Option<Instant>) -> Found {
        let mut state = self.lock();
        loop {
            if let Some(why) = &state.over {
                return Found::Over(why.clone());
            }
            if let Some(mail) = state.mail.pop_front() {
                state.asked -= usize::from(matches!(mail, Mail::Asked(..)));
                self.changed.notify_all();
                return Found::Mail(mail);
            }
            let Some(until) = until else {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let left = until.saturating_duration_since(monotonic());
            if left.is_zero() {
                return Found::Nothing;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
