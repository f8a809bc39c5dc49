//! Why a call brought no answer, as one program tells another.

use std::time::Duration;

use drivebus_rtu::{BeginError, ExceptionCode, FrameError, UnitAddress};
use serde::{Deserialize, Serialize};

use crate::error::Failure;
use crate::error::kind::ErrorKind;
use crate::line::{PortError, PortErrorKind};
use crate::share::nanos;

/// A [`Failure`] on its way. Times are nanoseconds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Said {
    Port {
        kind: PortKind,
        port: String,
        message: String,
    },
    Reopened,
    Closed,
    Interrupted,
    ReadOnly {
        function: u8,
    },
    QueueFull {
        room: u64,
    },
    BeingStopped {
        unit: u8,
        program: String,
        process: u32,
    },
    OutOfTurn,
    BroadcastRead,
    Quarantine {
        unit: u8,
    },
    NoAnswer {
        timeout: u64,
        attempts: u32,
    },
    Unreached,
    Doubtful,
    NotAsked {
        left: u64,
    },
    Disagreeing {
        asked: u32,
    },
    NotTaken {
        times: u32,
        shows: Vec<u16>,
    },
    Busy {
        timeout: u64,
    },
    TooShort {
        len: u64,
    },
    TooLong {
        len: u64,
    },
    Crc {
        computed: u16,
        received: u16,
    },
    Refused {
        function: u8,
        code: u8,
    },
    Halted {
        unit: u8,
    },
    /// What has no form of its own here comes in its words.
    BadAnswer {
        message: String,
    },
}

/// [`PortErrorKind`] on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum PortKind {
    NotFound,
    Busy,
    Denied,
    Lost,
    Closed,
    Unsupported,
    Other,
}

impl From<&Failure> for Said {
    fn from(failure: &Failure) -> Self {
        match failure {
            Failure::Port(PortError { kind, port, message }) => {
                Self::Port { kind: (*kind).into(), port: port.clone(), message: message.clone() }
            }
            Failure::Reopened => Self::Reopened,
            Failure::Closed | Failure::Forked => Self::Closed,
            Failure::Interrupted => Self::Interrupted,
            // Each program looks at its own requests before it hands them over.
            Failure::ReadOnly { function } | Failure::NotARead { function } => Self::ReadOnly { function: *function },
            Failure::QueueFull { room } => Self::QueueFull { room: whole(*room) },
            Failure::BeingStopped { unit, program, process } => {
                Self::BeingStopped { unit: *unit, program: program.clone(), process: *process }
            }
            Failure::Halted { unit } => Self::Halted { unit: *unit },
            Failure::NotBegun(BeginError::BroadcastRead) => Self::BroadcastRead,
            Failure::NotBegun(BeginError::Quarantine { unit }) => Self::Quarantine { unit: unit.get() },
            Failure::NotBegun(_) => Self::OutOfTurn,
            Failure::NoAnswer { timeout, attempts } => Self::NoAnswer { timeout: nanos(*timeout), attempts: *attempts },
            Failure::Unreached => Self::Unreached,
            Failure::Doubtful => Self::Doubtful,
            Failure::NotAsked { left } => Self::NotAsked { left: nanos(*left) },
            Failure::Disagreeing { asked } => Self::Disagreeing { asked: *asked },
            Failure::NotTaken { times, shows } => Self::NotTaken { times: *times, shows: shows.clone() },
            // They have no forms of their own here yet: sent once, and this is what the unit shows.
            Failure::Limited { shows, .. } => Self::NotTaken { times: 1, shows: vec![*shows] },
            Failure::Acknowledged { shows, .. } => Self::NotTaken { times: 1, shows: shows.clone() },
            Failure::Busy { timeout } => Self::Busy { timeout: nanos(*timeout) },
            Failure::Corrupt(FrameError::TooShort { len }) => Self::TooShort { len: whole(*len) },
            Failure::Corrupt(FrameError::TooLong { len }) => Self::TooLong { len: whole(*len) },
            Failure::Corrupt(FrameError::Crc { computed, received }) => {
                Self::Crc { computed: *computed, received: *received }
            }
            Failure::Refused { function, code } => Self::Refused { function: *function, code: code.0 },
            Failure::Wrong(_)
            | Failure::Corrupt(_)
            | Failure::Unheard { .. }
            | Failure::OthersAsk
            // Each program says its requests in its units' protocol before it hands them over.
            | Failure::NotSpoken { .. }
            | Failure::Elsewhere { .. } => Self::BadAnswer { message: failure.to_string() },
        }
    }
}

impl From<Said> for Failure {
    fn from(said: Said) -> Self {
        match said {
            Said::Port { kind, port, message } => Self::Port(PortError::new(kind.into(), port, message)),
            Said::Reopened => Self::Reopened,
            Said::Closed => Self::Closed,
            Said::Interrupted => Self::Interrupted,
            Said::ReadOnly { function } => Self::ReadOnly { function },
            Said::QueueFull { room } => Self::QueueFull { room: length(room) },
            Said::BeingStopped { unit, program, process } => Self::BeingStopped { unit, program, process },
            Said::Halted { unit } => Self::Halted { unit },
            Said::OutOfTurn => Self::NotBegun(BeginError::OutOfTurn),
            Said::BroadcastRead => Self::NotBegun(BeginError::BroadcastRead),
            Said::Quarantine { unit } => Self::NotBegun(BeginError::Quarantine { unit: UnitAddress::by_name(unit) }),
            Said::NoAnswer { timeout, attempts } => Self::NoAnswer { timeout: Duration::from_nanos(timeout), attempts },
            Said::Unreached => Self::Unreached,
            Said::Doubtful => Self::Doubtful,
            Said::NotAsked { left } => Self::NotAsked { left: Duration::from_nanos(left) },
            Said::Disagreeing { asked } => Self::Disagreeing { asked },
            Said::NotTaken { times, shows } => Self::NotTaken { times, shows },
            Said::Busy { timeout } => Self::Busy { timeout: Duration::from_nanos(timeout) },
            Said::TooShort { len } => Self::Corrupt(FrameError::TooShort { len: length(len) }),
            Said::TooLong { len } => Self::Corrupt(FrameError::TooLong { len: length(len) }),
            Said::Crc { computed, received } => Self::Corrupt(FrameError::Crc { computed, received }),
            Said::Refused { function, code } => Self::Refused { function, code: ExceptionCode(code) },
            Said::BadAnswer { message } => Self::Elsewhere { kind: ErrorKind::BadAnswer, message },
        }
    }
}

impl From<PortErrorKind> for PortKind {
    fn from(kind: PortErrorKind) -> Self {
        match kind {
            PortErrorKind::NotFound => Self::NotFound,
            PortErrorKind::Busy => Self::Busy,
            PortErrorKind::Denied => Self::Denied,
            PortErrorKind::Lost => Self::Lost,
            PortErrorKind::Closed => Self::Closed,
            PortErrorKind::Unsupported => Self::Unsupported,
            PortErrorKind::Other => Self::Other,
        }
    }
}

impl From<PortKind> for PortErrorKind {
    fn from(kind: PortKind) -> Self {
        match kind {
            PortKind::NotFound => Self::NotFound,
            PortKind::Busy => Self::Busy,
            PortKind::Denied => Self::Denied,
            PortKind::Lost => Self::Lost,
            PortKind::Closed => Self::Closed,
            PortKind::Unsupported => Self::Unsupported,
            PortKind::Other => Self::Other,
        }
    }
}

fn whole(length: usize) -> u64 {
    u64::try_from(length).unwrap_or(u64::MAX)
}

fn length(whole: u64) -> usize {
    usize::try_from(whole).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::{AnswerError, Request};

    use super::*;

    /// Every failure that there is, once.
    fn all() -> Vec<Failure> {
        let second = Duration::from_millis(1_500);
        let wrong = Request::read(0x2100, 2).unwrap().judge(&[0x06, 0, 0, 0, 0]).unwrap_err();
        assert!(matches!(wrong, AnswerError::Function { .. }));
        vec![
            Failure::Port(PortError::new(PortErrorKind::Lost, "/dev/ttyUSB0", "the port is gone")),
            Failure::Reopened,
            Failure::Closed,
            Failure::Interrupted,
            Failure::ReadOnly { function: 6 },
            Failure::QueueFull { room: 9 },
            Failure::BeingStopped { unit: 3, program: "python".to_owned(), process: 4711 },
            Failure::Halted { unit: 3 },
            Failure::NotBegun(BeginError::OutOfTurn),
            Failure::NotBegun(BeginError::BroadcastRead),
            Failure::NotBegun(BeginError::Quarantine { unit: UnitAddress::new(7).unwrap() }),
            Failure::NoAnswer { timeout: second, attempts: 3 },
            Failure::Unreached,
            Failure::Doubtful,
            Failure::NotAsked { left: second },
            Failure::Disagreeing { asked: 6 },
            Failure::NotTaken { times: 2, shows: vec![1, 0xFFFF] },
            Failure::Busy { timeout: second },
            Failure::Corrupt(FrameError::TooShort { len: 3 }),
            Failure::Corrupt(FrameError::TooLong { len: 300 }),
            Failure::Corrupt(FrameError::Crc { computed: 1, received: 2 }),
            Failure::Refused { function: 3, code: ExceptionCode(2) },
            Failure::Wrong(wrong),
            Failure::OthersAsk,
        ]
    }

    #[test]
    fn what_is_told_reads_and_counts_as_it_did() {
        for failure in all() {
            let bytes = postcard::to_stdvec(&Said::from(&failure)).unwrap();
            let told = Failure::from(postcard::from_bytes::<Said>(&bytes).unwrap());
            assert_eq!((told.to_string(), told.kind()), (failure.to_string(), failure.kind()));
            if !matches!(failure, Failure::Wrong(_) | Failure::OthersAsk) {
                assert_eq!(told, failure);
            }
        }
    }
}
