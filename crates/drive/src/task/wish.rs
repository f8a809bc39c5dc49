//! What an operation wants done.

use std::fmt;
use std::time::Duration;

use drivebus_drives::{Command, Place, Profile, Requests, State};
use drivebus_rtu::UnitAddress;

use super::Outcome;
use crate::look::Look;
use crate::set_otherwise::SetOtherwise;

const WRITE_ONE: u8 = 0x06;

/// What an operation wants done before it goes on.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Wish {
    /// Words of a unit.
    Read(Read),
    /// Words to a unit.
    Write(Write),
    /// Time, on the line's clock.
    Sleep(Duration),
    /// How well this unit could be reached lately.
    Link(UnitAddress),
    /// How often this unit was told to halt over this line.
    Halts(UnitAddress),
    /// That whoever drives hears this now, and goes on.
    Tell(Notice),
}

impl Wish {
    /// Whether `outcome` may come of it.
    pub(super) fn is_met_by<E>(&self, outcome: &Outcome<E>) -> bool {
        match (self, outcome) {
            // Who is told something has nothing to say to it.
            (Self::Tell(_), outcome) => matches!(outcome, Outcome::Heard),
            (_, Outcome::Failed(_))
            | (Self::Sleep(_), Outcome::Slept)
            | (Self::Write(_), Outcome::Written)
            | (Self::Link(_), Outcome::Link(_))
            | (Self::Halts(_), Outcome::Halts(_)) => true,
            (Self::Read(read), Outcome::Words(words)) => !read.is_stamped && read.takes(words),
            (Self::Read(read), Outcome::Stamped(stamped)) => read.is_stamped && read.takes(&stamped.words),
            _ => false,
        }
    }
}

impl fmt::Display for Wish {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(read) => read.fmt(f),
            Self::Write(write) => write.fmt(f),
            Self::Sleep(time) => write!(f, "{time:?} of the line's clock"),
            Self::Link(unit) => write!(f, "the link to unit {}", unit.get()),
            Self::Halts(unit) => write!(f, "the number of halts of unit {}", unit.get()),
            Self::Tell(Notice::Took(command)) => write!(f, "to tell that {} was taken", command.name()),
            Self::Tell(Notice::Saw(look)) => write!(f, "to tell that a look showed {look}"),
            Self::Tell(Notice::Shows(state)) => write!(f, "to tell that the state is {}", state.name()),
            Self::Tell(Notice::Starts(command)) => write!(f, "to tell that {} is about to be sent", command.name()),
            Self::Tell(Notice::TookOther { command, word, .. }) => {
                write!(f, "to tell that {word:04X}H was taken for {}", command.name())
            }
            Self::Tell(Notice::Stored { name, times }) => write!(f, "to tell that {name} was stored {times} times"),
        }
    }
}

/// A read of words, or of bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Read {
    /// Who is asked.
    pub unit: UnitAddress,
    /// Where the first of them is.
    pub place: Place,
    /// How many: 1..=125 words, or 1..=2000 bits.
    pub count: u16,
    /// Before all who wait for the line.
    pub is_urgent: bool,
    /// Whether it counts when that was.
    pub is_stamped: bool,
    /// How long this read alone waits for its answer; `None` is what the line has.
    pub timeout: Option<Duration>,
    /// How often this read alone is repeated; `None` is what the line has.
    pub retries: Option<u32>,
}

impl Read {
    /// A read of the word of `unit` at `place`, as the line reads.
    pub const fn word(unit: UnitAddress, place: Place) -> Self {
        Self::words(unit, place, 1)
    }

    /// A read of `count` words of `unit` from `place` on, as the line reads.
    pub const fn words(unit: UnitAddress, place: Place, count: u16) -> Self {
        Self { unit, place, count, is_urgent: false, is_stamped: false, timeout: None, retries: None }
    }

    /// The same before all who wait for the line, where that is so.
    #[must_use]
    pub const fn urgent(self, is_urgent: bool) -> Self {
        Self { is_urgent, ..self }
    }

    /// The same, asked once and given no longer than `timeout`.
    #[must_use]
    pub const fn once_within(self, timeout: Duration) -> Self {
        Self { timeout: Some(timeout), retries: Some(0), ..self }
    }

    /// Whether `words` are as many as it asks for.
    fn takes(&self, words: &[u16]) -> bool {
        words.len() == usize::from(self.count)
    }
}

impl fmt::Display for Read {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { unit, place, count, .. } = self;
        match count {
            1 => write!(f, "a read of {place} of unit {}", unit.get()),
            _ => write!(f, "a read of {count} from {place} of unit {}", unit.get()),
        }
    }
}

/// The words of a read, and when that was, in Unix time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamped {
    /// The words, as many as were asked for.
    pub words: Vec<u16>,
    /// When the request had left.
    pub asked: Duration,
    /// When the answer was complete.
    pub answered: Duration,
}

/// A write of words, or of one coil. It is sent once.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Write {
    /// Who gets it.
    pub unit: UnitAddress,
    /// Where the first word goes.
    pub place: Place,
    /// What goes there.
    pub payload: Payload,
    /// Before all who wait for the line, whatever is in doubt.
    pub is_urgent: bool,
    /// Where the same can be read: there a confirmation that is missing is looked for.
    pub read_back: Option<u16>,
    /// How often the port had been opened again when it was seen who answers: at another number nothing is sent.
    pub connection: Option<u64>,
    /// How often the unit had been told to halt when this was decided on: at another number nothing is sent.
    pub halts: Option<u64>,
    /// Whether it goes out also where the line knows the unit as one of a family that does not define it.
    pub is_forced: bool,
    /// How long this write alone waits for its confirmation; `None` is what the line has.
    pub timeout: Option<Duration>,
}

/// What a write carries.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Payload {
    /// One word by 06H, or a coil by 05H.
    Word(u16),
    /// 1..=123 words by 10H.
    Words(Vec<u16>),
}

impl Payload {
    /// The same as a request to a drive of `profile` carries it: one that knows no 06H gets a single word by 10H.
    #[must_use]
    pub fn as_written(self, profile: &Profile) -> Self {
        let knows = |function| profile.functions().contains(&function);
        match self {
            Self::Word(word) if !knows(WRITE_ONE) && knows(Requests::WRITE_MANY) => Self::Words(vec![word]),
            payload => payload,
        }
    }
}

impl Write {
    /// A write to `unit` at `place`, as the line writes.
    pub const fn new(unit: UnitAddress, place: Place, payload: Payload) -> Self {
        Self {
            unit,
            place,
            payload,
            is_urgent: false,
            read_back: None,
            connection: None,
            halts: None,
            is_forced: false,
            timeout: None,
        }
    }
}

impl fmt::Display for Write {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { unit, place, payload, .. } = self;
        match payload {
            Payload::Word(word) => write!(f, "a write of {word:04X}H to {place} of unit {}", unit.get()),
            Payload::Words(words) => write!(f, "a write of {} words from {place} of unit {}", words.len(), unit.get()),
        }
    }
}

/// What has come about, for whoever keeps or shows it: nothing is asked by it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// The unit took this command, as it says.
    Took(Command),
    /// The drive is set to take other words: it took this one of them, which does what the command is for.
    TookOther {
        /// The command.
        command: Command,
        /// What was sent.
        word: u16,
        /// How it is set.
        otherwise: Box<SetOtherwise>,
    },
    /// A look showed this.
    Saw(Look),
    /// The state word alone showed this.
    Shows(State),
    /// This start is about to be sent: what ends it must be able to, from now on.
    Starts(Command),
    /// The parameter of this code was written to EEPROM once more, whose write life is limited: so often that it looks like a loop.
    Stored {
        /// Its code.
        name: String,
        /// How often it was, over this record.
        times: u64,
    },
}

/// How well a unit could be reached: its last exchanges, ten at most. A refusal is an answer, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Link {
    /// How many of them brought an answer.
    pub good: u32,
    /// How many there were.
    pub asked: u32,
}

impl Link {
    /// How many of them brought no answer, or a damaged one.
    pub const fn failed(self) -> u32 {
        self.asked.saturating_sub(self.good)
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of the last {} exchanges brought an answer", self.good, self.asked)
    }
}
