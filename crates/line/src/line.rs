//! What every kind of line promises: the trait [`Line`] and the error of a port.
//!
//! Serial ports, TCP connections and the simulated line implement it; the bus owner uses nothing else of them.

use std::fmt;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::Instant;

/// What tells the time of a line, from any thread and without waiting.
pub type LineClock = Arc<dyn Fn() -> Instant + Send + Sync>;

/// Opens the line, at first and again after it was lost.
pub type Opener = Box<dyn FnMut() -> Result<Box<dyn Line>, PortError> + Send>;

/// A way for bytes to reach units and to come back, with a clock of its own.
///
/// A line knows nothing about frames. It is used by one owner at a time, and no call blocks beyond the moment it is
/// given.
pub trait Line: Send + fmt::Debug {
    /// Now, on this line's clock: real time, or the simulation's.
    fn now(&self) -> Instant;

    /// Makes ready for a request, before each: a connection that the other side closed behind its answer, as some servers do
    /// behind each, is made anew. Nothing is sent.
    ///
    /// # Errors
    ///
    /// [`PortError`]: what was open is of no use any more, and has to be opened again.
    fn make_ready(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// Hands all of `bytes` to the wire in one piece.
    ///
    /// Returns when the last character will have left the wire, computed from the character time because drivers
    /// and adapters report it too early. Does not wait for it, but where it has to switch the direction afterwards.
    ///
    /// # Errors
    ///
    /// [`PortError`]: the port is gone or refused; part of the bytes may have been sent.
    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError>;

    /// Waits until bytes are there or `until` is reached, and returns how many were put into `buffer`.
    ///
    /// 0 means that `until` was reached. Bytes that are there already come at once, whatever `until` says.
    ///
    /// # Errors
    ///
    /// [`PortError`]: the port is gone.
    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError>;

    /// Waits until `until` without touching what arrives.
    fn sleep(&mut self, until: Instant);

    /// How long a character takes, if bytes arrive one by one as the wire carries them; `None` where they come in one
    /// piece, or on a clock of their own.
    ///
    /// Then an answer that has begun is not looked for again before it can be whole.
    fn char_time(&self) -> Option<Duration> {
        None
    }

    /// What is open, for people: a path or an address.
    fn name(&self) -> String;

    /// Whether frames are told apart by something else than silence, as over Modbus TCP.
    fn gapless(&self) -> bool {
        false
    }

    /// The next frame that came and is known to answer an earlier request, where frames are told apart so.
    fn take_late(&mut self) -> Option<Vec<u8>> {
        None
    }

    /// The next frame that came and is known to answer nothing that was asked, where frames are told apart so.
    fn take_strange(&mut self) -> Option<Vec<u8>> {
        None
    }

    /// Whether its clock is a simulation's, which only moves while somebody waits.
    fn is_virtual(&self) -> bool {
        false
    }

    /// This line's clock, which goes on when the line is gone: asked where it is a simulation's. `None` where only the line
    /// knows; then no time passes while it is lost.
    fn clock(&self) -> Option<LineClock> {
        None
    }

    /// Whether an adapter might send our own bytes back to us.
    fn may_echo(&self) -> bool {
        false
    }

    /// Whether another master may ask on the same line, so that its answers come here, too: serial servers have many
    /// clients, and some copy every byte to all of them.
    fn may_have_others(&self) -> bool {
        false
    }

    /// How late a character may be handed over after it was on the wire, because an adapter collects what it receives.
    ///
    /// A time-out shorter than the unit's own time and this hears no answer. A silence is seen this much late, never early.
    fn latency(&self) -> Duration {
        Duration::ZERO
    }

    /// Where the connection ends that the line goes through, if it goes through one: a serial server has many names.
    fn connected_to(&self) -> Option<SocketAddr> {
        None
    }

    /// Where chance comes from that is to be the same each time: a simulation's. `None` where nobody must be able to tell,
    /// as two masters on one line must not do the same in step.
    fn chance(&self) -> Option<u64> {
        None
    }

    /// Looks whether what the port was set to when it was opened still holds, and sets again what another program changed;
    /// in words what that was. `None` where nobody changed anything, or nobody can tell. Asked where a request brought no
    /// right answer.
    fn set_again(&mut self) -> Option<String> {
        None
    }

    /// What the user should know about this line, such as a setting that did not reach the wire.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Why a port does not serve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PortErrorKind {
    /// There is no such port.
    NotFound,
    /// Another program has it.
    Busy,
    /// This user may not open it.
    Denied,
    /// It was open and is gone: unplugged, or the peer closed.
    Lost,
    /// It was closed by its owner.
    Closed,
    /// The port cannot do what was asked of it.
    Unsupported,
    /// Anything else the system reports.
    Other,
}

/// A port that could not be opened, or was lost.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{port}: {message}")]
#[non_exhaustive]
pub struct PortError {
    /// Which kind of trouble.
    pub kind: PortErrorKind,
    /// The port, as it was asked for.
    pub port: String,
    /// What happened and what to do, in words.
    pub message: String,
}

impl PortError {
    /// An error of `kind` on `port`; `message` says what happened and what to do.
    pub fn new(kind: PortErrorKind, port: impl Into<String>, message: impl Into<String>) -> Self {
        Self { kind, port: port.into(), message: without_numbers(message.into()) }
    }
}

/// `message` without the numbers that Rust puts behind what the system says: ` (os error 13)`.
fn without_numbers(mut message: String) -> String {
    const BEGIN: &str = " (os error ";
    while let Some(begin) = message.find(BEGIN) {
        let Some(length) = message[begin..].find(')') else { break };
        message.replace_range(begin..=begin + length, "");
    }
    message
}
