//! Commands: what a motor can be told, and what must be set before the drive listens.

use serde::Deserialize;

use crate::place::Place;

/// What a motor can be told. The codes differ from family to family; the profile owns them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Command {
    /// Turn forward, at the setpoint.
    RunForward,
    /// Turn in reverse, at the setpoint.
    RunReverse,
    /// Turn forward, at the jog frequency.
    JogForward,
    /// Turn in reverse, at the jog frequency.
    JogReverse,
    /// Come to a stop the way the drive is set to: as a rule along the deceleration ramp.
    Stop,
    /// Switch the motor off and let it run out.
    Coast,
    /// Clear a fault.
    ResetFault,
    /// End a jog.
    JogStop,
}

impl Command {
    /// Every command.
    pub const ALL: [Self; 8] = [
        Self::RunForward,
        Self::RunReverse,
        Self::JogForward,
        Self::JogReverse,
        Self::Stop,
        Self::Coast,
        Self::ResetFault,
        Self::JogStop,
    ];

    /// Its name in profiles and programs: `run_forward` …
    pub const fn name(self) -> &'static str {
        match self {
            Self::RunForward => "run_forward",
            Self::RunReverse => "run_reverse",
            Self::JogForward => "jog_forward",
            Self::JogReverse => "jog_reverse",
            Self::Stop => "stop",
            Self::Coast => "coast",
            Self::ResetFault => "reset_fault",
            Self::JogStop => "jog_stop",
        }
    }
}

/// The word that means a command in a family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct CommandCode {
    /// The word.
    pub code: u16,
    /// Whether a document of the family prints it.
    pub verified: bool,
    /// The register that takes it, where that is not the command register.
    pub elsewhere: Option<Place>,
    /// What is written before it: where, and the word. It says which way the motor turns, where the word itself does not.
    pub first: Option<(Place, u16)>,
}

/// A word that comes, with others in their order, before one that runs or jogs a motor at rest.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct StartWord {
    /// The word.
    pub word: u16,
    /// What it does.
    pub label: String,
    /// What the state word must show before the next word goes out.
    pub until: Vec<Until>,
}

/// A bit field of the state word, and what it must hold.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Until {
    /// Its name.
    pub field: String,
    /// Its bits.
    pub mask: u16,
    /// What they must be.
    pub value: u16,
}

impl std::str::FromStr for Command {
    type Err = ParseCommandError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|command| command.name() == name).ok_or_else(|| ParseCommandError {
            name: name.to_owned(),
            closest: crate::text::closest(name, Self::ALL.into_iter().map(Self::name)).unwrap_or_default().to_owned(),
        })
    }
}

/// No command has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no command \"{name}\"; the closest is \"{closest}\"")]
#[non_exhaustive]
pub struct ParseCommandError {
    /// The name as given.
    pub name: String,
    /// The name closest to it.
    pub closest: String,
}

/// A parameter that must have a certain value before the drive obeys the bus.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Control {
    /// The parameter's code: `P00.01`. A register's name, where that decides.
    pub code: String,
    /// The highest and the lowest of the bits that count; `None`: all of them.
    pub bits: Option<[u8; 2]>,
    /// The word it must hold, or what those bits must.
    pub raw: u16,
    /// What this value means.
    pub label: String,
    /// Whether it is asked before each start, also where the drive says itself that it obeys the bus: with another value
    /// the words of the profile are not where it has them.
    pub always: bool,
    /// Whether setting it does more than make the drive obey the bus: it is left to who asks for it by its name.
    pub by_hand: bool,
    /// Other words with which commands mean what they mean with `raw`.
    pub same: Vec<u16>,
    /// Words with which commands mean something else. Where there is one, the parameter is read before the first command, also
    /// before one that halts.
    pub otherwise: Vec<OtherWords>,
    /// Whether a document of this family prints the value; else it is assumed.
    pub verified: bool,
    /// What to know about it; may be empty.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

impl Control {
    /// What counts of the word `raw`.
    pub fn found(&self, raw: u16) -> u16 {
        self.bits.map_or(raw, |[high, low]| (raw << (15 - high)) >> (15 - high + low))
    }

    /// Whether it decides what the words of commands mean.
    pub fn decides_words(&self) -> bool {
        !self.otherwise.is_empty()
    }

    /// Whether commands mean what the profile says where the parameter holds `raw`; so they do if it decides nothing.
    pub fn keeps_words(&self, raw: u16) -> bool {
        !self.decides_words() || raw == self.raw || self.same.contains(&raw)
    }

    /// What is known of `raw`, with which the words of commands mean something else.
    pub fn other_words(&self, raw: u16) -> Option<&OtherWords> {
        self.otherwise.iter().find(|row| row.raw == raw)
    }
}

/// A word of a parameter with which the words of commands mean something else: another control profile of the drive.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct OtherWords {
    /// What the parameter holds.
    pub raw: u16,
    /// What the words mean then.
    pub means: String,
    /// The word that stops the motor then, in the register of commands; `None`: none is known.
    pub stop: Option<u16>,
    /// The one that lets it coast then; `None`: none is known.
    pub coast: Option<u16>,
    /// Where it is printed.
    pub source: String,
}

impl OtherWords {
    /// The word that does then what `command`, which halts, is for: the nearest there is.
    pub fn halt(&self, command: Command) -> Option<u16> {
        match command {
            Command::Coast => self.coast.or(self.stop),
            Command::Stop | Command::JogStop => self.stop.or(self.coast),
            _ => None,
        }
    }
}
