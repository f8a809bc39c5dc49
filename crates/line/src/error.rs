//! What can become of a call, and whether the unit may have acted.

mod came;
pub(crate) mod kind;

use std::fmt;
use std::time::Duration;

use drivebus_rtu::huanyang::{Huanyang, Protocol};
use drivebus_rtu::{
    AnswerError, BeginError, Destination, ExceptionCode, Frame, FrameError, Instant, Meaning, Request, Table,
    Unanswered,
};

use crate::error::kind::ErrorKind;
use crate::line::PortError;

/// A call that brought no answer, with all that is known of it.
///
/// Displays as one sentence: who was asked what, what came instead, and whether the unit may have acted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct CallError {
    /// Why.
    pub failure: Failure,
    /// Who was asked.
    pub destination: Destination,
    /// The whole request frame.
    pub request: Vec<u8>,
    /// In which protocol it is.
    pub protocol: Protocol,
    /// The bytes that came instead of an answer.
    pub raw: Vec<u8>,
    /// When the request went out, on the line's clock; `None`: it never did, so nothing was done.
    pub sent: Option<Instant>,
    /// When the call ended, on the line's clock; `None` where only a line knows that is gone, or another process's.
    pub ended: Option<Instant>,
    /// What another program had changed at the port, in words, where that was found behind one of its requests: it is set
    /// again by now.
    pub set_again: Option<String>,
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.destination {
            Destination::Unit(unit) => write!(f, "unit {unit}")?,
            Destination::Broadcast => f.write_str("broadcast")?,
        }
        let pdu = Frame::parse(&self.request).ok().map_or(&[][..], |frame| frame.pdu());
        let request = match self.protocol {
            Protocol::Modbus => Request::parse(pdu).ok(),
            Protocol::Huanyang => Huanyang::parse(pdu).map(Request::Huanyang),
        };
        if let Some(request) = request {
            write!(f, ", {}", Asked { request, pdu })?;
        }
        match self.failure {
            Failure::NoAnswer { timeout, attempts } if !self.raw.is_empty() => {
                write!(f, ": no right answer within {} ms{}", timeout.as_millis(), times(attempts))?;
            }
            _ => write!(f, ": {}", self.failure)?,
        }
        if !self.raw.is_empty() {
            write!(f, "; came: {}", Hex(&self.raw))?;
            if let Some(words) = self.came_in_words() {
                write!(f, ", {words}")?;
            }
        }
        match (request, self.sent, &self.failure) {
            (_, _, Failure::Refused { code, .. }) if code.meaning() == Meaning::Taken => {
                f.write_str(", by which a unit says that it took the request and is at it")
            }
            (
                Some(Request::WriteSingle { .. }),
                Some(_),
                Failure::Wrong(AnswerError::Echo { asked: [asked, _], came: [came, took] }),
            ) if asked == came => {
                write!(f, "; it was sent once, and the unit says that it took {took} ({took:04X}H) instead")
            }
            (Some(request), Some(_), failure) if request.is_write() && !tells_all(failure) => {
                f.write_str("; it was sent once, and the unit may have taken it")
            }
            (Some(request), None, Failure::NoAnswer { .. } | Failure::Wrong(_) | Failure::Corrupt(_))
                if request.is_write() =>
            {
                f.write_str(" to an echo, with which it must show that it owes no other answer; the write was not sent")
            }
            _ => Ok(()),
        }?;
        self.set_again.as_ref().map_or(Ok(()), |told| write!(f, "; {told}"))
    }
}

impl CallError {
    /// What came, where the failure does not say it.
    fn came_in_words(&self) -> Option<String> {
        let request = Frame::parse(&self.request).ok()?;
        let is_told = match self.failure {
            Failure::NoAnswer { .. } => false,
            Failure::Wrong(_) | Failure::Corrupt(_) => self.raw != self.request,
            _ => true,
        };
        (!is_told).then(|| came::in_words(&request, &self.raw))
    }
}

/// Whether `failure` leaves no question what became of a write that was sent, or says itself what is known of it.
fn tells_all(failure: &Failure) -> bool {
    use Failure::{Acknowledged, Limited, NotTaken, Refused, Unheard};
    matches!(failure, Refused { .. } | NotTaken { .. } | Limited { .. } | Acknowledged { .. } | Unheard { .. })
}

/// A request in words, or in bytes where there are no words for it.
struct Asked<'a> {
    request: Request<'a>,
    pdu: &'a [u8],
}

impl fmt::Display for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.request {
            Request::Read { table: Table::Holding, address, count: 1, .. } => write!(f, "read {address:04X}H"),
            Request::Read { table, address, count: 1, .. } => write!(f, "read {} {address:04X}H", table.one()),
            Request::Read { table, address, count, .. } => {
                write!(f, "read {count} {} from {address:04X}H", table.many())
            }
            Request::WriteCoil { address, on, .. } => {
                write!(f, "write {} to coil {address:04X}H", if on { "on" } else { "off" })
            }
            Request::WriteSingle { address, value, .. } => write!(f, "write {value} ({value:04X}H) to {address:04X}H"),
            Request::WriteMultiple { address, words, .. } => {
                write!(f, "write {} words from {address:04X}H", words.len())
            }
            Request::Echo { data, .. } => write!(f, "echo {data:04X}H"),
            Request::WriteCoils { address, words, .. } => {
                write!(f, "write {} coils from {address:04X}H", words.len())
            }
            Request::MaskWrite { address, and, or, .. } => {
                write!(f, "change bits of {address:04X}H (and {and:04X}H, or {or:04X}H)")
            }
            Request::ReadWrite { address, count, write_address, words, .. } => {
                write!(f, "write {} words from {write_address:04X}H and read {count} from {address:04X}H", words.len())
            }
            Request::ReportServerId => f.write_str("report what it is (11H)"),
            Request::ReadIdentification { object, .. } => {
                write!(f, "read its identification (2BH/0EH) from object {object:02X}H")
            }
            Request::Huanyang(asked) => write!(f, "{asked}"),
            _ => write!(f, "PDU {}", Hex(self.pdu)),
        }
    }
}

/// Bytes as they are on the wire.
pub(crate) struct Hex<'a>(pub(crate) &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            let space = if index == 0 { "" } else { " " };
            write!(f, "{space}{byte:02X}")?;
        }
        Ok(())
    }
}

/// Why a call brought no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The port cannot be used.
    #[error("{0}")]
    Port(PortError),
    /// The port was opened again since the caller saw who answers. Nothing was sent.
    #[error("the port was opened again meanwhile, and another unit may answer; nothing was sent")]
    Reopened,
    /// This is a child process, and the line is its parent's. Nothing was sent.
    #[error("the bus belongs to the process that opened it; a forked child cannot use it")]
    Forked,
    /// The bus was closed.
    #[error("the bus is closed")]
    Closed,
    /// The caller gave up waiting.
    #[error("given up by the caller")]
    Interrupted,
    /// The bus was opened for reading only. Nothing was sent.
    #[error("this bus is read-only: function {function:02X}H may change something in the unit, so nothing was sent")]
    ReadOnly {
        /// The function asked for.
        function: u8,
    },
    /// The bus was opened for reading only, and the request has not the form that a read of its function has. Nothing was sent.
    #[error(
        "this bus is read-only: the request has not the form of a read of function {function:02X}H, and what has another \
         may be a write or a command to the unit, as 02H and 03H are in Huanyang's own protocol, so nothing was sent"
    )]
    NotARead {
        /// The function asked for.
        function: u8,
    },
    /// The unit is known to speak another protocol, which has nothing for this request. Nothing was sent.
    #[error(
        "unit {unit} is named as a drive that speaks Huanyang's own protocol, which has nothing for this request, and nothing \
         of Modbus is sent to it"
    )]
    NotSpoken {
        /// The unit.
        unit: u8,
    },
    /// As many wait for the line as may. Nothing was sent.
    #[error("{room} requests wait for this line already, and no more may; nothing was sent")]
    QueueFull {
        /// How many may wait.
        room: usize,
    },
    /// A program that ran the unit is gone, and the unit is being stopped for it. Nothing was sent: each request to the unit
    /// would keep it from acting by itself.
    #[error(
        "unit {unit} is being stopped for {program} (process {process}), which is gone without a word; nothing was sent"
    )]
    BeingStopped {
        /// The unit that is being stopped; a broadcast would reach it too.
        unit: u8,
        /// The program that is gone.
        program: String,
        /// The number that it had.
        process: u32,
    },
    /// The unit was told to halt since the request was decided on, or the port went to another program, which knows nothing of
    /// that. Nothing was sent.
    #[error("unit {unit} was told to stop meanwhile, or the port changed hands; nothing was sent")]
    Halted {
        /// The unit.
        unit: u8,
    },
    /// The request cannot be sent like this. Nothing was sent.
    #[error("{0}")]
    NotBegun(BeginError),
    /// The unit stayed silent.
    #[error("no answer within {} ms{}", timeout.as_millis(), times(*attempts))]
    NoAnswer {
        /// How long each wait was.
        timeout: Duration,
        /// How often it was tried.
        attempts: u32,
    },
    /// The unit stayed silent, as the gateway before it says: it may have heard the request all the same.
    #[error("no answer, says the gateway before it (exception 0BH)")]
    Unreached,
    /// The unit may still answer an earlier request, and gave no sign that it does not. Nothing was sent.
    #[error(
        "the unit may still answer an earlier request, and neither an echo nor a read of another length settled it"
    )]
    Doubtful,
    /// The unit was silent the last times, and others use the line. Nothing was sent.
    #[error("not asked: the unit was silent before, and other units use the line; it is asked again in {} ms", left.as_millis())]
    NotAsked {
        /// How long until then.
        left: Duration,
    },
    /// The same read brought one answer now and another then.
    #[error("{asked} answers to the same read do not agree; either the words change, or some were late answers")]
    Disagreeing {
        /// How often it was asked.
        asked: u32,
    },
    /// The unit shows other words than those written.
    #[error("written {times} times without a confirmation, and the unit shows {}", Shown(shows))]
    NotTaken {
        /// How often it was sent.
        times: u32,
        /// What was read back.
        shows: Vec<u16>,
    },
    /// The unit confirmed the write with another value than was sent.
    #[error("the unit says that it took {took} ({took:04X}H) instead{}", and_shows(*took, *shows))]
    Limited {
        /// What it says.
        took: u16,
        /// What was read back.
        shows: u16,
    },
    /// The unit said that it took the write and is at it, and has not shown the words since.
    #[error("the unit acknowledged it (exception {:02X}H), and shows {} still", code.0, Shown(shows))]
    Acknowledged {
        /// By which exception.
        code: ExceptionCode,
        /// What was read back last.
        shows: Vec<u16>,
    },
    /// The unit could not take the request, however often it was asked: it is busy, or the request came damaged.
    #[error("the unit is busy, or the request reached it damaged (exception {:02X}H){}", code.0, times(*attempts))]
    Unheard {
        /// By which exception it says so.
        code: ExceptionCode,
        /// How often it was asked.
        attempts: u32,
    },
    /// Another master asks the same of the unit, so that its answers cannot be told from the own ones.
    #[error(
        "another master asks the same of this unit through this serial server, which copies the answers to all, and nothing \
         tells whose they are; let one master use each server, or share its port through drivebus"
    )]
    OthersAsk,
    /// The line was never silent long enough to send. Nothing was sent.
    #[error("the line was never silent for {} ms: another master, or noise from a missing bias", timeout.as_millis())]
    Busy {
        /// How long it was waited for silence.
        timeout: Duration,
    },
    /// A whole frame came that is not the answer.
    #[error("{0}")]
    Wrong(AnswerError),
    /// An answer came and did not survive the line.
    #[error("{0}")]
    Corrupt(FrameError),
    /// Another program has the port, and this is what it says of the failure.
    #[error("{message}")]
    Elsewhere {
        /// Whose fault it is.
        kind: ErrorKind,
        /// Why, in its words.
        message: String,
    },
    /// The unit refused.
    #[error("refused function {function:02X}H with exception {:02X}H", code.0)]
    Refused {
        /// The function asked for.
        function: u8,
        /// Why, in the unit's own numbering.
        code: ExceptionCode,
    },
}

impl Failure {
    /// As the line's policy has it: what the unit `shows` was read back, and it was `cut` short, if it was.
    pub(crate) fn of(why: Unanswered, shows: Vec<u16>, cut: Option<Self>) -> Self {
        match why {
            Unanswered::NotBegun(error) => Self::NotBegun(error),
            Unanswered::Reopened => Self::Reopened,
            Unanswered::NotAsked { left } => Self::NotAsked { left },
            Unanswered::Doubtful => Self::Doubtful,
            Unanswered::Busy { timeout } => Self::Busy { timeout },
            Unanswered::NoAnswer { timeout, attempts } => Self::NoAnswer { timeout, attempts },
            Unanswered::Unreached => Self::Unreached,
            Unanswered::Wrong(error) => Self::Wrong(error),
            Unanswered::Corrupt(error) => Self::Corrupt(error),
            Unanswered::Refused { function, code } => Self::Refused { function, code },
            Unanswered::Disagreeing { asked } => Self::Disagreeing { asked },
            Unanswered::OthersAsk => Self::OthersAsk,
            Unanswered::NotTaken { times } => Self::NotTaken { times, shows },
            Unanswered::Limited { took } => Self::Limited { took, shows: shows.first().copied().unwrap_or(took) },
            Unanswered::Acknowledged { code } => Self::Acknowledged { code, shows },
            Unanswered::CutShort(_) => cut.unwrap_or(Self::Interrupted),
            // Neither is said of a call that this crate makes: there is room for every unit, and it asks in turn.
            _ => Self::NotBegun(BeginError::OutOfTurn),
        }
    }
}

/// Words as people read them.
struct Shown<'a>(&'a [u16]);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, word) in self.0.iter().enumerate() {
            let space = if index == 0 { "" } else { " " };
            write!(f, "{space}{word:04X}H")?;
        }
        Ok(())
    }
}

fn and_shows(took: u16, shows: u16) -> String {
    if took == shows { String::new() } else { format!(", and it shows {shows} ({shows:04X}H)") }
}

fn times(attempts: u32) -> String {
    if attempts > 1 { format!(", asked {attempts} times") } else { String::new() }
}
