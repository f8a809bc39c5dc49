//! What is asked, and how its caller wants it asked.

use core::time::Duration;

use crate::{Destination, Meanings, Request};

/// How urgent a call is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Urgency {
    /// It halts something: it waits for nobody, and is never kept off the line.
    Stop,
    /// Somebody waits for it.
    #[default]
    Call,
    /// It comes again by itself: others are not kept waiting for it.
    Poll,
}

/// What is asked of whom, and how.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Question<'r> {
    /// Who is asked.
    pub destination: Destination,
    /// What.
    pub request: Request<'r>,
    /// How long to wait after the request: for the end of the answer, or for the units to act on a broadcast.
    pub timeout: Duration,
    /// The least silence before each request, if that is more than every request keeps.
    pub gap: Duration,
    /// How often a read is asked once more; after a damaged answer, which took no time-out, twice as often. A write never is,
    /// unless its words can be [read back](Self::read_back).
    pub retries: u32,
    /// How urgent it is.
    pub urgency: Urgency,
    /// Whether it goes out at once, whatever is in doubt about the unit. Its confirmation may then belong to the very same
    /// request, sent before.
    pub in_doubt: bool,
    /// Whether a read is asked until the same words came twice in a row.
    pub verify: bool,
    /// Where the words of a write can be read. Then a confirmation that is missing is looked for there, and the write is
    /// repeated only while the unit shows other words. For absolute values only: what a command does, nobody can read back.
    pub read_back: Option<u16>,
    /// Over which connection it must go ([`Known::is_connection`](crate::Known::is_connection)): over any other nothing is sent.
    pub connection: Option<u64>,
    /// What the unit's exceptions mean.
    pub meanings: Meanings,
}

impl<'r> Question<'r> {
    /// `request` of `destination`, asked once, with `timeout` to wait for the answer.
    pub const fn new(destination: Destination, request: Request<'r>, timeout: Duration) -> Self {
        Self {
            destination,
            request,
            timeout,
            gap: Duration::ZERO,
            retries: 0,
            urgency: Urgency::Call,
            in_doubt: false,
            verify: false,
            read_back: None,
            connection: None,
            meanings: Meanings::STANDARD,
        }
    }

    /// Sets [`gap`](Self#structfield.gap).
    #[must_use]
    pub const fn gap(self, gap: Duration) -> Self {
        Self { gap, ..self }
    }

    /// Sets [`retries`](Self#structfield.retries).
    #[must_use]
    pub const fn retries(self, retries: u32) -> Self {
        Self { retries, ..self }
    }

    /// Sets [`urgency`](Self#structfield.urgency).
    #[must_use]
    pub const fn urgency(self, urgency: Urgency) -> Self {
        Self { urgency, ..self }
    }

    /// Sets [`in_doubt`](Self#structfield.in_doubt).
    #[must_use]
    pub const fn in_doubt(self, in_doubt: bool) -> Self {
        Self { in_doubt, ..self }
    }

    /// Sets [`verify`](Self#structfield.verify).
    #[must_use]
    pub const fn verify(self, verify: bool) -> Self {
        Self { verify, ..self }
    }

    /// Sets [`read_back`](Self#structfield.read_back).
    #[must_use]
    pub const fn read_back(self, read_back: Option<u16>) -> Self {
        Self { read_back, ..self }
    }

    /// Sets [`connection`](Self#structfield.connection).
    #[must_use]
    pub const fn connection(self, connection: Option<u64>) -> Self {
        Self { connection, ..self }
    }

    /// Sets [`meanings`](Self#structfield.meanings).
    #[must_use]
    pub const fn meanings(self, meanings: Meanings) -> Self {
        Self { meanings, ..self }
    }
}
