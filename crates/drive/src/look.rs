//! A look at a drive: what its status words say, in the fewest reads.
//!
//! Which words those are, and what they mean, its profile says. What no document of the family proves is left out unless
//! that is trusted: half of a state is better than none.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::{BitField, Entry, Fault, Profile, ReadPlan, State, Value};
use drivebus_rtu::{Instant, UnitAddress};

use crate::planned::read_planned;
use crate::rule::{Rule, WhyNot};
use crate::task::Mailbox;

/// What a look at units of one family reads, under one trust. Worked out once, and used for every look.
#[derive(Debug)]
pub struct Looks {
    profile: Arc<Profile>,
    is_trusted: bool,
    /// What is read; `None` where nothing may be.
    plan: Option<ReadPlan>,
    /// What stands in the plan, in its order.
    words: Vec<Word>,
}

/// A word of a look.
#[derive(Debug)]
struct Word {
    role: Role,
    /// Those of its bits that tell more than the word itself.
    bits: Vec<BitField>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    State,
    Fault,
    /// Its bits alone count.
    Bits,
}

/// What one look showed.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Look {
    /// What the motor does; unknown where no word tells, or that word is none of the documented ones.
    pub state: State,
    /// The state word itself; `None` where it may not be read.
    pub word: Option<u16>,
    /// The number of the fault, 0 where there is none; `None` where no register of it may be read.
    pub fault: Option<u16>,
    /// Whether the state word says that the drive is in fault, or where it cannot, the number. It may run all the same.
    pub is_in_fault: bool,
    /// The bit fields of the status words, each by its name with what it means, in the order of the bits.
    pub fields: Vec<(String, String)>,
    /// When the first of it was asked for, in Unix time; zero where nothing was.
    pub asked: Duration,
}

impl Look {
    /// Whether the drive is in fault: by its state word, or where that may not be read by the number of its fault.
    pub fn is_tripped(&self) -> bool {
        self.is_in_fault || (self.word.is_none() && self.fault.is_some_and(|number| number != 0))
    }

    /// What the bit field of that name means.
    pub fn field(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(known, _)| known == name).map(|(_, means)| means.as_str())
    }

    /// What `profile` calls the fault that it shows; `None` where it shows none.
    pub fn fault_of<'p>(&self, profile: &'p Profile) -> Option<Cow<'p, Fault>> {
        self.fault.filter(|&number| number != 0).map(|number| profile.fault(number))
    }
}

/// Time between two looks at a drive.
pub(crate) const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Time that a look takes only where it waits until nothing that is late can be mistaken.
const LONG_LOOK: Duration = Duration::from_millis(500);

/// The moment for which a look counts that took from `began` until `ended`: what was seen before a long wait is old.
pub(crate) fn counts_for(began: Instant, ended: Instant) -> Instant {
    if ended.saturating_duration_since(began) < LONG_LOOK { ended } else { began }
}

/// Where a drive may take its commands from besides the bus, as the bits of a status word say it.
const OTHER_SOURCES: [&str; 2] = ["keypad", "terminal"];

/// And how they say that it is the bus.
const BUS: &str = "communication";

impl Look {
    /// Where else than from the bus the drive takes its commands, if it says so: `keypad` or `terminal`.
    pub fn other_source(&self) -> Option<&str> {
        self.field("control_channel").filter(|source| OTHER_SOURCES.contains(source))
    }

    /// Whether the drive says where it takes its commands from.
    pub(crate) fn tells_source(&self) -> bool {
        self.other_source().is_some() || self.field("control_channel") == Some(BUS)
    }

    /// Whether it shows the number of a fault.
    pub(crate) fn has_fault(&self) -> bool {
        self.fault.is_some_and(|number| number != 0)
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.word {
            None => f.write_str("state not known")?,
            Some(_) => write!(f, "{}", self.state.name().replace('_', " "))?,
        }
        match self.fault {
            Some(0) => Ok(()),
            Some(number) => write!(f, ", fault {number}"),
            None => f.write_str(", fault not known"),
        }
    }
}

impl Looks {
    /// Looks at units of `profile`; where `is_trusted`, also by what no document of the family prints.
    pub fn new(profile: &Arc<Profile>, is_trusted: bool) -> Self {
        let rule = Rule::of(profile, is_trusted);
        let is = |one: &Entry, other: &Entry| one.name() == other.name();
        let register = profile.role("state");
        let mut entries = Vec::new();
        let mut words = Vec::new();
        let mut reads = |entry, role, bits: &[BitField]| {
            entries.push(entry);
            words.push(Word { role, bits: bits.to_vec() });
        };
        if let Some(state) = register.filter(|_| rule.state().is_ok()) {
            let tells_more = profile.status_words().any(|word| is(word, state));
            reads(state, Role::State, if tells_more { state.bits() } else { &[] });
        }
        for word in profile.status_words().filter(|word| rule.read(word).is_ok()) {
            if register.is_none_or(|state| !is(word, state)) {
                reads(word, Role::Bits, word.bits());
            }
        }
        if let Some(fault) = profile.role("fault").filter(|_| rule.fault().is_ok()) {
            reads(fault, Role::Fault, &[]);
        }
        // What may be read can be.
        let plan = if entries.is_empty() { None } else { profile.compile(&entries).ok() };
        Self { profile: Arc::clone(profile), is_trusted, plan, words }
    }

    /// What is known of the family.
    pub fn profile(&self) -> &Arc<Profile> {
        &self.profile
    }

    /// The state word that a look reads.
    pub fn state_word(&self) -> Option<&Entry> {
        self.profile.role("state").filter(|_| self.state().is_ok())
    }

    /// The register of the present fault that a look reads.
    pub fn fault_register(&self) -> Option<&Entry> {
        self.profile.role("fault").filter(|_| self.fault().is_ok())
    }

    /// Whether nothing may be read: then no look shows anything.
    pub fn is_blind(&self) -> bool {
        self.plan.is_none()
    }

    /// Whether the state of its units may be used.
    ///
    /// # Errors
    ///
    /// Those of [`Rule::state`].
    pub fn state(&self) -> Result<(), WhyNot<'_>> {
        self.rule().state()
    }

    /// Whether the present fault of its units may be read.
    ///
    /// # Errors
    ///
    /// Those of [`Rule::fault`].
    pub fn fault(&self) -> Result<(), WhyNot<'_>> {
        self.rule().fault()
    }

    /// Whether what no document of the family prints is trusted.
    pub(crate) fn is_trusted(&self) -> bool {
        self.is_trusted
    }

    /// What may be asked of its units, under the same trust.
    pub(crate) fn rule(&self) -> Rule<'_> {
        Rule::of(&self.profile, self.is_trusted)
    }

    /// Looks at `unit`, before all who wait for the line where it `is_urgent`. Where nothing may be read, nothing is asked.
    ///
    /// # Errors
    ///
    /// Those of the line; the drive goes on as it was.
    pub async fn look<E>(&self, line: &Mailbox<E>, unit: UnitAddress, is_urgent: bool) -> Result<Look, E> {
        let came = read_planned(self.plan.as_ref(), line, unit, is_urgent).await?;
        Ok(self.shown(&came.words, came.asked))
    }

    /// What the words of all reads show, which were `asked` for then.
    fn shown(&self, came: &[u16], asked: Duration) -> Look {
        let (mut state, mut fault, mut fields) = (None, None, Vec::new());
        let values = self.plan.iter().flat_map(|plan| plan.values(came));
        for (word, (_, value)) in self.words.iter().zip(values) {
            let Some(raw) = value.map(Value::word) else { continue };
            match word.role {
                Role::State => state = Some(raw),
                Role::Fault => fault = Some(raw),
                Role::Bits => {}
            }
            fields.extend(word.bits.iter().map(|field| (field.name().to_owned(), field.meaning(raw).into_owned())));
        }
        let fault = self.fault_number(state, fault);
        Look {
            state: state.map_or(State::Unknown, |raw| self.profile.state(raw)),
            word: state,
            fault,
            is_in_fault: self.is_in_fault(state, fault),
            fields,
            asked,
        }
    }

    /// The number of the present fault where these are the state `word` and the `raw` word of the fault; 0 is none.
    ///
    /// `None` where that is not known: of a number that holds, the state alone says whether it is the present one.
    pub fn fault_number(&self, word: Option<u16>, raw: Option<u16>) -> Option<u16> {
        let number = self.profile.fault_number(raw?);
        if !self.profile.fault_holds() {
            return Some(number);
        }
        word.map(|word| if self.profile.is_in_fault(word) { number } else { 0 })
    }

    /// Whether a drive is in fault whose state `word` and number of the `fault` are these; `None` is what is not known.
    pub fn is_in_fault(&self, word: Option<u16>, fault: Option<u16>) -> bool {
        let is_numbered = fault.is_some_and(|number| number != 0) && !self.profile.state_tells_fault();
        word.is_some_and(|raw| self.profile.is_in_fault(raw) || is_numbered)
    }
}

#[cfg(test)]
mod tests;
