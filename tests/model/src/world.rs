//! The whole of one moment: what is really known of the line, the units, what is under way, the program and the time.
//!
//! Only time-outs and the rules' own times take time; what is sent and what arrives take none.

use std::hash::{Hash, Hasher};

use drivebus_rtu::{Cut, Duration, Instant, Known, Master, Opened, OwnEcho, Patience, SerialFormat, UnitAddress};

use crate::fingerprint::{self, offset};
use crate::frames::{Asker, Coming, Content, Kind};
use crate::program::Program;
use crate::scenario::{AGAIN, Adapter, Budget, Damage, Echoing, LONGEST, MUTE, PATIENCE, STRANGERS_COME_FOR, Scenario};

/// When the search begins: far from the clock's own start, which would be a special moment.
pub const START: Instant = Instant::from_nanos(1_000_000_000_000);

/// A line that nobody else asked anything on.
const NOBODY_ELSE: Opened = Opened::new().gapless(true);

/// The steps of time that matter: half a time-out.
pub const TICK: Duration = Duration::from_millis(250);

/// A unit and what it has answered.
#[derive(Debug, Clone)]
pub struct Unit {
    /// What it makes of an echo.
    pub echoing: Echoing,
    /// Answers that have not arrived, in the order in which they were given.
    pub coming: Vec<Coming>,
    /// Whether it has returned an echo, and not been silent on many since: then nothing but an echo ends a doubt about it.
    pub echoed: bool,
    /// Echoes that were left open since the last proof.
    pub silent_echoes: u8,
    /// When the last of those was given up.
    pub echo_open: Option<Instant>,
    /// When the last request to it was given up.
    pub gave_up: Option<Instant>,
    /// The same, or when something was taken for an answer of it while it owed another.
    pub touched: Option<Instant>,
}

/// What went wrong, once it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wrong {
    /// An answer was attributed to a request that it was not given to.
    Misattributed,
    /// A write was reported as done, as refused or as not done, and was not.
    NotDone,
    /// A write is said not to have gone out, and it did.
    Denied,
    /// What moves was sent twice for one call.
    SentTwice,
    /// What was to end a doubt has not ended it.
    Unended,
}

/// What the last step showed, for a person to read. No part of the state.
#[derive(Debug, Clone, Default)]
pub struct Told {
    /// The request that was sent.
    pub sent: Option<Kind>,
    /// The answer that arrived.
    pub came: Option<Coming>,
    /// What was made of it.
    pub outcome: Option<&'static str>,
    /// What became of the call, if it is over.
    pub call: Option<&'static str>,
}

/// All of it.
#[derive(Debug, Clone)]
pub struct State {
    /// Now.
    pub now: Instant,
    /// What is known of the line: with the call that is under way the code under test.
    pub known: Box<Known<2, 4>>,
    /// The units.
    pub units: Vec<Unit>,
    /// Whether the order of what comes is open.
    pub overtaking: bool,
    /// What is asked.
    pub program: Program,
    /// What may still happen.
    pub left: Budget,
    /// Whether the registers have changed.
    pub changed: bool,
    /// When the line was opened, if others may have used it before.
    pub opened: Option<Instant>,
    /// What went wrong.
    pub wrong: Option<Wrong>,
    /// How many requests were sent. No part of the state.
    pub requests: u16,
    /// The last step. No part of the state.
    pub told: Told,
}

/// The address of unit `index`: 1 and 2.
pub fn address(index: usize) -> UnitAddress {
    u8::try_from(index + 1).ok().and_then(|raw| UnitAddress::new(raw).ok()).unwrap_or(UnitAddress::MIN)
}

impl State {
    /// The line before anything was asked, with answers to `strangers` under way.
    pub fn new(scenario: &Scenario, left: Budget, strangers: &[Content]) -> Self {
        let unit = |echoing: &Echoing| Unit {
            echoing: *echoing,
            coming: Vec::new(),
            echoed: false,
            silent_echoes: 0,
            echo_open: None,
            gave_up: None,
            touched: None,
        };
        let echo = if scenario.adapter == Adapter::Known { OwnEcho::Absent } else { OwnEcho::Unknown };
        let mut known = Known::new(SerialFormat::DEFAULT, echo, 1);
        // From here on no silence has to be kept, whatever is opened later.
        known.opened(START, &NOBODY_ELSE);
        if scenario.damage != Damage::Final {
            known.be_patient(Some(Patience::new(Duration::ZERO, Duration::ZERO)));
        }
        let mut state = Self {
            now: START,
            known: Box::new(known),
            overtaking: scenario.overtaking,
            units: scenario.units.iter().map(unit).collect(),
            program: Program { call: None },
            left,
            changed: false,
            opened: None,
            wrong: None,
            requests: 0,
            told: Told::default(),
        };
        if !scenario.strangers.is_empty() {
            state.open(scenario, strangers);
        }
        state
    }

    /// The port is opened; `strangers` is what another program's last questions to unit 1 are answered with.
    pub fn open(&mut self, scenario: &Scenario, strangers: &[Content]) {
        let now = self.now;
        if let Some(call) = &mut self.program.call {
            call.conversation.cut_short(now, &mut self.known, Cut::Lost);
        }
        if scenario.strangers.is_empty() {
            self.known.opened(now, &NOBODY_ELSE);
            return;
        }
        self.known.opened(now, &Opened::new());
        self.opened = Some(now);
        let coming = strangers.iter().map(|&content| Coming {
            asker: Asker::Stranger,
            content,
            place: 0,
            is_other_length: false,
            given_up: None,
            damaged: None,
        });
        self.units[0].coming.extend(coming);
    }

    /// What is owed, as far as it is known.
    pub fn master(&self) -> &Master {
        self.known.master()
    }

    /// Request `number` has ended: what still comes of it is late.
    pub fn ended(&mut self, number: u16) {
        let now = self.now;
        for coming in self.units.iter_mut().flat_map(|unit| &mut unit.coming) {
            if coming.asker == Asker::Request(number) {
                coming.given_up.get_or_insert(now);
            }
        }
    }

    /// `unit` was asked `kind`, and owes the answer.
    pub fn left_open(&mut self, unit: usize, kind: Kind) {
        let unit = &mut self.units[unit];
        if let Kind::Echo(_) = kind {
            unit.echo_open = Some(self.now);
            unit.silent_echoes += 1;
            unit.echoed &= unit.silent_echoes < MUTE;
        } else {
            // An open echo can be mistaken for nothing but an echo, and prolongs nothing.
            (unit.gave_up, unit.touched) = (Some(self.now), Some(self.now));
        }
    }

    /// Time passes: what is assumed to come by then or never does not come any more.
    pub fn wait(&mut self, scenario: &Scenario, until: Instant) {
        self.now = self.now.max(until);
        for index in 0..self.units.len() {
            let (now, state) = (self.now, &*self);
            let still = |coming: &Coming| state.comes_until(scenario, index, coming).is_none_or(|end| now < end);
            let coming = state.units[index].coming.iter().copied().filter(still).collect();
            self.units[index].coming = coming;
            let unit = &mut self.units[index];
            unit.gave_up = unit.gave_up.filter(|&at| at + LONGEST > now);
            unit.touched = unit.touched.filter(|&at| at + PATIENCE > now);
            unit.echo_open = unit.echo_open.filter(|&at| at + PATIENCE > now);
        }
        self.opened = self.opened.filter(|&opened| opened + STRANGERS_COME_FOR > self.now);
    }

    /// Until when `coming` can arrive; `None`: for as long as it takes.
    pub fn comes_until(&self, scenario: &Scenario, unit: usize, coming: &Coming) -> Option<Instant> {
        let again = coming.damaged.map(|damaged| damaged + AGAIN);
        let once = match coming.asker {
            Asker::Stranger => self.opened.map(|opened| opened + STRANGERS_COME_FOR),
            Asker::Request(_) => {
                coming.given_up.and_then(|given_up| Some(given_up + scenario.may_come_for(self.units[unit].echoed)?))
            }
        };
        [once, again].into_iter().flatten().min()
    }

    /// The next moment at which something is over, by the assumptions or by the rules.
    pub fn next_end(&self, scenario: &Scenario) -> Option<Instant> {
        let mut ends = Vec::new();
        for (index, unit) in self.units.iter().enumerate() {
            ends.extend(unit.coming.iter().filter_map(|coming| self.comes_until(scenario, index, coming)));
            ends.extend(unit.touched.map(|at| at + PATIENCE));
            ends.extend(unit.gave_up.map(|at| at + LONGEST));
        }
        ends.extend(self.opened.map(|opened| opened + STRANGERS_COME_FOR));
        ends.into_iter().filter(|&end| end > self.now).min()
    }

    /// A word that no echo carries that may still come.
    pub fn fresh_word(&self) -> u16 {
        let taken = |word| {
            self.units.iter().flat_map(|unit| &unit.coming).any(|coming| coming.content == Content::Echoed(word))
        };
        (1..=u16::MAX).find(|&word| !taken(word)).unwrap_or_default()
    }

    /// What unit `index` has taken in, answered.
    pub fn hear(&mut self, scenario: &Scenario, index: usize, (kind, place): (Kind, u16), refuses: bool) {
        let refuses = refuses || matches!(kind, Kind::Read(count) if count > scenario.longest);
        self.changed |= kind == Kind::Set && !refuses;
        let unit = &mut self.units[index];
        let content = match (kind, unit.echoing) {
            (Kind::Echo(_), Echoing::Silent) => return,
            (Kind::Echo(_), Echoing::Refuses) => Content::Refused(Kind::Echo(0)),
            (Kind::Echo(word), Echoing::Returns) => Content::Echoed(word),
            (kind, _) if refuses => Content::Refused(kind),
            (Kind::Read(count), _) => Content::Words(count, self.changed),
            (Kind::Watch, _) => Content::Words(1, self.changed),
            (Kind::Input, _) => Content::Input(self.changed),
            (Kind::Run | Kind::Stop | Kind::Set, _) => Content::Done(kind),
        };
        let asker = Asker::Request(self.requests);
        let is_other_length = false;
        unit.coming.push(Coming { asker, content, place, is_other_length, given_up: None, damaged: None });
    }

    /// What unit `index` answered last has `count` words, and not as many as were asked for. `None`: it is no such answer.
    pub fn has_other_length(&mut self, index: usize, count: u16) -> Option<()> {
        let coming = self.units[index].coming.last_mut()?;
        let Content::Words(asked, changed) = coming.content else { return None };
        (coming.content, coming.is_other_length) = (Content::Words(count, changed), true);
        (asked != count).then_some(())
    }

    /// Takes the answer at `place` of what comes of unit `index` off the line, and with it what cannot come any more.
    pub fn arrives(&mut self, index: usize, place: usize) -> Coming {
        let coming = &mut self.units[index].coming;
        let came = coming.remove(place);
        if self.overtaking {
            // Another program's question was answered in order, or never will be.
            let own = came.asker != Asker::Stranger;
            coming.retain(|other| !own || other.asker != Asker::Stranger);
        } else {
            coming.drain(..place);
        }
        came
    }

    /// All of `coming` that can make a difference from now on.
    pub fn signature(&self, coming: &Coming) -> (Content, u16, Option<i64>, Option<i64>, [bool; 4]) {
        let given_up = coming.given_up.map(|at| offset(self.now, at));
        let damaged = coming.damaged.map(|at| offset(self.now, at));
        let in_flight = self.program.in_flight().is_some_and(|flight| coming.is_since(flight.number));
        let current = self.program.call.as_ref().is_some_and(|call| coming.is_since(call.first));
        let is_strangers = coming.asker == Asker::Stranger;
        (coming.content, coming.place, given_up, damaged, [is_strangers, coming.is_other_length, in_flight, current])
    }

    /// Fields of the code under test that it only asks whether there is something in, or compares with moments that are over
    /// by then in any case.
    ///
    /// No silence is kept here, so that it does not matter when the line was `busy`, nor when the frame was `heard` that may
    /// come twice without one; a call is never told a moment before its `latest`; and when a unit `answered`, matters to other
    /// units.
    fn timeless(&self) -> &'static [&'static str] {
        if self.units.len() > 1 { &["busy", "heard", "latest"] } else { &["busy", "heard", "latest", "answered"] }
    }

    /// Whether the adapter of the line sends requests back.
    pub fn is_sent_back(scenario: &Scenario) -> bool {
        scenario.adapter == Adapter::Echoes
    }
}

impl Hash for State {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        let now = self.now;
        let at = |moment: Option<Instant>| moment.map(|moment| offset(now, moment));
        fingerprint::of(now, &self.known, self.timeless()).hash(hasher);
        self.program.hash_at(now, self.timeless(), hasher);
        for unit in &self.units {
            (unit.echoing, unit.echoed, unit.silent_echoes, at(unit.echo_open)).hash(hasher);
            (at(unit.gave_up), at(unit.touched)).hash(hasher);
            let mut coming: Vec<_> = unit.coming.iter().map(|coming| self.signature(coming)).collect();
            if self.overtaking {
                coming.sort_unstable();
            }
            coming.hash(hasher);
        }
        (self.left, self.changed, at(self.opened), self.wrong).hash(hasher);
    }
}

impl PartialEq for State {
    /// As the search tells states apart: by all that can make a difference from now on.
    fn eq(&self, other: &Self) -> bool {
        let number = |state: &Self| {
            let mut hasher = std::collections::hash_map::DefaultHasher::new();
            state.hash(&mut hasher);
            hasher.finish()
        };
        number(self) == number(other)
    }
}
