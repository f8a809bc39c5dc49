//! States: what a motor does, as the drive's state word says it.

use serde::Deserialize;

/// What the motor does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
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
