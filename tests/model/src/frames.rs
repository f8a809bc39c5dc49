//! What is asked and what comes back. An answer knows what the wire does not say: which request it was given to.
//!
//! All units have equal registers, all reads begin at the same one, and all commands are the same word. So answers differ
//! by their shape alone, which is the worst case: whatever can be mistaken is mistaken.

use drivebus_rtu::{Adu, Answer, ExceptionCode, Instant, Request, Table, UnitAddress, function};

/// Where reads begin.
const STATE: u16 = 0x2100;
/// Where commands go.
const COMMAND: u16 = 0x2000;
const RUN: u16 = 1;
const STOP: u16 = 5;

/// What the registers hold, before and after they have changed.
const VALUES: [u16; 2] = [0x0003, 0x0008];

/// The most words that are read here.
const LONGEST: usize = 16;

/// What a request is: of the program, or of what comes before and behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// So many words are read.
    Read(u16),
    /// One word is read to see whether a motor stands, with the urgency of a stop.
    Watch,
    /// One input register is read. No program asks that here.
    Input,
    /// A command that moves something: sent once.
    Run,
    /// A stop: sent at once, in doubt or not.
    Stop,
    /// A value is written that can be read back: what the registers hold after they have changed.
    Set,
    /// A word is sent to come back.
    Echo(u16),
}

impl Kind {
    /// As it is asked.
    pub fn request(self) -> Request<'static> {
        self.request_at(STATE)
    }

    /// From where it reads what a program asks for, where it is a read.
    pub fn first_place(self) -> u16 {
        match self.request() {
            Request::Read { address, .. } => address,
            _ => 0,
        }
    }

    /// The same, where it is a read, from `place` on.
    pub fn request_at(self, place: u16) -> Request<'static> {
        match self {
            // A few words from a register in the middle: no range is left.
            Self::Read(count) => Request::read(place, count).unwrap_or(Request::echo(count)),
            Self::Watch => Self::Read(1).request_at(place),
            Self::Input => Request::read_of(Table::Input, place, 1).unwrap_or(Request::echo(1)),
            Self::Run => Request::write(COMMAND, RUN),
            Self::Stop => Request::write(COMMAND, STOP),
            Self::Set => Request::write(STATE, VALUES[1]),
            Self::Echo(word) => Request::echo(word),
        }
    }

    /// What `frame` asks, and from where it reads.
    pub fn sent(frame: &[u8]) -> Option<(Self, u16)> {
        let [_, pdu @ .., _, _] = frame else { return None };
        Some(match Request::parse(pdu).ok()? {
            Request::Read { table: Table::Holding, address, count, .. } => (Self::Read(count), address),
            Request::Read { table: Table::Input, address, count: 1, .. } => (Self::Input, address),
            Request::WriteSingle { address: COMMAND, value: RUN, .. } => (Self::Run, 0),
            Request::WriteSingle { address: COMMAND, value: STOP, .. } => (Self::Stop, 0),
            Request::WriteSingle { address: STATE, .. } => (Self::Set, 0),
            Request::Echo { data, .. } => (Self::Echo(data), 0),
            _ => return None,
        })
    }

    /// Where the words of a write can be read back.
    pub fn read_back(self) -> Option<u16> {
        (self == Self::Set).then_some(STATE)
    }

    /// Whether words are read.
    pub const fn is_read(self) -> bool {
        matches!(self, Self::Read(_) | Self::Watch | Self::Input)
    }

    /// Whether the unit does something.
    pub const fn is_write(self) -> bool {
        matches!(self, Self::Run | Self::Stop | Self::Set)
    }
}

/// What an answer says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Content {
    /// So many words, from before or after the registers changed.
    Words(u16, bool),
    /// The word of an input register, from before or after it changed.
    Input(bool),
    /// The unit has done it.
    Done(Kind),
    /// The word came back.
    Echoed(u16),
    /// The unit refused.
    Refused(Kind),
}

impl Content {
    /// As it travels.
    pub fn adu(self, unit: UnitAddress) -> Adu {
        match self {
            Self::Words(count, changed) => {
                let words = [VALUES[usize::from(changed)]; LONGEST];
                let answer = Answer::read(&words[..usize::from(count).clamp(1, LONGEST)]);
                answer.map_or_else(|_| Adu::new(), |answer| Adu::answer(unit, &answer))
            }
            Self::Input(changed) => {
                let words = [VALUES[usize::from(changed)]];
                let answer = Answer::read_of(Table::Input, &words);
                answer.map_or_else(|_| Adu::new(), |answer| Adu::answer(unit, &answer))
            }
            Self::Done(kind) => {
                let answer = Answer::confirming(&kind.request());
                answer.map_or_else(Adu::new, |answer| Adu::answer(unit, &answer))
            }
            Self::Echoed(word) => Self::Done(Kind::Echo(word)).adu(unit),
            Self::Refused(kind) => {
                let code = match kind.request().function() {
                    function::DIAGNOSTICS => ExceptionCode::ILLEGAL_FUNCTION,
                    _ => ExceptionCode::DEVICE_FAILURE,
                };
                Adu::answer(unit, &Answer::exception(kind.request().function(), code))
            }
        }
    }
}

/// Who asked what is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asker {
    /// Another program, before the line was opened.
    Stranger,
    /// This one, with the request of this number.
    Request(u16),
}

/// An answer that a unit has given or will give, and that has not arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coming {
    /// Whose it is.
    pub asker: Asker,
    /// What it says.
    pub content: Content,
    /// Where was read, if something was.
    pub place: u16,
    /// Whether it has another number of words than was asked for.
    pub is_other_length: bool,
    /// When its request ended without it.
    pub given_up: Option<Instant>,
    /// When it arrived damaged, if it has.
    pub damaged: Option<Instant>,
}

impl Coming {
    /// Whether it was given to request `first` or a later one.
    pub const fn is_since(&self, first: u16) -> bool {
        matches!(self.asker, Asker::Request(number) if number >= first)
    }
}
