//! A unit as one call sees it: what it is taken for, what its words mean, what was sent to it, and what it took of the call.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use drivebus_drives::{Entry, Place, Profile, Setpoint, State, Value};
use drivebus_rtu::UnitAddress;

use crate::family::Family;
use crate::look::Look;
use crate::planned::read_planned;
use crate::record::Record;
use crate::rule::Rule;
use crate::same_unit::SameUnit;
use crate::speed::Speeds;
use crate::taken::Taken;
use crate::task::{Mailbox, Notice, Read};

/// A unit as one call sees it. A clone is the same call.
#[derive(Debug, Clone)]
pub struct Unit {
    taken: Taken,
    record: Record,
    /// How often it had been told to halt when this call began, where it starts something.
    halts: Option<u64>,
    /// How many writes of this call it took.
    parts: Arc<AtomicU64>,
}

impl Unit {
    /// The unit as it is `taken`, of which `record` has what was sent to it.
    pub fn new(taken: Taken, record: &Record) -> Self {
        Self { taken, record: record.clone(), halts: None, parts: Arc::default() }
    }

    /// Its address.
    pub fn address(&self) -> UnitAddress {
        self.taken.same().unit()
    }

    /// Whether it is what it was named as.
    pub fn same(&self) -> &SameUnit {
        self.taken.same()
    }

    /// What its words mean.
    pub fn profile(&self) -> &Arc<Profile> {
        self.taken.profile()
    }

    /// What was sent to it.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// How many writes of this call it took.
    pub fn parts(&self) -> u64 {
        self.parts.load(Ordering::Relaxed)
    }

    /// What may be asked of it.
    pub(crate) fn rule(&self) -> Rule<'_> {
        self.taken.rule()
    }

    pub(crate) fn speeds(&self) -> &Speeds {
        self.taken.speeds()
    }

    /// What it is taken for.
    pub(crate) fn family(&self) -> &Arc<Family> {
        self.same().family()
    }

    /// How often it had been told to halt when this call began: what is written by it is not sent once that is another number.
    pub(crate) fn halts(&self) -> Option<u64> {
        self.halts
    }

    /// It took a write.
    pub(crate) fn took_part(&self) {
        self.parts.fetch_add(1, Ordering::Relaxed);
    }

    /// The same unit in another call, of which is counted apart what it takes.
    pub(crate) fn apart(&self) -> Self {
        Self { parts: Arc::default(), ..self.clone() }
    }

    /// The same call, whose words are known better: by `profile`.
    pub(crate) fn with_profile(&self, profile: &Arc<Profile>) -> Self {
        Self { taken: self.taken.with_profile(profile), ..self.clone() }
    }

    /// The same call, for a start: once anybody tells the unit to halt, nothing is written to it over this.
    pub(crate) async fn unless_halted<E>(&self, line: &Mailbox<E>) -> Result<Self, E> {
        Ok(Self { halts: line.halts(self.address()).await?, ..self.clone() })
    }

    /// Whether the states of its family may be used.
    pub(crate) fn tells_its_state(&self) -> bool {
        self.taken.tells_its_state()
    }

    /// Whether nothing of its state may be read.
    pub(crate) fn is_blind(&self) -> bool {
        self.taken.is_blind()
    }

    /// The register that takes `setpoint`; `None` where the family has none that is known.
    pub(crate) fn register_of(&self, setpoint: Setpoint) -> Option<&Entry> {
        let role = self.profile().setpoints().get(&setpoint)?;
        self.profile().find(&role.register).ok()
    }

    /// Looks at it, and tells what was seen.
    pub(crate) async fn look<E>(&self, line: &Mailbox<E>) -> Result<Look, E> {
        self.taken.look(line, false).await
    }

    /// Its output frequency in Hz; `None` where it does not tell.
    pub(crate) async fn output<E>(&self, line: &Mailbox<E>) -> Result<Option<f64>, E> {
        self.speeds().output(&line.taken_for(self.address(), self.family()), self.address(), false).await
    }

    /// Asks for one word, which tells whether it answers: its state, or else what of it may be read. `false` where nothing may.
    pub(crate) async fn ping<E>(&self, line: &Mailbox<E>) -> Result<bool, E> {
        if self.tells_its_state() {
            return self.state(line).await.map(|_| true);
        }
        let profile = self.profile();
        let roles = ["state", "fault"].into_iter().filter_map(|role| profile.role(role));
        let mut known = roles.chain(profile.monitor()).chain(profile.entries());
        let Some(place) = known.find(|entry| self.rule().read(entry).is_ok()).and_then(Entry::place) else {
            return Ok(false);
        };
        self.word(line, place).await.map(|_| true)
    }

    /// What its state word says, read alone. Its states may be used.
    pub(crate) async fn state<E>(&self, line: &Mailbox<E>) -> Result<State, E> {
        // What may be used has an address.
        let Some(place) = self.profile().role("state").and_then(Entry::place) else { return Ok(State::Unknown) };
        let state = self.profile().state(self.word(line, place).await?);
        line.taken_for(self.address(), self.family()).tell(Notice::Shows(state)).await;
        Ok(state)
    }

    /// The word at `place`.
    pub(crate) async fn word<E>(&self, line: &Mailbox<E>, place: Place) -> Result<u16, E> {
        let words = line.taken_for(self.address(), self.family()).read(Read::word(self.address(), place)).await?;
        // One is there: a step takes as many words as were asked for.
        Ok(words.first().copied().unwrap_or_default())
    }

    /// The values of `entries`, which may be read, in their order and in the fewest reads.
    pub(crate) async fn values<E>(&self, line: &Mailbox<E>, entries: &[&Entry]) -> Result<Vec<Value>, E> {
        // What may be read has an address.
        let Ok(plan) = self.profile().compile(entries) else { return Ok(Vec::new()) };
        let came =
            read_planned(Some(&plan), &line.taken_for(self.address(), self.family()), self.address(), false).await?;
        Ok(plan.values(&came.words).filter_map(|(_, value)| value).collect())
    }
}
