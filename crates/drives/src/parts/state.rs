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
    /// It turns; which way is not told.
    Running,
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
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Forward,
        Self::Reverse,
        Self::Running,
        Self::Stopped,
        Self::Fault,
        Self::PowerOff,
        Self::PreExciting,
        Self::Unknown,
    ];

    /// The state of that [`name`](Self::name).
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }

    /// Whether the drive feeds the motor with the aim of turning it.
    pub const fn is_running(self) -> bool {
        matches!(self, Self::Forward | Self::Reverse | Self::Running)
    }

    /// Whether a motor that is to turn as `wanted` says shows this: that way, or running with nothing said of it.
    pub fn shows(self, wanted: Self) -> bool {
        self == wanted || (self == Self::Running && wanted.is_running())
    }

    /// Whether the drive feeds the motor nothing.
    pub const fn is_at_rest(self) -> bool {
        matches!(self, Self::Stopped | Self::Fault | Self::PowerOff)
    }

    /// Its name in profiles and programs: `forward`, `power_off` …
    pub const fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Reverse => "reverse",
            Self::Running => "running",
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
    /// Which words mean which state: of those that fit, one that runs, else the first.
    pub rules: Vec<StateRule>,
    /// What each other word means.
    pub otherwise: State,
    /// Whether the word may say that the motor rests while it slows down, so that its frequency has to say so, too.
    pub rest_by_frequency: bool,
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
    ///
    /// A motor that runs is told as running, whatever else the word says of the drive: some run on in a fault. So a fault
    /// is no rest either where its own bits say nothing of running, and the others are those of a motor that runs.
    pub fn state(&self, raw: u16) -> State {
        let mut fitting = self.rules.iter().filter(|rule| rule.fits(raw));
        if let Some(running) = fitting.clone().find(|rule| rule.state.is_running()) {
            return running.state;
        }
        match fitting.next() {
            Some(rule) if rule.state.is_at_rest() && self.may_run(raw, *rule) => State::Unknown,
            Some(rule) => rule.state,
            None => self.otherwise,
        }
    }

    /// Whether the word `raw` says that the drive is in fault, which it may run in.
    pub fn is_in_fault(&self, raw: u16) -> bool {
        self.rules.iter().any(|rule| rule.state == State::Fault && rule.fits(raw))
    }

    /// Whether some word of it says that the drive is in fault.
    pub fn tells_fault(&self) -> bool {
        self.rules.iter().any(|rule| rule.state == State::Fault)
    }

    /// Whether `raw`, of which `rule` says that the motor rests, has the bits by which a running motor is told
    /// from a stopped one. Bits of the rule itself do not count: where it fits, they mean what it says.
    fn may_run(&self, raw: u16, rule: StateRule) -> bool {
        let of = |wanted: fn(State) -> bool| self.rules.iter().filter(move |rule| wanted(rule.state));
        of(State::is_running).any(|running| {
            of(|state| state == State::Stopped).any(|stopped| {
                let telling = running.mask & stopped.mask & (running.value ^ stopped.value) & !rule.mask;
                telling != 0 && raw & telling == running.value & telling
            })
        })
    }
}

impl StateRule {
    fn fits(self, raw: u16) -> bool {
        raw & self.mask == self.value
    }
}
