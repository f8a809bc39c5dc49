//! What is asked and what comes back. An answer knows what the wire does not say: which request it was given to.
//!
//! All units have equal registers, all reads begin at the same one, and all commands are the same word. So answers differ
//! by their shape alone, which is the worst case: whatever can be mistaken is mistaken.

use drivebus_rtu::{Adu, Answer, ExceptionCode, Instant, Request, UnitAddress, function};

/// Where reads begin.
const STATE: u16 = 0x2100;
/// Where commands go.
const COMMAND: u16 = 0x2000;
const RUN: u16 = 1;
const STOP: u16 = 5;

/// What the registers hold, before and after they have changed.
const VALUES: [u16; 2] = [0x0003, 0x0008];

/// What a request is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// So many words are read, 1 or 2.
    Read(u16),
    /// A command that moves something: sent once.
    Run,
    /// A stop: sent at once, in doubt or not.
    Stop,
    /// A word is sent to come back.
    Echo(u16),
    /// One word is read to see whether the adapter sends requests back; what is answered does not matter.
    Look,
}

impl Kind {
    /// As it is asked.
    pub fn request(self) -> Request<'static> {
        match self {
            // Two words from a register in the middle: no range is left.
            Self::Read(count) => Request::read(STATE, count).unwrap_or(Request::echo(count)),
            Self::Look => Self::Read(1).request(),
            Self::Run => Request::write(COMMAND, RUN),
            Self::Stop => Request::write(COMMAND, STOP),
            Self::Echo(word) => Request::echo(word),
        }
    }

    /// Whether words are read for their own sake.
    pub const fn is_read(self) -> bool {
        matches!(self, Self::Read(_))
    }

    /// Whether the unit does something.
    pub const fn is_write(self) -> bool {
        matches!(self, Self::Run | Self::Stop)
    }
}

/// What an answer says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Content {
    /// So many words, from before or after the registers changed.
    Words(u16, bool),
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
                let words = [VALUES[usize::from(changed)]; 2];
                let answer = Answer::read(&words[..usize::from(count.clamp(1, 2))]);
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
