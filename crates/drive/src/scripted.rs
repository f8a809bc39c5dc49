//! A unit for tests: it answers an operation by a script, and what was asked is kept.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::Place;
use drivebus_rtu::{ExceptionCode, Instant, UnitAddress};
use proptest::prelude::*;

use crate::families::Families;
use crate::family::Family;
use crate::look::Looks;
use crate::record::Record;
use crate::same_unit::SameUnit;
use crate::speed::Speeds;
use crate::taken::Taken;
use crate::task::{
    Cause, LineError, Link, Mailbox, Notice, Outcome, Payload, Read, Seen, Stamped, Step, Task, Wish, Write,
};

/// Who is asked.
pub(crate) const UNIT: UnitAddress = UnitAddress::by_name(5);

/// An error of the scripted line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) cause: Cause,
    pub(crate) raw: Vec<u8>,
    /// Whether the request went out.
    pub(crate) was_sent: bool,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.cause)
    }
}

impl LineError for Fault {
    fn cause(&self) -> Cause {
        self.cause
    }

    fn raw(&self) -> &[u8] {
        &self.raw
    }

    fn was_sent(&self) -> bool {
        self.was_sent
    }
}

/// How the unit answers one question.
pub(crate) type Reply = Result<u16, Fault>;

/// It fails for this cause, and nothing came.
pub(crate) fn fails<T>(cause: Cause) -> Result<T, Fault> {
    Err(Fault { cause, raw: Vec::new(), was_sent: true })
}

/// It refuses by this exception, which means what the specification says.
pub(crate) fn refuses<T>(code: u8) -> Result<T, Fault> {
    fails(Cause::Refused(ExceptionCode(code), ExceptionCode(code).meaning()))
}

/// Who answers. What answers reads alone is a function of them.
pub(crate) trait Unit {
    /// How it answers the question for one word.
    fn read(&mut self, read: Read, now: Instant) -> Reply;

    /// What becomes of a write.
    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault>;

    /// How often the port was opened again to come to it.
    fn reopened(&self) -> u64 {
        0
    }
}

impl<F: FnMut(Read) -> Reply> Unit for F {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        self(read)
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        panic!("nobody expects {write}")
    }
}

/// A unit that has `words`, besides them what the profile of `family` prints, and of all else says that it has no such
/// address.
pub(crate) fn like<'f>(family: &'f Family, words: &'f [(u16, u16)]) -> impl FnMut(Read) -> Reply + 'f {
    move |read| match words.iter().find(|(address, _)| Place::from(*address) == read.place) {
        Some(&(_, word)) => Ok(word),
        None if family.has(read.place) && !family.refuses(read.place) => Ok(0),
        None => refuses(0x02),
    }
}

/// A unit that has `words`, and 0 everywhere else.
pub(crate) fn zeros_but(words: &[(u16, u16)]) -> impl FnMut(Read) -> Reply + '_ {
    |read| {
        let word = words.iter().find(|(address, _)| Place::from(*address) == read.place);
        Ok(word.map_or(0, |&(_, word)| word))
    }
}

/// A unit that shows what was written to it, as one of a family does.
pub(crate) struct Keeper {
    family: Arc<Family>,
    /// What it has where that is not 0, by the plain places.
    pub(crate) words: BTreeMap<Place, u16>,
    /// What becomes of the first writes; each other one is confirmed.
    pub(crate) confirms: VecDeque<Result<(), Fault>>,
}

impl Keeper {
    pub(crate) fn new(family: &Arc<Family>, words: &[(u16, u16)]) -> Self {
        let words = words.iter().map(|&(address, word)| (Place::from(address), word)).collect();
        Self { family: Arc::clone(family), words, confirms: VecDeque::new() }
    }
}

impl Unit for Keeper {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        match self.words.get(&read.place) {
            Some(&word) => Ok(word),
            None => like(&self.family, &[])(read),
        }
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        self.confirms.pop_front().unwrap_or(Ok(()))?;
        let first = self.family.profile().stored_address(write.place).unwrap_or(write.place.address);
        for (address, word) in (first..).zip(words_of(write)) {
            let place = Place { address, ..write.place };
            let stores = self.family.profile().store_word().filter(|(store, at)| (*at, store.word) == (place, word));
            self.words.insert(place, stores.and_then(|(store, _)| store.idle).unwrap_or(word));
        }
        Ok(())
    }
}

/// A unit that is written to, over and over, with the line and the record that it keeps.
pub(crate) struct Bench {
    pub(crate) script: Script,
    pub(crate) record: Record,
    pub(crate) family: Arc<Family>,
    pub(crate) keeper: Keeper,
    pub(crate) is_trusted: bool,
}

impl Bench {
    pub(crate) fn of(family: &str, words: &[(u16, u16)]) -> Self {
        let family = shipped(family);
        let keeper = Keeper::new(&family, words);
        Self { script: Script::new(), record: Record::default(), family, keeper, is_trusted: false }
    }

    /// The same, of whose words all are trusted.
    pub(crate) fn trusting(self) -> Self {
        Self { is_trusted: true, ..self }
    }

    /// A call to it.
    pub(crate) fn call(&self) -> crate::Unit {
        call(&self.family, &self.record, self.is_trusted)
    }
}

/// A drive of `family` that has `words`, and takes what is written. Behind a write to where commands go that begins with a
/// word, it has what stands beside that.
#[derive(Debug, Clone)]
pub(crate) struct Obeys {
    family: Arc<Family>,
    words: BTreeMap<Place, u16>,
    shows: Vec<(u16, Place, u16)>,
}

impl Obeys {
    pub(crate) fn new(family: &str, words: &[(u16, u16)], shows: &[(u16, u16, u16)]) -> Self {
        let words = words.iter().map(|&(address, word)| (Place::from(address), word)).collect();
        let shows = shows.iter().map(|&(told, address, word)| (told, Place::from(address), word)).collect();
        Self { family: shipped(family), words, shows }
    }

    /// The same drive, which has these words as well.
    pub(crate) fn with(mut self, words: &[(u16, u16)]) -> Self {
        self.words.extend(words.iter().map(|&(address, word)| (Place::from(address), word)));
        self
    }

    /// The unit as a call sees it, under this trust; it was not asked yet what it is.
    pub(crate) fn seen(&self, is_trusted: bool) -> crate::unit::Unit {
        call(&self.family, &Record::default(), is_trusted)
    }
}

impl Unit for Obeys {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        match self.words.get(&read.place) {
            Some(&word) => Ok(word),
            None => like(&self.family, &[])(read),
        }
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        let first = words_of(write).first().copied();
        if self.family.commands_at(write.place) {
            let shown = self.shows.iter().filter(|(told, ..)| first == Some(*told));
            self.words.extend(shown.map(|&(_, place, word)| (place, word)));
        }
        Ok(())
    }
}

/// The words that `write` carries.
pub(crate) fn words_of(write: &Write) -> Vec<u16> {
    match &write.payload {
        Payload::Word(word) => vec![*word],
        Payload::Words(words) => words.clone(),
    }
}

/// A call to the unit as one of `family`, of whose words all are trusted where that `is_trusted`.
pub(crate) fn call(family: &Arc<Family>, record: &Record, is_trusted: bool) -> crate::Unit {
    let same = SameUnit::new(UNIT, family, &record.identity(family.name(), 0), false);
    call_as(same, record, is_trusted)
}

/// A call to the unit that is meant by its name, whatever it says.
pub(crate) fn call_meant(family: &Arc<Family>, record: &Record, is_trusted: bool) -> crate::Unit {
    let same = SameUnit::new(UNIT, family, &record.identity(family.name(), 0), true);
    call_as(same, record, is_trusted)
}

fn call_as(same: SameUnit, record: &Record, is_trusted: bool) -> crate::Unit {
    let profile = Arc::clone(same.family().profile());
    let looks = Arc::new(Looks::new(&profile, is_trusted));
    crate::Unit::new(Taken::as_named(same, &looks, &Arc::new(Speeds::new(&profile, is_trusted))), record)
}

/// The line of one test: its time, how often it was opened again, and what was asked.
#[derive(Debug)]
pub(crate) struct Script {
    pub(crate) now: Instant,
    pub(crate) connection: u64,
    pub(crate) is_closed: bool,
    pub(crate) asked: Vec<Read>,
    /// What was written, and when.
    pub(crate) sent: Vec<(Instant, Write)>,
    pub(crate) told: Vec<Notice>,
    pub(crate) link: Link,
    /// How well these units could be reached, otherwise than `link` has it.
    pub(crate) links: BTreeMap<UnitAddress, Link>,
    /// How much longer a request takes that no answer comes to.
    pub(crate) silence: Duration,
    /// What becomes of a pause.
    pub(crate) pauses: Result<(), Fault>,
    /// How often the unit was told to halt.
    pub(crate) halts: u64,
}

impl Script {
    pub(crate) fn new() -> Self {
        let (asked, sent, told) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            now: Instant::ZERO,
            connection: 0,
            is_closed: false,
            asked,
            sent,
            told,
            link: Link::default(),
            links: BTreeMap::new(),
            silence: Duration::ZERO,
            pauses: Ok(()),
            halts: 0,
        }
    }

    /// What the operation comes to where `unit` is asked, for each word of a read. Each request takes a millisecond; none is
    /// made without end.
    pub(crate) fn carry_out<T, F>(&mut self, mut unit: impl Unit, operation: impl FnOnce(Mailbox<Fault>) -> F) -> T
    where
        F: Future<Output = T> + Send + 'static,
    {
        self.carry_out_with(&mut unit, operation)
    }

    /// The same with a `unit` that goes on afterwards.
    pub(crate) fn carry_out_with<T, F>(
        &mut self,
        unit: &mut impl Unit,
        operation: impl FnOnce(Mailbox<Fault>) -> F,
    ) -> T
    where
        F: Future<Output = T> + Send + 'static,
    {
        self.asked.clear();
        let mut task = Task::new(operation);
        let mut outcome = None;
        loop {
            let connection = self.connection + unit.reopened();
            let seen = Seen { now: self.now, connection, is_closed: self.is_closed };
            let step = task.step(seen, outcome).unwrap();
            let taken_for = task.taken_for().map(|(unit, _)| unit);
            outcome = match step {
                Step::Done(done) => return done,
                Step::Wish(Wish::Read(read)) => {
                    self.asked.push(read);
                    assert!(taken_for.is_none_or(|unit| unit == read.unit), "another unit is meant");
                    assert!(self.asked.len() < 4000, "it asks without end");
                    let asked = self.now;
                    self.now = self.now + Duration::from_millis(1);
                    let places = (read.place.address..=u16::MAX).take(read.count.into());
                    let word = |address| unit.read(Read { place: Place { address, ..read.place }, ..read }, self.now);
                    Some(match places.map(word).collect() {
                        Err(fault) => self.failed(fault),
                        Ok(words) if read.is_stamped => Outcome::Stamped(Stamped {
                            words,
                            asked: since_start(asked),
                            answered: since_start(self.now),
                        }),
                        Ok(words) => Outcome::Words(words),
                    })
                }
                Step::Wish(Wish::Write(write)) => {
                    self.now = self.now + Duration::from_millis(1);
                    assert!(taken_for.is_none_or(|unit| unit == write.unit), "another unit is meant");
                    let came = unit.write(&write, self.now);
                    self.sent.push((self.now, write));
                    assert!(self.sent.len() < 1000, "it sends without end");
                    Some(came.map_or_else(|fault| self.failed(fault), |()| Outcome::Written))
                }
                Step::Wish(Wish::Sleep(time)) => {
                    self.now = self.now + time;
                    Some(self.pauses.clone().map_or_else(Outcome::Failed, |()| Outcome::Slept))
                }
                Step::Wish(Wish::Link(unit)) => Some(Outcome::Link(*self.links.get(&unit).unwrap_or(&self.link))),
                Step::Wish(Wish::Halts(_)) => Some(Outcome::Halts(Some(self.halts))),
                Step::Wish(Wish::Tell(notice)) => {
                    assert!(taken_for.is_some(), "nobody knows of whom {notice:?} is");
                    self.told.push(notice);
                    Some(Outcome::Heard)
                }
            };
        }
    }

    fn failed(&mut self, fault: Fault) -> Outcome<Fault> {
        if fault.cause == Cause::NoAnswer {
            self.now = self.now + self.silence;
        }
        Outcome::Failed(fault)
    }

    /// Where was written to, and which words, in their order.
    pub(crate) fn written(&self) -> Vec<(u32, Vec<u16>)> {
        self.sent.iter().map(|(_, write)| (write.place.number(), words_of(write))).collect()
    }

    /// The places that were asked for, in their order.
    pub(crate) fn places(&self) -> Vec<u32> {
        self.asked.iter().map(|read| read.place.number()).collect()
    }
}

fn since_start(moment: Instant) -> Duration {
    moment.saturating_duration_since(Instant::ZERO)
}

/// The shipped family of this name.
pub(crate) fn shipped(name: &str) -> Arc<Family> {
    Arc::clone(Families::shipped().named(name).unwrap())
}

/// Any way to answer.
pub(crate) fn any_reply() -> impl Strategy<Value = Reply> {
    let listed: Vec<u16> = Families::shipped().codes().all().collect();
    let came = proptest::collection::vec(any::<u8>(), 0..6);
    prop_oneof![
        4 => any::<u16>().prop_map(Ok),
        4 => (0u16..10).prop_map(Ok),
        4 => proptest::sample::select(listed).prop_map(Ok),
        6 => any::<u8>().prop_map(refuses),
        6 => (0u8..12).prop_map(refuses),
        3 => (proptest::sample::select(vec![Cause::NoAnswer, Cause::BadAnswer]), came)
            .prop_map(|(cause, raw)| Err(Fault { cause, raw, was_sent: true })),
        1 => proptest::sample::select(vec![Cause::Port, Cause::Other]).prop_map(fails),
    ]
}

/// Whatever becomes of a write.
pub(crate) fn any_confirmation() -> impl Strategy<Value = Result<(), Fault>> {
    (any_reply(), any::<bool>())
        .prop_map(|(reply, was_sent)| reply.map(drop).map_err(|fault| Fault { was_sent, ..fault }))
}

/// Any shipped family.
pub(crate) fn any_family() -> impl Strategy<Value = Arc<Family>> {
    proptest::sample::select(Families::shipped().iter().cloned().collect::<Vec<_>>())
}
