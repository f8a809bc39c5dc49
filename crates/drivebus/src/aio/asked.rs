//! A call as a future: asked when it is polled first, taken back when it is dropped.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::thread;

use drivebus_line::{Bus as Core, CallError, CallOptions, Errand, Reply, Running};
use drivebus_rtu::{Destination, Request};

use super::slot::Slot;
use crate::error::Error;

/// Who is told what came of an errand.
type Then = Box<dyn FnOnce(Result<Reply, Box<CallError>>) + Send>;

/// What was asked of a bus: a future of its answer.
///
/// Nothing is asked before it is polled first. Dropped while it waits for the line, it is taken back and never sent.
#[must_use = "nothing is asked before it is awaited"]
pub struct Asked<T> {
    slot: Arc<Slot<Result<T, Error>>>,
    state: State,
}

enum State {
    /// Not asked yet.
    Begins(Start),
    /// With the bus, or already answered.
    Left(Option<Running>),
    /// In a thread of its own, which looks now and then whether it is still wanted.
    Apart(Arc<AtomicBool>),
}

enum Start {
    Errand(Arc<Core>, Errand),
    Apart(Box<dyn FnOnce(&AtomicBool) + Send>),
}

impl<T: Send + 'static> Asked<T> {
    /// `request` to `to`; `make` makes of the reply what the program gets.
    pub(super) fn errand(
        core: &Arc<Core>,
        to: Destination,
        request: &Request<'_>,
        options: CallOptions,
        make: impl FnOnce(Reply) -> T + Send + 'static,
    ) -> Self {
        Self::left(core, make, |then| Errand::new(to, request, options, then))
    }

    /// An echo of a word that no other one carries, from `to`; `make` makes of the reply what the program gets.
    pub(super) fn echo(
        core: &Arc<Core>,
        to: Destination,
        options: CallOptions,
        make: impl FnOnce(Reply) -> T + Send + 'static,
    ) -> Self {
        Self::left(core, make, |then| Errand::echo(to, options, then))
    }

    /// What `errand` makes of who is told what came of it.
    fn left(
        core: &Arc<Core>,
        make: impl FnOnce(Reply) -> T + Send + 'static,
        errand: impl FnOnce(Then) -> Errand,
    ) -> Self {
        let slot = Slot::new();
        let result = Arc::clone(&slot);
        let errand = errand(Box::new(move |reply| result.put(reply.map(make).map_err(Error::from))));
        Self { slot, state: State::Begins(Start::Errand(Arc::clone(core), errand)) }
    }

    /// `work`, which blocks, in a thread of its own.
    pub(super) fn apart(work: impl FnOnce(&AtomicBool) -> Result<T, Error> + Send + 'static) -> Self {
        let slot = Slot::new();
        let result = Arc::clone(&slot);
        let work = Box::new(move |wanted: &AtomicBool| result.put(work(wanted)));
        Self { slot, state: State::Begins(Start::Apart(work)) }
    }

    /// What is known already.
    pub(super) fn refused(error: Error) -> Self {
        let slot = Slot::new();
        slot.put(Err(error));
        Self { slot, state: State::Left(None) }
    }
}

impl Start {
    fn begin(self) -> Result<State, Error> {
        match self {
            Self::Errand(core, errand) => Ok(State::Left(core.send(errand))),
            Self::Apart(work) => {
                let wanted = Arc::new(AtomicBool::new(true));
                let asked = Arc::clone(&wanted);
                let thread = thread::Builder::new().name(String::from("drivebus-apart"));
                let spawned = thread.spawn(move || work(&asked));
                spawned.map_err(|error| Error::not_allowed(format!("the system gives no thread: {error}")))?;
                Ok(State::Apart(wanted))
            }
        }
    }
}

impl<T> Future for Asked<T> {
    type Output = Result<T, Error>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let asked = &mut *self;
        if let State::Begins(_) = asked.state
            && let State::Begins(start) = std::mem::replace(&mut asked.state, State::Left(None))
        {
            match start.begin() {
                Ok(state) => asked.state = state,
                Err(error) => return Poll::Ready(Err(error)),
            }
        }
        asked.slot.poll(context.waker())
    }
}

impl<T> Drop for Asked<T> {
    fn drop(&mut self) {
        match &self.state {
            State::Left(Some(running)) => running.abandon(),
            State::Apart(wanted) => wanted.store(false, Ordering::Release),
            State::Begins(_) | State::Left(None) => {}
        }
    }
}

impl<T> fmt::Debug for Asked<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Asked").finish_non_exhaustive()
    }
}
