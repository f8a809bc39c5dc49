//! What must hold in each run. The numbers are those of the list in `main.rs`.

use std::sync::Arc;

use drivebus_drive::task::{Payload, Read, Write};
use drivebus_drive::{Families, Family, Identification, NotCommanded, NotHalted};
use drivebus_drives::{Entry, Place};
use drivebus_rtu::Instant;

use crate::case::{Call, Case, Stands};
use crate::drives::{Drive, Took, Turns};
use crate::models::{Act, Model};
use crate::world::{Failed, Fault};

/// How a call ended.
#[derive(Debug)]
pub(crate) enum Done {
    Halted(Result<(), NotHalted<Failed>>),
    Commanded(Result<(), NotCommanded<Failed>>),
    /// What it is taken for, if that is enough to command it.
    Identified(Option<Identification>),
}

/// Where the drive is asked for what has to be seen before a start. Worked out once for a case.
#[derive(Debug)]
pub(crate) struct Asks {
    /// What it is.
    identity: Vec<Place>,
    fault: Option<Place>,
    /// Each setting that a start has to see, as it must be, and whether it is for the speed.
    settings: Vec<(Place, u16, bool)>,
    /// Where it says that the bus commands it, by which bits.
    source: Option<(Place, u16, u16)>,
}

impl Asks {
    pub(crate) fn of(case: &Case) -> Self {
        let family = Families::shipped().named(case.named.name()).unwrap();
        let profile = family.profile();
        let signature = family.signature().map(|known| [&known.answers[..], &known.refuses].concat());
        let needs = |name: &str| {
            let mut rows = profile.control().iter().chain(profile.setpoints().values().flat_map(|role| &role.needs));
            case.is_trusted || rows.any(|row| row.code == name && row.verified)
        };
        let settings = case.named.settings().iter().filter(|(name, _, is_speed)| {
            needs(name) && (!is_speed || matches!(case.call, Call::Run { hz: Some(_), .. }))
        });
        let place = |name: &str| profile.find(name).ok().and_then(Entry::place);
        let source = match case.named.name() {
            "gd350" | "gd20" => place("status_word_2").map(|at| (at, 0x60, 0x40)),
            "vfd500" if case.is_trusted => place("status_word_2").map(|at| (at, 0x03, 0x02)),
            "ms300" => place("status_word_1").map(|at| (at, 0x400, 0x400)),
            _ => None,
        };
        Self {
            identity: family.code_place().into_iter().chain(signature.unwrap_or_default()).collect(),
            fault: profile.role("fault").and_then(Entry::place),
            settings: settings.filter_map(|&(name, word, is_speed)| Some((place(name)?, word, is_speed))).collect(),
            source,
        }
    }
}

/// What was seen of one run, and what is wrong with it.
#[derive(Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is one thing that was seen")]
pub(crate) struct Judge {
    case: Case,
    asks: Arc<Asks>,
    /// How often the unit had been told to halt when the call was decided on.
    decided: Option<u64>,
    is_link_good: bool,
    /// Whether the unit was asked what it is since the port was opened, and whether it said anything.
    is_asked: bool,
    is_heard: bool,
    /// What the motor did when its state was looked at last.
    state: Option<Turns>,
    /// The same when anything was read last that shows it, how it was told to run, and which drive that was.
    seen: Option<(Turns, Option<bool>, Model)>,
    fault: Option<u16>,
    /// How the settings were read last.
    set: Vec<Option<u16>>,
    is_by_bus: bool,
    sent: Vec<(Place, Vec<u16>)>,
    /// Whether a word of this call let a motor run, halted one, or reset one.
    started: bool,
    halted: bool,
    /// Whether it said of one that it took it, and did not.
    lied: bool,
    /// Or that it has no such word, and has.
    denied: bool,
    pub(crate) wrong: Option<String>,
}

impl Judge {
    pub(crate) fn new(case: Case, asks: &Arc<Asks>) -> Self {
        Self {
            case,
            asks: Arc::clone(asks),
            decided: None,
            is_link_good: false,
            is_asked: false,
            is_heard: false,
            state: None,
            seen: None,
            fault: None,
            set: vec![None; asks.settings.len()],
            is_by_bus: false,
            sent: Vec::new(),
            started: false,
            halted: false,
            lied: false,
            denied: false,
            wrong: None,
        }
    }

    fn must(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.wrong.is_none() {
            self.wrong = Some(what());
        }
    }

    pub(crate) fn opened(&mut self, by_another: bool) {
        (self.is_asked, self.is_heard) = (false, false);
        // It is told of the one that is there.
        self.started &= !by_another;
    }

    pub(crate) fn decided(&mut self, halts: u64) {
        self.decided.get_or_insert(halts);
    }

    pub(crate) fn linked(&mut self, good: u32) {
        self.is_link_good = good >= 9;
    }

    pub(crate) fn asked(&mut self, place: Place) {
        self.is_asked |= self.asks.identity.contains(&place);
    }

    pub(crate) fn spoke(&mut self) {
        self.is_heard = true;
    }

    /// It said that it has no such word, and has.
    pub(crate) fn denied(&mut self) {
        self.denied = true;
    }

    /// The `drive` answered `words`.
    pub(crate) fn read(&mut self, read: &Read, words: &[u16], drive: &Drive, now: Instant) {
        let at = |place: Place| {
            let is_there = place.table == read.place.table && place.address >= read.place.address;
            if is_there { words.get(usize::from(place.address - read.place.address)).copied() } else { None }
        };
        let is_look = read.is_stamped && drive.tells_state_at(read.place, read.count);
        if is_look {
            self.state = Some(drive.turns(now));
        }
        if is_look || drive.tells_frequency_at(read.place) || self.case.named != drive.model {
            self.seen = Some((drive.turns(now), drive.runs, drive.model));
        }
        if let Some(word) = self.asks.fault.and_then(at) {
            self.fault = Some(word);
        }
        for (known, (place, ..)) in self.set.iter_mut().zip(&self.asks.settings) {
            *known = at(*place).or(*known);
        }
        if let Some((place, mask, bus)) = self.asks.source
            && let Some(word) = at(place)
        {
            self.is_by_bus = word & mask == bus;
        }
    }

    /// Whether the last look showed a fault; `None` where there was none.
    fn is_tripped(&self) -> Option<bool> {
        let by_number = !self.case.tells() || matches!(self.case.named, Model::Wj200 | Model::Ms300);
        if by_number { self.fault.map(|fault| fault != 0) } else { self.state.map(|turns| turns == Turns::Tripped) }
    }

    /// A write went out, to the `drive` as it is afterwards, which was told to halt so often.
    pub(crate) fn sent(
        &mut self,
        write: &Write,
        family: Option<&Arc<Family>>,
        (drive, halts): (&Drive, u64),
        (fault, done): (Option<Fault>, &[Took]),
    ) {
        let words = match &write.payload {
            Payload::Word(word) => vec![*word],
            Payload::Words(words) => words.clone(),
        };
        let (call, named) = (self.case.call, self.case.named);
        let harms = |took: &Took| matches!(took, Took::Act(Act::Run(_)) | Took::Parameter);
        let starts = done.iter().any(|took| matches!(took, Took::Act(Act::Run(_))));
        let is_other = drive.model != named;
        if is_other || call.halts() {
            let is_excused = call.halts() && (!self.is_heard || self.denied);
            self.must(!done.iter().any(harms) || is_excused, || {
                format!("6: {write} starts or sets a {:?}", drive.model)
            });
        }
        self.must(!matches!(call, Call::Identify), || format!("2: {write} was sent to find out what it is"));
        self.must(family.is_some(), || format!("nobody says in whose words {write} is"));
        self.lied |= fault == Some(Fault::Ignored);
        self.halted |= done.iter().any(|took| matches!(took, Took::Act(Act::Stop | Act::Coast)));
        if call.halts() {
            return;
        }
        self.started |= starts;
        let is_setpoint = named.takes_setpoint_at(write.place);
        let is_new = !self.sent.contains(&(write.place, words.clone()));
        self.must(is_new || is_setpoint, || format!("2: {write} was sent twice"));
        let decided = self.decided.unwrap_or(0);
        self.must(decided == halts, || format!("3: {write} was sent, and the unit was told to halt since"));
        self.sent.push((write.place, words));
        let is_seen = self.is_tripped().is_some_and(|is_tripped| is_tripped == (call == Call::Reset));
        self.must(is_seen || is_other, || format!("1: {write} was sent, and no look at the state allows it"));
        if call == Call::Reset {
            return;
        }
        let by_bus = self.is_by_bus;
        let is_right = |(known, (_, word, is_speed)): (&Option<u16>, &(_, u16, bool))| {
            *known == Some(*word) || by_bus && !is_speed
        };
        let is_set = self.set.iter().zip(&self.asks.settings).all(is_right);
        let (link, asked) = (self.is_link_good, self.is_asked);
        self.must(is_set, || format!("1: {write} was sent, and nobody saw that the bus commands it"));
        self.must(link, || format!("1: {write} was sent, and the link was not proved"));
        self.must(asked, || format!("1: {write} was sent, and the unit was not asked what it is"));
    }

    /// The call came to this, and the drive stands so.
    pub(crate) fn ended(&mut self, done: &Done, drive: &Drive, halts: u64) {
        let tells = self.case.tells();
        match done {
            Done::Halted(Ok(())) => {
                let is_lie = self.denied && drive.model != self.case.named;
                // Where it tells no state, that it took the word is all there is.
                let is_taken = self.lied || matches!(self.case.stands, Stands::AtKeypad(_));
                let is_believed = !tells && is_taken || is_lie;
                self.must(drive.is_let_go() || is_believed, || format!("4: halted, it says, and {:?}", drive.runs));
                let is_told = self.halted || self.lied || is_lie;
                self.must(is_told, || "4: halted, it says, and was never told".to_owned());
            }
            Done::Halted(Err(error)) => {
                let is_so = error.was_sent || !self.halted;
                self.must(is_so, || format!("5: no halt was sent, it says, and one was: {error}"));
            }
            Done::Commanded(Ok(())) if self.case.call == Call::Reset => {
                self.must(self.is_tripped() == Some(false), || {
                    "4: reset, it says, and it was seen in fault last".to_owned()
                });
            }
            Done::Commanded(Ok(())) => {
                let wanted = if self.case.call.is_reverse() { Turns::Reverse } else { Turns::Forward };
                let (named, is_told) = (self.case.named, self.started || self.lied);
                self.must(is_told, || "4: it runs, it says, and was never told".to_owned());
                let is_halted = self.decided.unwrap_or(0) != halts;
                let comes_round = Some(self.case.call.is_reverse());
                let is_seen = self.seen.is_some_and(|(turns, runs, who)| {
                    who == named && (turns == wanted || runs == comes_round || is_halted)
                });
                let seen = self.seen;
                self.must(is_seen || !tells, || format!("4: it runs, it says, and was seen last: {seen:?}"));
            }
            Done::Commanded(Err(error)) => {
                let is_so = error.why.may_have_acted() || !self.started;
                self.must(is_so, || format!("5: it was not told, it says, and was: {error}"));
            }
            Done::Identified(Some(found)) => {
                let usable = found.usable(Families::shipped(), false).map(|family| family.name());
                let is_one = usable.is_none_or(|name| name == self.case.behind.name() || name == drive.model.name());
                self.must(is_one, || format!("6: it is taken for {usable:?}"));
            }
            Done::Identified(None) => {}
        }
    }
}
