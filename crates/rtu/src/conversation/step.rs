//! What a conversation says to whoever has the line.

use super::outcome::{Exchange, Outcome};
use crate::Instant;

/// What whoever has the line does next for a call.
#[derive(Debug)]
#[non_exhaustive]
pub enum Step<'a, 'r> {
    /// Nothing of it is on the wire: whoever is more urgent may ask now. Where the line is lost, it is opened again.
    LetPass,
    /// Leave the line to others until this moment. Earlier is harmless.
    StandBy(Instant),
    /// Send these bytes in one piece, and say when the last will have left by [`Conversation::sent`](crate::Conversation::sent).
    Send(&'a [u8]),
    /// Wait for bytes, no longer than until this moment, and give them to [`Conversation::heard`](crate::Conversation::heard): none, too.
    Listen(Instant),
    /// A request is over. For whoever keeps figures; the call goes on.
    Heard(Exchange<'r>),
    /// The call is over. It says the same again to who asks again.
    Done(Outcome<'a>),
}

/// Something was said to a [`Conversation`](crate::Conversation) that it did not wait for. It changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfTurn;

impl core::fmt::Display for OutOfTurn {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("nothing was asked that this could be the answer to")
    }
}

impl core::error::Error for OutOfTurn {}

/// How often something happened on behalf of one call, since [`Conversation::take_counts`](crate::Conversation::take_counts).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Counts {
    /// Requests sent once more.
    pub retries: u32,
    /// Reads asked twice, because the answer to another one might have been taken for theirs.
    pub verified: u32,
    /// Requests that found the way back after one was left open, and reads that were put so that their answer is told apart.
    pub resyncs: u32,
}
