//! The last wills of the programs of a port: who leaves them, who watches them, and who carries them out.
//!
//! A program that runs a motor leaves what halts it ([`LastWill`]), and takes that back when the motor was halted. Whoever
//! has the port finds what a program left that is gone without a word: at once, or when it opens the port after that one.
//! Until the unit took a halt, requests of others to it wait or are refused: each would keep the unit from acting by itself.
//!
//! Who has left nothing, and has nobody beside it who has, pays nothing for it: one thread looks after wills while there
//! are any, and a request looks at one flag.

mod as_named;
mod halting;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use drivebus_rtu::{Answer, Instant, Request, UnitAddress};

use crate::bus::wills::halting::{AT_ONCE, Halting, Next};
use crate::error::{CallError, Failure};
use crate::line::Opener;
use crate::options::{BusOptions, CallOptions, Halter, LastWill};
use crate::ports::key::PortKey;
use crate::share::guest::readable;
use crate::share::message::Characters;
use crate::share::nanos;
use crate::share::place::Place;
pub(super) use crate::share::will::is_any;
use crate::share::will::{Found, Orphan, Paper, Will, find};
use crate::system::clock::monotonic;
use crate::system::process::own_name;

/// How often the wills of living programs are looked at.
const LOOKS: Duration = Duration::from_millis(50);
/// How often this for a while, where a program may just have ended: the system takes back what it had one after the other.
const LOOKS_AT_ONCE: Duration = Duration::from_millis(5);
const FOR_A_WHILE: Duration = Duration::from_millis(300);
/// How often a program says in its wills that it is alive.
const SAYS: Duration = Duration::from_secs(1);
/// A will that is found when the port is opened is carried out if its program was alive so long ago at most. After that the
/// motor may be somebody else's.
const FRESH: Duration = Duration::from_secs(300);
/// How long an answer to a halt is waited for at most: the next one is not to come late.
const LONGEST_ANSWER: Duration = Duration::from_millis(500);
/// How long the end of a bus waits for a halt that is being given.
const LET_OUT: Duration = Duration::from_secs(1);
/// Notes that are kept.
const NOTES: usize = 16;

/// The bus whose wills these are, and by which others are carried out.
pub(super) trait CarriesOut: fmt::Debug + Send + Sync {
    /// Whether it was closed.
    fn is_shut(&self) -> bool;

    /// Whether the port is another program's.
    fn is_guest(&self) -> bool;

    /// Where the program looks for wills that has the port, if it is another one.
    fn place(&self) -> Option<Place>;

    /// Tells that program of a will that was left. False where that is not known to have reached it: then it is found all
    /// the same when the connection ends, or the port is opened.
    fn tell_of_wills(&self) -> bool;

    /// Whether the unit says that it is another one than the will means, which has this question for it and such answers of
    /// others.
    fn is_another(&self, unit: UnitAddress, look: &(Vec<u8>, Vec<Vec<u8>>)) -> bool;

    /// Halts the unit in one of the ways of `will`.
    fn halt(&self, unit: UnitAddress, will: &Will, way: usize) -> Result<(), Failure>;

    /// Asks the unit once its turn comes, and gives the answer to `take`.
    fn ask(
        &self,
        unit: UnitAddress,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<(), Box<CallError>>;

    /// Now, on the line's clock.
    fn now(&self) -> Instant;

    /// Waits on the line's clock.
    fn sleep(&self, time: Duration);

    /// How often the port was opened again.
    fn reconnects(&self) -> u64;
}

/// The wills that one bus leaves, and those that it carries out.
#[derive(Debug)]
pub(super) struct Wills {
    key: Option<PortKey>,
    group: Option<u32>,
    characters: Characters,
    timeout: Duration,
    /// Who knows families of units.
    halter: Option<&'static dyn Halter>,
    bus: OnceLock<Weak<dyn CarriesOut>>,
    /// Whether there is anybody who is being halted.
    halts: AtomicBool,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    own: BTreeMap<u64, Left>,
    tokens: u64,
    halting: BTreeMap<UnitAddress, Halted>,
    /// How many halts that are done are being told of.
    telling: usize,
    /// How many wills of programs that live were seen at last.
    living: usize,
    /// Until when it is looked often.
    hurries: Option<Instant>,
    /// Whether a will was left of which the program that has the port was not told.
    untold: bool,
    is_attended: bool,
    /// Where wills of the port that this bus opened last are found.
    places: Vec<Place>,
    notes: Vec<String>,
}

/// A will that was left.
struct Left {
    will: Will,
    /// `None`: nobody but this program can find it.
    paper: Option<Paper>,
    then: Option<Then>,
}

/// Hears whether a unit took its halt, and then, where somebody looked, what shows of that; not called where another program
/// halts it.
pub(super) type Then = Box<dyn FnMut(bool, Option<&str>) + Send>;

/// Who was told that a unit took its halt, and hears what shows of that.
#[derive(Default)]
struct Told {
    note: Option<String>,
    then: Vec<Then>,
}

/// A unit that is being halted, for whom.
#[derive(Debug)]
struct Halted {
    course: Halting,
    /// The last of them is carried out; it stands for all.
    wills: Vec<Left>,
    is_attended: bool,
}

impl Wills {
    pub(super) fn new(key: Option<PortKey>, options: &BusOptions) -> Self {
        Self {
            key,
            group: options.group,
            characters: Characters::of(&options.format),
            timeout: options.timeout,
            halter: options.halter,
            bus: OnceLock::new(),
            halts: AtomicBool::new(false),
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    /// `open`, which finds the wills of programs that are gone before anybody uses the line.
    pub(super) fn finding(self: &Arc<Self>, mut open: Opener) -> Opener {
        let wills = Arc::clone(self);
        Box::new(move || {
            let line = open()?;
            let name = wills.key.as_ref().and_then(|key| key.name_of(line.connected_to()));
            wills.lock().places = Place::all(name.into_iter().collect(), wills.group).unwrap_or_default();
            wills.look(Some(FRESH));
            Ok(line)
        })
    }

    /// The bus is made: what was found by now is carried out.
    pub(super) fn serves(self: &Arc<Self>, bus: &Arc<impl CarriesOut + 'static>) {
        let bus: Weak<dyn CarriesOut> = Arc::downgrade(bus) as _;
        self.bus.get_or_init(|| bus);
        let mut state = self.lock();
        self.begin(&mut state);
        self.attend(&mut state);
    }

    /// A program may have ended, or left a will.
    pub(super) fn look_soon(self: &Arc<Self>) {
        let has_any = self.look(None);
        let mut state = self.lock();
        if has_any {
            state.hurries = Some(monotonic() + FOR_A_WHILE);
            self.attend(&mut state);
            self.changed.notify_all();
        }
    }

    /// Takes up the wills whose programs are gone: where it says so, those that were alive not longer ago. Whether there
    /// are others.
    fn look(self: &Arc<Self>, fresh: Option<Duration>) -> bool {
        let places = self.lock().places.clone();
        let found: Vec<Found> = places.iter().filter_map(|place| find(place).ok()).collect();
        if found.is_empty() {
            return false;
        }
        let living = found.iter().map(|found| found.living).sum();
        let orphans = found.into_iter().flat_map(|found| found.orphans);
        let mut state = self.lock();
        state.living = living;
        let now = monotonic();
        for orphan in orphans {
            self.take_up(&mut state, orphan, fresh, now);
        }
        self.begin(&mut state);
        self.attend(&mut state);
        living > 0
    }

    fn take_up(&self, state: &mut State, orphan: Orphan, fresh: Option<Duration>, now: Instant) {
        let Orphan { paper, will, alive } = orphan;
        let Some(will) = will else {
            state.note("a program of another version of drivebus is gone, and left a will that this one cannot read");
            return;
        };
        let will = Will { program: readable(&will.program), ..will };
        let who = format!("{} (process {}), which ran unit {}, is gone", will.program, will.process, will.unit);
        if will.characters != self.characters {
            state.note(&format!("{who}; it is not halted for it, since this port is open at other characters"));
            return;
        }
        let age = now.as_nanos().checked_sub(alive.as_nanos()).map(Duration::from_nanos);
        if fresh.is_some_and(|fresh| age.is_none_or(|age| age > fresh)) {
            state.note(&format!("{who} for long; what it left to halt the unit was not sent: `stop` halts it"));
            return paper.remove();
        }
        if fresh.is_some() && self.key.as_ref().is_none_or(|key| key.made() != will.port) {
            state.note(&format!("{who}; it is not halted for it, since this port was made anew: `stop` halts it"));
            return paper.remove();
        }
        self.enlist(state, Left { will, paper: Some(paper), then: None });
    }

    /// The unit of `left` is to be halted.
    fn enlist(&self, state: &mut State, left: Left) {
        let will = &left.will;
        let by_family = self.halter.is_some() && will.named.is_some();
        let course = Halting::new(will.ways.len(), will.look.is_some(), Duration::from_nanos(will.silence));
        let course = course.by_family(by_family);
        let halted = state.halting.entry(UnitAddress::by_name(will.unit)).or_insert_with(|| Halted {
            course,
            wills: Vec::new(),
            is_attended: false,
        });
        halted.wills.push(left);
        halted.wills.sort_by_key(|left| left.will.left);
        self.halts.store(true, Ordering::Release);
    }

    /// Gives each unit that is to be halted a thread that does it.
    fn begin(self: &Arc<Self>, state: &mut State) {
        let Some(bus) = self.bus.get() else { return };
        for (&unit, halted) in &mut state.halting {
            if std::mem::replace(&mut halted.is_attended, true) {
                continue;
            }
            let (wills, bus) = (Arc::clone(self), Weak::clone(bus));
            let made = thread::Builder::new()
                .name(format!("drivebus-halts-{unit}"))
                .spawn(move || wills.carry_out(&bus, unit));
            // Without one it is kept from others, so that it acts by itself; the next look tries again.
            halted.is_attended = made.is_ok();
        }
    }

    /// Has the thread that looks after wills, while there are any.
    fn attend(self: &Arc<Self>, state: &mut State) {
        let Some(bus) = self.bus.get() else { return };
        if state.is_attended || (state.own.is_empty() && state.living == 0) {
            return;
        }
        let (wills, bus) = (Arc::clone(self), Weak::clone(bus));
        let made = thread::Builder::new().name("drivebus-wills".to_owned()).spawn(move || wills.look_after(&bus));
        state.is_attended = made.is_ok();
    }

    /// Says of the wills of this program that it lives, and looks after those of others where this one has the port.
    fn look_after(self: &Arc<Self>, bus: &Weak<dyn CarriesOut>) {
        let mut said = monotonic();
        loop {
            let Some(shared) = bus.upgrade().filter(|shared| !shared.is_shut()) else { return };
            let is_guest = shared.is_guest();
            let now = monotonic();
            let mut state = self.lock();
            let says = now >= said + SAYS;
            if says {
                said = now;
                state.own.values().filter_map(|left| left.paper.as_ref()).for_each(|paper| paper.is_alive(now));
            }
            let tells = is_guest && (std::mem::take(&mut state.untold) || says && !state.own.is_empty());
            let looks = !is_guest && state.living > 0;
            drop(state);
            if tells && !shared.tell_of_wills() {
                self.lock().untold = true;
            }
            if looks {
                self.look(None);
            }
            drop(shared);
            let mut state = self.lock();
            if state.own.is_empty() && (is_guest || state.living == 0) {
                state.is_attended = false;
                return;
            }
            let hurries = state.hurries.is_some_and(|until| now < until);
            let pause = match (looks, hurries) {
                (true, true) => LOOKS_AT_ONCE,
                (true, false) => LOOKS,
                (false, _) => SAYS,
            };
            drop(self.changed.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// Where whoever has the port looks: the program through which this bus uses it, or this one.
    fn place(&self) -> Option<Place> {
        let there = self.bus.get().and_then(Weak::upgrade).and_then(|bus| bus.place());
        there.or_else(|| self.lock().places.iter().find(|place| place.is_own(self.group)).cloned())
    }

    /// Leaves `last` where the one who has the port finds it. `None` where nobody could.
    pub(super) fn leave(self: &Arc<Self>, last: LastWill) -> Option<u64> {
        let will = self.written(last, own_name());
        let paper = Some(self.on_paper(&will)?);
        Some(self.keep(Left { will, paper, then: None }))
    }

    /// As [`leave`](Self::leave), for a client of this program: what is left can be [carried out](Self::carry_out_now) here as
    /// well, and `then` hears whether the unit took it. So it is also kept where the port is of no kind that programs share.
    #[cfg(feature = "tcp")]
    pub(super) fn leave_for(self: &Arc<Self>, client: String, last: LastWill, then: Then) -> Option<u64> {
        let will = self.written(last, client);
        let paper = self.on_paper(&will);
        // Where another program has the port, it has to be found there.
        let stands = paper.is_some() || self.key.is_none();
        stands.then(|| self.keep(Left { will, paper, then: Some(then) }))
    }

    fn written(&self, last: LastWill, program: String) -> Will {
        Will {
            unit: last.unit.get(),
            ways: last.ways,
            named: last.named.map(Into::into),
            look: last.look,
            timeout: nanos(self.timeout.min(LONGEST_ANSWER)),
            silence: nanos(last.silence),
            port: self.key.as_ref().map(PortKey::made).unwrap_or_default(),
            left: monotonic().as_nanos(),
            program,
            process: std::process::id(),
            characters: self.characters,
        }
    }

    fn on_paper(&self, will: &Will) -> Option<Paper> {
        self.key.as_ref()?;
        let paper = Paper::leave(&self.place()?, will, monotonic());
        if let Err(error) = &paper {
            self.lock().note(&format!("nobody would halt unit {} for this program: {error}", will.unit));
        }
        paper.ok()
    }

    fn keep(self: &Arc<Self>, left: Left) -> u64 {
        let mut state = self.lock();
        state.tokens += 1;
        let token = state.tokens;
        state.own.insert(token, left);
        state.untold = true;
        self.attend(&mut state);
        self.changed.notify_all();
        token
    }

    /// The will that was left under this number is not carried out.
    pub(super) fn withdraw(&self, token: u64) {
        let left = self.lock().own.remove(&token);
        if let Some(paper) = left.and_then(|left| left.paper) {
            paper.remove();
        }
    }

    /// Carries out now what was left under this number.
    #[cfg(feature = "tcp")]
    pub(super) fn carry_out_now(self: &Arc<Self>, token: u64) {
        let mut state = self.lock();
        if let Some(left) = state.own.remove(&token) {
            self.enlist(&mut state, left);
            self.begin(&mut state);
        }
    }

    /// Whoever has the port next carries out what is left here: this bus is closed.
    pub(super) fn let_go(&self) {
        let own = std::mem::take(&mut self.lock().own);
        drop(own);
        self.hand_over();
    }

    /// Whoever has the port next halts who is being halted.
    pub(super) fn hand_over(&self) {
        let mut state = self.lock();
        let halting = std::mem::take(&mut state.halting);
        self.halts.store(false, Ordering::Release);
        drop(state);
        drop(halting);
        self.changed.notify_all();
    }

    /// Waits for the halts that are being given, a while.
    pub(super) fn let_out(&self) {
        let end = monotonic() + LET_OUT;
        let mut state = self.lock();
        while state.telling > 0 || state.halting.values().any(|halted| halted.is_attended && !halted.course.is_late()) {
            let left = end.saturating_duration_since(monotonic());
            if left.is_zero() {
                return;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Why `unit` may not be asked now, or nobody by a broadcast.
    pub(super) fn keeps_from(&self, unit: Option<UnitAddress>) -> Option<Failure> {
        if !self.halts.load(Ordering::Acquire) {
            return None;
        }
        let (state, now) = (self.lock(), monotonic());
        let mut kept = state.halting.iter().filter(|(_, halted)| halted.course.is_kept_from_others(now));
        let (unit, halted) = kept.find(|(halted, _)| unit.is_none_or(|unit| unit == **halted))?;
        let Left { will, .. } = halted.wills.last()?;
        Some(Failure::BeingStopped { unit: unit.get(), program: will.program.clone(), process: will.process })
    }

    pub(super) fn notes(&self) -> Vec<String> {
        self.lock().notes.clone()
    }

    /// Halts `unit` for a program that is gone, until it took that.
    fn carry_out(&self, bus: &Weak<dyn CarriesOut>, unit: UnitAddress) {
        loop {
            let Some(shared) = bus.upgrade().filter(|shared| !shared.is_shut()) else { return };
            if shared.is_guest() {
                // The port is another program's by now: that one does it.
                self.give_up(unit);
                shared.tell_of_wills();
                return;
            }
            let mut state = self.lock();
            let Some(halted) = state.halting.get_mut(&unit) else { return };
            let next = halted.course.next(monotonic());
            let Some(Left { will, .. }) = halted.wills.last() else { return };
            let will = will.clone();
            drop(state);
            let mut took = None;
            match next {
                Next::Look => {
                    let is_another = will.look.as_ref().is_some_and(|look| shared.is_another(unit, look));
                    self.of(unit, |halted| halted.course.looked(is_another));
                    took = is_another.then_some(false);
                }
                Next::Halt(way) => {
                    let outcome = shared.halt(unit, &will, way);
                    let is_lost = matches!(outcome, Err(Failure::Port(_)));
                    self.of(unit, |halted| halted.course.halted(monotonic(), outcome.is_ok(), is_lost));
                    took = outcome.is_ok().then_some(true);
                }
                Next::HaltAsNamed(within) => {
                    drop(shared);
                    if self.halt_as_named(bus, unit, &will, within) {
                        return;
                    }
                }
                Next::Wait(until) => {
                    drop(shared);
                    thread::sleep(until.saturating_duration_since(monotonic()).min(LOOKS));
                }
                Next::Over => took = Some(false),
            }
            if let Some(took) = took {
                self.is_done(unit, &will, took);
                return;
            }
        }
    }

    fn of(&self, unit: UnitAddress, change: impl FnOnce(&mut Halted)) {
        let mut state = self.lock();
        let Some(halted) = state.halting.get_mut(&unit) else { return };
        let was_late = halted.course.is_late();
        change(halted);
        if halted.course.is_late() && !was_late {
            let who = halted.wills.last().map(|left| format!("{} (process {})", left.will.program, left.will.process));
            state.note(&format!(
                "unit {unit} took no halt within {} s; {}, which ran it, is gone. It is still told to halt now and then: \
                 its motor may run",
                AT_ONCE.as_secs(),
                who.unwrap_or_default()
            ));
        }
        self.changed.notify_all();
    }

    /// Whether `unit` is still being halted by this bus.
    fn halts(&self, unit: UnitAddress) -> bool {
        self.lock().halting.contains_key(&unit)
    }

    fn is_done(&self, unit: UnitAddress, will: &Will, took: bool) -> Told {
        let mut state = self.lock();
        let halted = state.halting.remove(&unit);
        self.halts.store(!state.halting.is_empty(), Ordering::Release);
        let wills = halted.map(|halted| halted.wills).unwrap_or_default();
        let mut told = Told::default();
        if wills.iter().any(|left| left.then.is_none()) {
            let who = format!("{} (process {}), which ran it, is gone", will.program, will.process);
            let note = if took {
                format!("unit {unit} was told to halt, and took it: {who}")
            } else {
                format!("unit {unit} was not told to halt: {who}, and another drive answers at its address now")
            };
            state.note(&note);
            told.note = Some(note);
        }
        state.telling += 1;
        drop(state);
        for Left { paper, then, .. } in wills {
            if let Some(paper) = paper {
                paper.remove();
            }
            if let Some(mut then) = then {
                then(took, None);
                told.then.push(then);
            }
        }
        self.lock().telling -= 1;
        self.changed.notify_all();
        told
    }

    /// What the unit shows of the halt that it took, for those who were told of that.
    fn shows(&self, told: Told, shown: &str) {
        if let Some(note) = told.note {
            self.lock().note_more(&note, &format!("{note}. {shown}"));
        }
        for mut then in told.then {
            then(true, Some(shown));
        }
    }

    /// Leaves the halt of `unit` to who has the port.
    fn give_up(&self, unit: UnitAddress) {
        let mut state = self.lock();
        let halted = state.halting.remove(&unit);
        self.halts.store(!state.halting.is_empty(), Ordering::Release);
        drop(state);
        drop(halted);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Left {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Left").field("will", &self.will).field("paper", &self.paper).finish_non_exhaustive()
    }
}

impl State {
    fn note(&mut self, text: &str) {
        if !self.notes.iter().any(|note| note == text) {
            self.notes.push(text.to_owned());
            let more = self.notes.len().saturating_sub(NOTES);
            self.notes.drain(..more);
        }
    }

    /// What was told of by `note` is known better.
    fn note_more(&mut self, note: &str, text: &str) {
        match self.notes.iter_mut().find(|known| *known == note) {
            Some(known) => text.clone_into(known),
            None => self.note(text),
        }
    }
}
