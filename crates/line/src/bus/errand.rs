//! Requests of callers that do not wait in a thread of their own, such as those of an event loop.
//!
//! An [`Errand`] waits in the queue of its bus like any caller, and a thread of the bus's crew carries it out when its turn
//! has come. Who does not want it any more takes it back: what still waits is never sent, and what is on the wire is left to
//! end by itself, so that the line stays clean, and is not repeated.

use std::fmt;
use std::sync::Arc;

use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{Adu, Answer, AnswerLength, Destination, Frame, Instant, Request};

use crate::ask::Done;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::system::sync::atomic::AtomicBool;
use crate::turns::order::Program;

/// A request, and who is told what became of it.
pub struct Errand {
    pub(super) destination: Destination,
    /// The whole request frame.
    frame: Vec<u8>,
    /// Whether it is an echo whose word is chosen when its turn has come.
    is_fresh_echo: bool,
    /// For a request that is carried as it is.
    answer: Option<AnswerLength>,
    pub(super) options: CallOptions,
    /// Whose it is, of those who use the line through this program.
    pub(super) program: Program,
    pub(super) wanted: Arc<AtomicBool>,
    /// Asked when its turn has come; taken then.
    begins: Option<Begins>,
    /// Taken when it is called.
    then: Option<Then>,
}

/// False: it is not carried out, and nobody is told.
type Begins = Box<dyn FnOnce() -> bool + Send>;

type Then = Box<dyn FnOnce(Result<Reply, Box<CallError>>) + Send>;

/// What came of an errand that went well.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Reply {
    /// The answer's PDU; empty after a broadcast.
    pub pdu: Vec<u8>,
    /// When it happened.
    pub done: Done,
}

impl Errand {
    /// `request` to `destination`; `then` is called once, by another thread, with what came of it.
    ///
    /// What is not carried out because the bus was closed ends with [`Failure::Closed`].
    pub fn new(
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        then: impl FnOnce(Result<Reply, Box<CallError>>) + Send + 'static,
    ) -> Self {
        let frame = Adu::request(destination, request).as_bytes().to_vec();
        let answer = match *request {
            Request::Custom { answer, .. } => Some(answer),
            _ => None,
        };
        let wanted = Arc::new(AtomicBool::new(true));
        Self {
            destination,
            frame,
            is_fresh_echo: false,
            answer,
            options,
            program: Program::default(),
            wanted,
            begins: None,
            then: Some(Box::new(then)),
        }
    }

    /// It is another program's, which uses the line through this one.
    #[cfg(feature = "tcp")]
    pub(crate) fn of_program(mut self, program: Program) -> Self {
        self.program = program;
        self
    }

    /// As [`new`](Self::new), for an echo of a word that no echo still under way carries. Which one that is, is known where
    /// the line is: it is asked there when its turn has come, and who leaves the errand does not wait for that.
    pub fn echo(
        destination: Destination,
        options: CallOptions,
        then: impl FnOnce(Result<Reply, Box<CallError>>) + Send + 'static,
    ) -> Self {
        let mut errand = Self::new(destination, &Request::echo(0), options, then);
        errand.is_fresh_echo = true;
        errand
    }

    /// `begins` is asked when its turn has come, and may say that it is not wanted any more.
    #[cfg(feature = "tcp")]
    pub(crate) fn beginning(mut self, begins: impl FnOnce() -> bool + Send + 'static) -> Self {
        self.begins = Some(Box::new(begins));
        self
    }

    /// What tells whether somebody still waits for it.
    #[cfg(feature = "tcp")]
    pub(crate) fn wanted(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.wanted)
    }

    /// Its turn has come; whether it is carried out.
    pub(super) fn begins(&mut self) -> bool {
        self.begins.take().is_none_or(|begins| begins())
    }

    /// What is asked; an echo carries `fresh`, unless its word was given. Always there: it was made of a request.
    pub(super) fn request(&self, fresh: impl FnOnce() -> u16) -> Option<Request<'_>> {
        if self.is_fresh_echo {
            return Some(Request::echo(fresh()));
        }
        let pdu = Frame::parse(&self.frame).ok()?.pdu();
        match self.answer {
            Some(length) => Request::custom(pdu, length),
            None => Request::parse(pdu),
        }
        .ok()
    }

    /// Whether somebody still waits for it.
    #[cfg(all(any(unix, windows), feature = "share"))]
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted.load(crate::system::sync::atomic::Ordering::Acquire)
    }

    /// It is not carried out, for `failure`; `ended` is when that was known.
    pub(super) fn fail(mut self, failure: Failure, ended: Option<Instant>) {
        self.failed(failure, ended);
    }

    /// Nobody is told any more what comes of it.
    pub(super) fn forget(mut self) {
        self.then = None;
    }

    fn failed(&mut self, failure: Failure, ended: Option<Instant>) {
        let (destination, request) = (self.destination, std::mem::take(&mut self.frame));
        self.tell(Err(Box::new(CallError {
            failure,
            destination,
            request,
            protocol: Protocol::Modbus,
            raw: Vec::new(),
            sent: None,
            ended,
            set_again: None,
        })));
    }

    pub(super) fn tell(&mut self, result: Result<Reply, Box<CallError>>) {
        if let Some(then) = self.then.take() {
            then(result);
        }
    }
}

impl Drop for Errand {
    /// Nobody waits for ever: the thread that carried it out panicked, or its bus is gone.
    fn drop(&mut self) {
        if self.then.is_some() {
            self.failed(Failure::Closed, None);
        }
    }
}

impl fmt::Debug for Errand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Errand")
            .field("destination", &self.destination)
            .field("frame", &self.frame)
            .finish_non_exhaustive()
    }
}

/// The answer as it came.
pub(super) fn pdu_of(from: Destination, answer: &Answer<'_>) -> Vec<u8> {
    match from {
        Destination::Unit(unit) => {
            let frame = Adu::answer(unit, answer);
            Frame::parse(frame.as_bytes()).map(|frame| frame.pdu().to_vec()).unwrap_or_default()
        }
        Destination::Broadcast => Vec::new(),
    }
}
