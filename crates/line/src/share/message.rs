//! What is said between a program that has a port and one that uses it through it.
//!
//! Each message is encoded by `postcard`. What a program of another version is told, it can read: the greeting, and the
//! first byte of the answer to it, stay as they are.

use std::time::Duration;

use drivebus_rtu::huanyang::Huanyang;
use drivebus_rtu::{
    Adu, AnswerLength, DataBits, Destination, ExceptionCode, Instant, Meaning, Meanings, Parity, Request, SerialFormat,
    StopBits, UnitAddress,
};
use serde::{Deserialize, Serialize};

use crate::ask::Ask;
use crate::error::CallError;
use crate::health::stats::{Counters, Program, Stats};
use crate::options::CallOptions;
use crate::share::failure::Said;
use crate::share::nanos;
use crate::turns::order::Priority;

/// How every greeting begins, of every version.
pub(crate) const GREETING: &[u8] = b"drivebus share ";
/// What is spoken here.
pub(crate) const VERSION: u8 = 9;
/// The first byte of an answer to a greeting that lets in; a [`Welcome`] follows.
pub(crate) const LET_IN: u8 = 0;
/// The first byte of one that does not; the reason follows, in words.
pub(crate) const SENT_AWAY: u8 = 1;

/// What a program says first, behind [`GREETING`] and [`VERSION`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Hello {
    pub(crate) program: String,
    pub(crate) characters: Characters,
    /// Whether the connection is for a stop and nothing else: there is always room for one.
    pub(crate) is_for_a_stop: bool,
}

/// What it is told then.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Welcome {
    pub(crate) program: String,
    pub(crate) process: u32,
    pub(crate) reconnects: u64,
}

/// How the characters of a line look: both programs must mean the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Characters {
    baud_rate: u32,
    data_bits: u8,
    parity: u8,
    stop_bits: u8,
}

impl Characters {
    pub(crate) fn of(format: &SerialFormat) -> Self {
        Self {
            baud_rate: format.baud_rate(),
            data_bits: if format.data_bits() == DataBits::Seven { 7 } else { 8 },
            parity: match format.parity() {
                Parity::None => b'N',
                Parity::Even => b'E',
                Parity::Odd => b'O',
            },
            stop_bits: if format.stop_bits() == StopBits::One { 1 } else { 2 },
        }
    }
}

impl std::fmt::Display for Characters {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}{}{}", self.baud_rate, self.data_bits, char::from(self.parity), self.stop_bits)
    }
}

/// What a program asks of the one that has the port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Wish {
    Call(Order),
    /// Hearing the line for so many nanoseconds.
    Listen(u64),
    /// Hearing all that goes over the line for so many nanoseconds.
    Overhear(u64),
    Stats,
    Link(u8),
    FreshWord,
    /// To be told how often the port was opened again: now, and each time that it is, until the connection ends. Nothing else
    /// is wished over that one any more.
    Reconnects,
    /// A last will was left: it is to be watched from now on.
    Wills,
    /// The call or the listening under way is not wanted any more.
    Cancel,
    /// How often a unit was told to halt.
    Halts(u8),
}

/// What it is told.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Told {
    Answer {
        pdu: Vec<u8>,
        sent: u64,
        ended: u64,
        reconnects: u64,
    },
    Failed {
        failure: Said,
        raw: Vec<u8>,
        sent: Option<u64>,
        ended: Option<u64>,
        reconnects: u64,
        set_again: Option<String>,
    },
    Heard {
        at: u64,
        bytes: Vec<u8>,
    },
    Overheard {
        at: u64,
        sent: bool,
        bytes: Vec<u8>,
    },
    /// Nothing more is heard; why, if it ended early.
    Over(Option<Said>),
    Stats(Box<Figures>),
    Link {
        good: u32,
        asked: u32,
    },
    Word(u16),
    Reconnects(u64),
    Wills,
    /// What was wished is still to come: it waits for its turn, or is on the line.
    Waiting,
    /// So many pieces of what went over the line were left out, because the program did not take what it was told.
    LeftOut(u64),
    Halts(u64),
}

/// The statistics of a line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Figures {
    total: Counters,
    units: Vec<(u8, Counters)>,
    programs: Vec<Program>,
    settings_changed: u64,
}

impl From<Stats> for Figures {
    fn from(stats: Stats) -> Self {
        let units = stats.units.into_iter().map(|(unit, counters)| (unit.get(), counters)).collect();
        Self { total: stats.total, units, programs: stats.programs, settings_changed: stats.settings_changed }
    }
}

impl Figures {
    /// As this program counts how often its port was opened again.
    pub(crate) fn into_stats(self, reconnects: u64) -> Stats {
        let unit = |(unit, counters)| (UnitAddress::by_name(unit), counters);
        let units = self.units.into_iter().map(unit).collect();
        let Self { total, programs, settings_changed, .. } = self;
        Stats { total, units, reconnects, settings_changed, programs }
    }
}

/// How long the answer to a request is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Length {
    /// As its function says.
    AsItsFunction,
    /// The request is carried as it is; its answer has so many bytes, or ends when the line falls silent.
    Bytes(u8),
    BySilence,
    /// It is none of Modbus.
    AsHuanyangs,
}

/// One call as it is handed over: with the times and the rules of the program that wants it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Order {
    unit: u8,
    pdu: Vec<u8>,
    answer: Length,
    timeout: u64,
    gap: u64,
    learns: bool,
    in_doubt: bool,
    priority: u8,
    retries: u32,
    verify: bool,
    read_back: Option<u16>,
    connection: Option<u64>,
    halts: Option<u64>,
    /// The exceptions by which its unit means something else than the specification has, and the places of that in
    /// [`Meaning::ALL`]; `None` where its program does not know the unit.
    meanings: Option<Vec<(u8, u8)>>,
}

const PRIORITIES: [Priority; 4] = [Priority::Stop, Priority::Write, Priority::Read, Priority::Poll];

impl Order {
    /// `ask` with what its program wants of it; `connection` as the one that has the port counts.
    pub(crate) fn new(ask: &Ask<'_>, priority: Priority, retries: u32, options: &CallOptions) -> Self {
        let frame = Adu::request(ask.destination, ask.request);
        let bytes = frame.as_bytes();
        Self {
            unit: bytes[0],
            pdu: bytes[1..bytes.len() - 2].to_vec(),
            answer: match *ask.request {
                Request::Custom { answer: AnswerLength::Bytes(count), .. } => Length::Bytes(count),
                Request::Custom { .. } => Length::BySilence,
                Request::Huanyang(_) => Length::AsHuanyangs,
                _ => Length::AsItsFunction,
            },
            timeout: nanos(ask.timeout),
            gap: nanos(ask.gap),
            learns: ask.learns,
            in_doubt: ask.in_doubt,
            priority: priority as u8,
            retries,
            verify: options.verify,
            read_back: options.read_back,
            connection: options.connection,
            halts: options.halts,
            meanings: None,
        }
    }

    /// With what the exceptions of its unit mean.
    pub(crate) fn meaning(self, meanings: Option<Meanings>) -> Self {
        Self { meanings: meanings.map(|meanings| others(&meanings)), ..self }
    }

    /// With the connection as `translate` says it.
    pub(crate) fn over(mut self, translate: impl FnOnce(u64) -> u64) -> Self {
        self.connection = self.connection.map(translate);
        self
    }

    /// Who is asked; its program has asked for a reserved one by name.
    pub(crate) fn destination(&self) -> Destination {
        match self.unit {
            0 => Destination::Broadcast,
            unit => Destination::Unit(UnitAddress::by_name(unit)),
        }
    }

    /// What is asked; `None` where it is no request.
    pub(crate) fn request(&self) -> Option<Request<'_>> {
        match self.answer {
            Length::Bytes(count) => Request::custom(&self.pdu, AnswerLength::Bytes(count)),
            Length::BySilence => Request::custom(&self.pdu, AnswerLength::BySilence),
            Length::AsItsFunction => Request::parse(&self.pdu),
            Length::AsHuanyangs => return Huanyang::parse(&self.pdu).map(Request::Huanyang),
        }
        .ok()
    }

    pub(crate) fn is_stop(&self) -> bool {
        self.priority == Priority::Stop as u8
    }

    /// `None` where there is no such priority.
    pub(crate) fn options(&self) -> Option<CallOptions> {
        let priority = *PRIORITIES.get(usize::from(self.priority))?;
        Some(
            CallOptions::new()
                .timeout(Duration::from_nanos(self.timeout))
                .retries(self.retries)
                .priority(priority)
                .in_doubt(self.in_doubt)
                .verify(self.verify)
                .read_back(self.read_back)
                .connection(self.connection)
                .halts(self.halts),
        )
    }

    /// What the exceptions of its unit mean to its program, if that knows the unit.
    pub(crate) fn meanings(&self) -> Option<Meanings> {
        let said = self.meanings.as_ref()?;
        Some(said.iter().fold(Meanings::STANDARD, |meanings, &(code, place)| {
            let meaning = Meaning::ALL.get(usize::from(place));
            meaning.map_or(meanings, |&meaning| meanings.with(ExceptionCode(code), meaning))
        }))
    }

    /// As the owner of the line is asked. `None` where the request is none.
    pub(crate) fn times<'a>(&self, ask: Ask<'a>) -> Ask<'a> {
        Ask {
            timeout: Duration::from_nanos(self.timeout),
            gap: Duration::from_nanos(self.gap),
            learns: self.learns,
            ..ask
        }
    }
}

/// The codes by which `meanings` differ from the specification, and the place of each in [`Meaning::ALL`].
fn others(meanings: &Meanings) -> Vec<(u8, u8)> {
    let codes = (0..=u8::MAX).filter(|&code| meanings.of(ExceptionCode(code)) != ExceptionCode(code).meaning());
    codes
        .filter_map(|code| {
            let place = Meaning::ALL.iter().position(|&meaning| meaning == meanings.of(ExceptionCode(code)))?;
            Some((code, u8::try_from(place).ok()?))
        })
        .collect()
}

impl Told {
    /// With its moments by a clock that is so many nanoseconds ahead of the one by which they were said.
    pub(crate) fn by_clock_ahead(mut self, ahead: i64) -> Self {
        let moments = match &mut self {
            Self::Answer { sent, ended, .. } => [Some(sent), Some(ended)],
            Self::Failed { sent, ended, .. } => [sent.as_mut(), ended.as_mut()],
            Self::Heard { at, .. } | Self::Overheard { at, .. } => [Some(at), None],
            _ => return self,
        };
        moments.into_iter().flatten().for_each(|moment| *moment = moment.saturating_add_signed(ahead));
        self
    }

    /// What became of a call, for the program that wanted it.
    pub(crate) fn failed(error: &CallError, reconnects: u64) -> Self {
        Self::Failed {
            failure: Said::from(&error.failure),
            raw: error.raw.clone(),
            sent: error.sent.map(Instant::as_nanos),
            ended: error.ended.map(Instant::as_nanos),
            reconnects,
            set_again: error.set_again.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the specification of postcard's wire format: the place of the variant in its list, then what is in it; numbers in
    /// groups of seven bits, the lowest first.
    #[test]
    fn what_is_said_of_reconnects_has_these_bytes() {
        assert_eq!(postcard::to_stdvec(&Wish::Reconnects).unwrap(), [6]);
        assert_eq!(postcard::to_stdvec(&Told::Reconnects(0)).unwrap(), [8, 0]);
        assert_eq!(postcard::to_stdvec(&Told::Reconnects(300)).unwrap(), [8, 0xAC, 0x02]);
        assert_eq!(postcard::from_bytes::<Told>(&[8, 0xAC, 0x02]).unwrap(), Told::Reconnects(300));
    }
}
