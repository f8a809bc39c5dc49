//! A drive's own time-out of the bus: what it does by itself when it hears nothing, set and given back.
//!
//! It helps where a program is killed, or a cable is cut. Whoever sets it keeps the line busy, by a question at each
//! [interval](BusTimeout::interval); when that ends, for whatever reason, the drive does what it was told. It is set in RAM: a
//! drive that is switched off has forgotten it.

mod not_armed;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_drives::{Input, Profile, Store, Watchdog};

pub use not_armed::{Back, NotArmable, NotArmed, NotAsked, NotGivenBack, WhyNotArmed};

use crate::fall::Fall;
use crate::families::Families;
use crate::look::POLL_INTERVAL;
use crate::parameters::{Held, NotKept};
use crate::rule::Rule;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;
use crate::values::Values;

/// How often a drive is asked within its time-out: three answers may be lost before it acts.
const QUESTIONS: u32 = 4;

/// What a drive does by itself when it has heard nothing for so long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OnSilence {
    /// It takes the voltage off the motor. It trips a fault, too, where the family has no [`Trip`](Self::Trip) beside it.
    Coast,
    /// It stops the motor as it is set to, and trips none.
    Stop,
    /// It trips a fault. What that does to the motor is set elsewhere in the drive: it may go on turning.
    Trip,
}

impl OnSilence {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Coast, Self::Stop, Self::Trip];

    /// What it is called: `coast`, `stop`, `trip`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coast => "coast",
            Self::Stop => "stop",
            Self::Trip => "trip",
        }
    }

    /// What units of `profile` can do when they hear nothing; nothing where no time-out of theirs is known.
    pub fn of(profile: &Profile) -> Vec<Self> {
        let Some(settings) = profile.watchdog() else { return Vec::new() };
        Self::ALL.into_iter().filter(|action| action.is_of(settings)).collect()
    }

    fn is_of(self, settings: &Watchdog) -> bool {
        self.word(settings).is_some() || self == Self::Trip && settings.action.is_none()
    }

    /// The word of the parameter that says what the drive does.
    const fn word(self, settings: &Watchdog) -> Option<u16> {
        match self {
            Self::Coast => settings.coast,
            Self::Stop => settings.stop,
            Self::Trip => settings.trip,
        }
    }
}

/// A drive's own time-out of the bus: what is set in it, and what it had before. Clones are the same time-out.
#[derive(Debug, Clone)]
pub struct BusTimeout {
    seconds: f64,
    action: OnSilence,
    /// What is written, as decimals. The action comes first: a time-out must not run out on another one.
    wanted: Vec<(String, String)>,
    state: Arc<Mutex<State>>,
}

#[derive(Debug)]
struct State {
    /// What the drive had, as decimals; nothing until it was read. The time-out comes first, for the same reason.
    former: Vec<(String, String)>,
    may_be_set: bool,
    is_armed: bool,
}

impl BusTimeout {
    /// The time-out of a unit of which `rule` says what may be written: after so many `seconds` without a request to it, it
    /// does this `action`. Nothing is sent.
    ///
    /// # Errors
    ///
    /// [`NotArmable`].
    pub fn new(rule: Rule<'_>, seconds: f64, action: OnSilence) -> Result<Self, NotArmable> {
        let profile = rule.profile();
        let settings = profile.watchdog().ok_or(NotArmable::NoTimeout)?;
        if profile.memory().is_none() {
            return Err(NotArmable::OnlyStored(settings.timeout.clone()));
        }
        if !(settings.verified || rule.trusts_all()) {
            return Err(NotArmable::NotPrinted(settings.note.clone()));
        }
        // What a profile names here is there.
        let timeout = profile.find(&settings.timeout).map_err(|_| NotArmable::NoTimeout)?;
        let high = timeout.quantity().high();
        let is_within = seconds > 0.0 && seconds.is_finite() && high.is_none_or(|high| seconds <= high.to_f64());
        if !is_within {
            return Err(NotArmable::OutOfRange { seconds, high });
        }
        if !action.is_of(settings) {
            return Err(NotArmable::NoAction { action, known: OnSilence::of(profile) });
        }
        let word = timeout.encode(seconds).map_err(NotArmable::Unfit)?;
        let action_too = settings.action.clone().zip(action.word(settings).map(|word| word.to_string()));
        let wanted: Vec<_> =
            action_too.into_iter().chain([(settings.timeout.clone(), timeout.decode(word).to_string())]).collect();
        let former = wanted.iter().rev().map(|(code, _)| (code.clone(), String::from("0"))).collect();
        let state = Arc::new(Mutex::new(State { former, may_be_set: false, is_armed: false }));
        Ok(Self { seconds, action, wanted, state })
    }

    /// Seconds of silence after which the drive acts.
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// What it then does.
    pub const fn action(&self) -> OnSilence {
        self.action
    }

    /// How long after one question the next one is due that keeps the drive from acting.
    pub fn interval(&self) -> Duration {
        // It is finite, above zero, and what some drive counts.
        Duration::try_from_secs_f64(self.seconds).map_or(Duration::MAX, |timeout| timeout / QUESTIONS)
    }

    /// Whether the drive acts by itself when it hears nothing: it was [set](Self::set), and not put back.
    pub fn is_armed(&self) -> bool {
        self.state().is_armed
    }

    /// Whether the drive may have some of it: also after a [`set`](Self::set) that was dropped on its way. Whoever drops one
    /// [puts back](Self::put_back) what the drive had.
    pub fn may_be_set(&self) -> bool {
        self.state().may_be_set
    }

    /// Sets it in `unit`, in RAM, and reads it back. Where anything fails, or the drive shows something else, that gets back
    /// what it had.
    ///
    /// # Errors
    ///
    /// [`NotArmed`]: its `back` says what the drive has.
    pub async fn set<E: LineError>(
        &self,
        unit: &Unit,
        line: &Mailbox<E>,
        families: &Families,
    ) -> Result<(), NotArmed<E>> {
        let not_armed = |parts, why, back| Err(NotArmed { unit: unit.address(), parts, why: Box::new(why), back });
        let codes: Vec<_> = self.wanted.iter().rev().map(|(code, _)| code.as_str()).collect();
        match unit.read_values(line, &codes).await {
            Err(why) => return not_armed(0, WhyNotArmed::Unread(why), Back::Untouched),
            Ok(had) => self.begin(&had),
        }
        let Err(why) = self.write(unit, line, families).await else {
            self.state().is_armed = true;
            return Ok(());
        };
        let parts = unit.parts();
        match self.put_back(&unit.apart(), line, families).await {
            Ok(()) => not_armed(parts, why, Back::Given),
            Err(error) => not_armed(parts, why, Back::NotGiven(error)),
        }
    }

    /// Waits for a motor that slows down, and gives `unit` back what it had: as
    /// [`comes_to_rest`](Unit::comes_to_rest) and [`put_back`](Self::put_back). `false` where the motor goes on turning: then
    /// the drive keeps the time-out, and acts when it hears nothing.
    ///
    /// # Errors
    ///
    /// [`NotGivenBack`]: the drive keeps the time-out, or some of it.
    pub async fn give_back<E: LineError>(
        &self,
        unit: &Unit,
        line: &Mailbox<E>,
        families: &Families,
    ) -> Result<bool, NotGivenBack<E>> {
        let rests = unit.comes_to_rest(line).await?;
        if rests {
            self.put_back(unit, line, families).await.map_err(NotGivenBack::NotKept)?;
        }
        Ok(rests)
    }

    /// Gives `unit` back what it had, whatever its motor does.
    ///
    /// # Errors
    ///
    /// [`NotKept`]: the drive keeps the time-out, or some of it.
    pub async fn put_back<E: LineError>(
        &self,
        unit: &Unit,
        line: &Mailbox<E>,
        families: &Families,
    ) -> Result<(), NotKept<E>> {
        let former = self.state().former.clone();
        let former: Vec<_> = former.iter().map(|(code, value)| (code.as_str(), Input::Decimal(value))).collect();
        unit.write_values(line, families, &former, Store::Ram).await?;
        let mut state = self.state();
        (state.may_be_set, state.is_armed) = (false, false);
        Ok(())
    }

    /// Asks `unit` for a word, which keeps it from acting for now.
    ///
    /// # Errors
    ///
    /// [`NotAsked`]: its `is_over` says whether asking again makes sense.
    pub async fn ask<E: LineError>(&self, unit: &Unit, line: &Mailbox<E>) -> Result<(), NotAsked<E>> {
        let why = match unit.ping(line).await {
            Ok(true) => return Ok(()),
            Ok(false) => None,
            Err(error) => Some(error),
        };
        Err(NotAsked { why, is_over: line.is_closed() })
    }

    /// What the drive `had` is kept, and from now on it may have something else.
    fn begin(&self, had: &Values) {
        let codes = self.wanted.iter().rev().map(|(code, _)| code.clone());
        let former = codes.zip(had.values.iter().map(ToString::to_string)).collect();
        let mut state = self.state();
        (state.former, state.may_be_set) = (former, true);
    }

    async fn write<E: LineError>(
        &self,
        unit: &Unit,
        line: &Mailbox<E>,
        families: &Families,
    ) -> Result<(), WhyNotArmed<E>> {
        let given: Vec<_> =
            self.wanted.iter().map(|(code, value)| (code.as_str(), Input::Decimal(value.as_str()))).collect();
        unit.write_values(line, families, &given, Store::Ram).await.map_err(WhyNotArmed::NotKept)?;
        let codes: Vec<_> = given.iter().map(|(code, _)| *code).collect();
        let shown = unit.read_values(line, &codes).await.map_err(WhyNotArmed::Unshown)?;
        let is_it = self.wanted.iter().zip(&shown.values).all(|((_, wanted), shown)| *wanted == shown.to_string());
        if is_it { Ok(()) } else { Err(WhyNotArmed::Others(held(&codes, &shown))) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What was read of these `codes`.
fn held(codes: &[&str], read: &Values) -> Vec<Held> {
    let all = codes.iter().zip(&read.values);
    // What was read is there.
    all.filter_map(|(&code, &value)| Some(Held::of(code, read.profile.find(code).ok()?, value))).collect()
}

impl Unit {
    /// Waits while the motor slows down: until the drive is at rest, or its output frequency has not fallen for a second.
    /// Whether it is at rest then; where the family does not tell a frequency, as the first look shows it.
    ///
    /// # Errors
    ///
    /// [`NotGivenBack::Unseen`] and [`NotGivenBack::Failed`]: the drive was only asked.
    pub async fn comes_to_rest<E: LineError>(&self, line: &Mailbox<E>) -> Result<bool, NotGivenBack<E>> {
        self.rule().state().map_err(|why| NotGivenBack::Unseen(why.to_string()))?;
        let family_line = line.taken_for(self.address(), self.family());
        let (mut lowest, mut deadline) = (f64::INFINITY, line.now());
        loop {
            let state = self.state(line).await.map_err(NotGivenBack::Failed)?;
            let turns = self.speeds().turns_in_spite_of(state, &family_line, self.address(), false);
            if state.is_at_rest() && !turns.await.map_err(NotGivenBack::Failed)? {
                return Ok(true);
            }
            let frequency = self.output(line).await.map_err(NotGivenBack::Failed)?;
            let now = line.now();
            match frequency {
                Some(frequency) if frequency < lowest => (lowest, deadline) = (frequency, now + Fall::PATIENCE),
                _ if now >= deadline => return Ok(false),
                _ => {}
            }
            line.sleep(POLL_INTERVAL).await.map_err(NotGivenBack::Failed)?;
        }
    }
}

#[cfg(test)]
mod tests;
