//! States: what a motor does, as the drive's state word says it.

use serde::Deserialize;

/// What the motor does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum State {
    /// It turns forward.
    Forward,
    /// It turns in reverse.
    Reverse,
    /// It is stopped.
    Stopped,
    /// The drive tripped; the fault register says why.
    Fault,
    /// The drive has no mains power, or too little.
    PowerOff,
    /// It is magnetised before it starts.
    PreExciting,
    /// The state word is none of the documented ones.
    #[serde(skip)]
    Unknown,
}

impl State {
    /// Its name in profiles and programs: `forward`, `power_off` …
    pub const fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Reverse => "reverse",
            Self::Stopped => "stopped",
            Self::Fault => "fault",
            Self::PowerOff => "power_off",
            Self::PreExciting => "pre_exciting",
            Self::Unknown => "unknown",
        }
    }
}

/// How a family says what its motor does.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct StateWord {
    /// The register's name.
    pub register: String,
    /// Which words mean which state; the first that fits holds.
    pub rules: Vec<StateRule>,
    /// Whether a document of this family prints it.
    pub verified: bool,
    /// What to know about it; says what is assumed where it is not verified.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

/// One way to tell a state: the bits of `mask` are those of `value`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct StateRule {
    /// The state.
    pub state: State,
    /// The bits that tell it.
    pub mask: u16,
    /// What they are.
    pub value: u16,
}

impl StateWord {
    /// What the word `raw` means.
    pub fn state(&self, raw: u16) -> State {
        self.rules.iter().find(|rule| raw & rule.mask == rule.value).map_or(State::Unknown, |rule| rule.state)
    }
}
