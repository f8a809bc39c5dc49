//! Adapters that send our own bytes back: how the owner of a line finds out, and what it does until it knows.
//!
//! A write and an echo are confirmed by the very bytes of the request, so an adapter that echoes would confirm what no
//! unit has heard.

use drivebus_rtu::{Destination, Request, Table, Tally};

use crate::ask::{Ask, Done};
use crate::error::{CallError, Failure};
use crate::options::AdapterEcho;
use crate::owner::resync::{MAX_WORDS, Tried};
use crate::owner::{Owner, is_line_trouble};

/// How often one attempt looks whether the adapter echoes, where noise hides it.
const LOOKS: u32 = 3;

impl Owner {
    /// Reads a word to see whether the request comes back; what is answered does not matter. Before a read whose answer is
    /// to be told `apart`, one word more than that asks for.
    ///
    /// # Errors
    ///
    /// The port was lost, the caller gave up, or nothing was shown however often it was tried: the next request's echo
    /// could be taken for its answer.
    pub(crate) fn look_for_echo(
        &mut self,
        ask: &Ask<'_>,
        tried: &mut Tried,
        apart: bool,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Box<CallError>> {
        let (address, count) = match *ask.request {
            Request::Read { table: Table::Holding, address, count, .. } if apart && count < MAX_WORDS => {
                (address, count + 1)
            }
            Request::Read { table: Table::Holding, address, .. } => (address, 1),
            _ => (0, 1),
        };
        let count = self.free_length(ask.destination, address, count);
        let Ok(read) = Request::read(address, count).or_else(|_| Request::read(address, 1)) else {
            return Ok(());
        };
        tried.looks += 1;
        let result = self.exchange(&Ask { request: &read, in_doubt: true, ..*ask }, give_up, &mut |_| ());
        if self.echo != AdapterEcho::Auto {
            return Ok(());
        }
        match result {
            Err(error) if !is_line_trouble(&error.failure) => Err(Box::new(CallError { sent: None, ..*error })),
            Err(error) if tried.looks >= LOOKS && !matches!(error.failure, Failure::Refused { .. }) => {
                Err(Box::new(CallError { sent: None, ..*error }))
            }
            _ if tried.looks >= LOOKS => Err(ask.failed(Failure::Doubtful, None, self.now(), &[])),
            _ => Ok(()),
        }
    }

    /// `result` of a request that did not wait until it was known whether the adapter echoes: if it does, it may have been
    /// its echo that came. Only the confirmation waits for that, not the stop.
    ///
    /// # Errors
    ///
    /// The request went out, and it is not known whether the unit took it.
    pub(crate) fn unless_echoed(
        &mut self,
        ask: &Ask<'_>,
        result: Result<Done, Box<CallError>>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Done, Box<CallError>> {
        if self.echo == AdapterEcho::Auto { self.unless_it_echoes(ask, result?, give_up) } else { result }
    }

    #[cold]
    fn unless_it_echoes(
        &mut self,
        ask: &Ask<'_>,
        done: Done,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Done, Box<CallError>> {
        let Destination::Unit(unit) = ask.destination else {
            return Ok(done);
        };
        if !ask.request.expected().may_repeat_request() {
            return Ok(done);
        }
        // Whatever becomes of it: what counts is whether the line has shown by then that it does not echo.
        let _ = self.look_for_echo(ask, &mut Tried::default(), false, give_up);
        if self.echo == AdapterEcho::Absent {
            return Ok(done);
        }
        self.master.still_owed(done.ended, unit, ask.request, ask.timeout);
        let failure = Failure::NoAnswer { timeout: ask.timeout, attempts: 1 };
        Err(ask.failed(failure, Some(done.sent), done.ended, &[]))
    }

    /// Keeps what the exchange has shown about the adapter and the line.
    pub(crate) fn learn(&mut self, ask: &Ask<'_>, result: &Result<Done, Box<CallError>>, tally: Tally) {
        if self.given_echo != AdapterEcho::Auto {
            return;
        }
        let is_broadcast = ask.destination == Destination::Broadcast;
        if tally.own_echo > 0 && (self.echo == AdapterEcho::Auto || !is_broadcast) {
            self.echo = AdapterEcho::Present;
            self.master.strip_echo(true);
            return;
        }
        if self.echo == AdapterEcho::Absent || is_broadcast || ask.request.expected().may_repeat_request() {
            return;
        }
        let silent = usize::try_from(tally.noise).is_ok_and(|noise| 4 * noise <= ask.request.adu_len());
        // Bytes that may be what is left of the request may be left of an echo. Others are noise, however many, as long as
        // an answer shows that the line carries more than noise.
        let clean = tally.own_remnant == 0
            && match result {
                Ok(_) => true,
                Err(error) => match error.failure {
                    Failure::Refused { .. } | Failure::Unreached => true,
                    Failure::NoAnswer { .. } => silent && error.raw.is_empty(),
                    _ => false,
                },
            };
        match self.echo {
            AdapterEcho::Auto if clean => self.echo = AdapterEcho::Absent,
            // It did not echo this time: to be looked at again before anything depends on it.
            AdapterEcho::Present if clean && result.is_ok() => {
                self.echo = AdapterEcho::Auto;
                self.master.strip_echo(false);
            }
            _ => {}
        }
    }
}
