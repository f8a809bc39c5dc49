//! One request as it goes to the line, and when an exchange happened.

use std::time::Duration;

use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{Adu, Destination, Instant, Meanings, Request, UnitAddress};

use crate::error::{CallError, Failure};
use crate::turns::queue::Stops;

/// One request on its way.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ask<'a> {
    pub(crate) destination: Destination,
    pub(crate) request: &'a Request<'a>,
    /// How long to wait after the request: for the answer, or for the units to act on a broadcast.
    pub(crate) timeout: Duration,
    /// Whether a read waits no longer than its unit's answers have taught.
    pub(crate) learns: bool,
    /// The least silence before it, if that is more than every request keeps.
    pub(crate) gap: Duration,
    /// Whether it goes out at once, even to a unit that may still answer something else.
    pub(crate) in_doubt: bool,
    /// Where stops wait that go before it, even when it is on its way: its unit was silent the last time.
    pub(crate) yields: Option<&'a dyn Stops>,
    /// What the exceptions of its unit mean to another program that asks; `None` where what is set here holds.
    pub(crate) meanings: Option<&'a Meanings>,
}

/// When an exchange happened, on the line's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Done {
    /// The first bit of the request.
    pub sent: Instant,
    /// The last byte of the answer.
    pub ended: Instant,
}

impl Ask<'_> {
    /// Who is asked, if it is one unit.
    pub(crate) fn unit(&self) -> Option<UnitAddress> {
        self.destination.unit()
    }

    /// The whole request frame.
    pub(crate) fn frame(&self) -> Vec<u8> {
        Adu::request(self.destination, self.request).as_bytes().to_vec()
    }

    /// The error of this request; `sent` and `ended` are moments of the line's clock, `raw` is what came.
    pub(crate) fn failed(
        &self,
        failure: Failure,
        sent: Option<Instant>,
        ended: impl Into<Option<Instant>>,
        raw: &[u8],
    ) -> Box<CallError> {
        let (destination, request, raw) = (self.destination, self.frame(), raw.to_vec());
        let ended = ended.into();
        let protocol = match self.request {
            Request::Huanyang(_) => Protocol::Huanyang,
            _ => Protocol::Modbus,
        };
        Box::new(CallError { failure, destination, request, protocol, raw, sent, ended, set_again: None })
    }
}
