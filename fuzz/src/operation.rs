//! Invariant: whatever comes of its wishes, an operation of the core ends soon after. One that identifies, or looks whether
//! a unit is what it was, writes nothing. A halt writes only what halts in the words of the family that the unit is taken
//! for, tells whether any of it went out, and is proved by nothing but a confirmation and a look that does not show the
//! motor running, or, of a stop, slowing down. A start and a reset write nothing but their own words, the command once at most
//! and only behind a look that shows no reason against it, and never where the unit was told to halt since; they tell whether
//! the motor may turn. What does not fit a wish changes nothing.

mod command;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::{
    Cause, LineError, Link, Misuse, Notice, Outcome, Payload, Read, Seen, Stamped, Step, Task, Wish, Write,
};
use drivebus_drive::{
    Besides, Families, Family, HALTS, Halt, Identity, Looks, NotHalted, Order, Record, SameUnit, Speeds, Taken,
    identify,
};
use drivebus_drives::{Command, Place, State};
use drivebus_rtu::{ExceptionCode, Instant, Meaning, UnitAddress};

use crate::stream::Input;
use command::{Commands, command};

/// Time that a request takes, in milliseconds, by the high half of the byte that says what comes of it. Past the end of the
/// input each takes the first.
const TAKES: [u64; 16] = [100, 0, 1, 5, 10, 20, 20, 20, 50, 100, 100, 200, 500, 1_000, 3_000, 11_000];
/// Wishes behind the end of the input, from where on the unit is silent.
const MOST_IN_SILENCE: usize = 5_000;

/// What the line made of a wish.
#[derive(Debug, Clone)]
struct Fault {
    cause: Cause,
    raw: Vec<u8>,
    was_sent: bool,
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

/// See the file's first lines. The input: the family that the unit is named as, the operation, how long it is sent and
/// looked at; then what comes of each wish.
pub fn operation(data: &[u8]) {
    let mut input = Input::new(data);
    let families = Families::shipped();
    let known: Vec<_> = families.iter().collect();
    let unit = UnitAddress::by_name(1);
    let (named, kind) = (known[usize::from(input.byte()) % known.len()], input.byte());
    let (within, confirm) = (time(&mut input), time(&mut input));
    let identity = Identity::new(0);
    let same = SameUnit::new(unit, named, &identity, kind & 0x80 != 0);
    let mut line = Line::new(input);
    if kind & 0x40 != 0 {
        command(&mut line, same, kind, confirm);
        return;
    }
    match kind & 0x07 {
        0 => drop(line.carry_out(Task::new(async move |line| identify(&line, families, unit).await))),
        1 => drop(line.carry_out(Task::new(async move |line| same.check(&line, families, true, false).await))),
        kind => {
            let command = HALTS[usize::from(kind) % HALTS.len()];
            let order =
                Order { command, besides: if kind >= 5 { Besides::Coast } else { Besides::Nothing }, within, confirm };
            halt(&mut line, named, same, order);
            return;
        }
    }
    assert_eq!(line.written, 0, "it was to ask, and wrote");
}

/// 0 to 1.275 s.
fn time(input: &mut Input<'_>) -> Duration {
    Duration::from_millis(u64::from(input.byte()) * 5)
}

fn halt(line: &mut Line<'_>, named: &Arc<Family>, same: SameUnit, order: Order) {
    let (families, profile, record) = (Families::shipped(), named.profile(), Record::default());
    let (looks, speeds) = (Arc::new(Looks::new(profile, true)), Arc::new(Speeds::new(profile, true)));
    let unit = Taken::as_named(same, &looks, &speeds);
    let (command, is_looked_at) = (order.command, !order.confirm.is_zero());
    let mut halt = Halt::new(unit, &record, order, families, Instant::ZERO);
    let done: Result<(), NotHalted<Fault>> =
        line.carry_out(Task::new(async move |line| halt.carry_out(&line, families).await));
    let sent = record.sent();
    assert!(sent.halts <= sent.halts_begun);
    match done {
        Ok(()) => {
            assert!(line.taken > 0, "nothing was taken");
            let slows_down = command == Command::Stop && line.looks > 1;
            assert!(!(is_looked_at && line.runs) || slows_down, "it is seen to run");
        }
        Err(error) => {
            assert_eq!(error.was_sent, line.went_out, "{error}");
            assert!(!error.to_string().is_empty());
        }
    }
}

/// A line of which nothing can be relied on but that its clock goes on.
struct Line<'i> {
    input: Input<'i>,
    now: Instant,
    connection: u64,
    is_closed: bool,
    /// What a unit says again, once it has said it.
    words: BTreeMap<Place, u16>,
    in_silence: usize,
    written: usize,
    taken: usize,
    went_out: bool,
    looks: usize,
    /// What the last look showed.
    runs: bool,
    /// How often the unit was told to halt, by somebody else.
    halts: u64,
    /// What a start or a reset may write; a halt may write what halts.
    commands: Option<Commands>,
}

impl<'i> Line<'i> {
    fn new(input: Input<'i>) -> Self {
        Self {
            input,
            now: Instant::ZERO,
            connection: 0,
            is_closed: false,
            words: BTreeMap::new(),
            in_silence: 0,
            written: 0,
            taken: 0,
            went_out: false,
            looks: 0,
            runs: false,
            halts: 0,
            commands: None,
        }
    }

    fn carry_out<T>(&mut self, mut task: Task<T, Fault>) -> T {
        let mut outcome = None;
        loop {
            let seen = Seen { now: self.now, connection: self.connection, is_closed: self.is_closed };
            if let Some(wish) = task.pending().cloned() {
                misuse(&mut task, &wish, seen);
            }
            outcome = match task.step(seen, outcome) {
                Ok(Step::Done(done)) => {
                    assert!(matches!(task.step(seen, None), Err(Misuse::Over)));
                    return done;
                }
                Ok(Step::Wish(wish)) => {
                    let family = task.taken_for().map(|(_, family)| Arc::clone(family));
                    Some(self.outcome_of(&wish, family.as_ref()))
                }
                Err(misuse) => unreachable!("{misuse}"),
            };
        }
    }

    fn outcome_of(&mut self, wish: &Wish, family: Option<&Arc<Family>>) -> Outcome<Fault> {
        self.in_silence += usize::from(self.input.is_empty());
        assert!(self.in_silence < MOST_IN_SILENCE, "it goes on without end");
        match wish {
            Wish::Sleep(time) => {
                self.now = self.now + *time;
                Outcome::Slept
            }
            Wish::Tell(notice) => {
                if let Notice::Saw(look) = notice {
                    self.looks += 1;
                    if let Some(commands) = &mut self.commands {
                        commands.is_tripped = look.is_tripped();
                    }
                    self.runs = look.state.is_running() || look.state == State::Unknown && self.runs;
                }
                Outcome::Heard
            }
            Wish::Read(read) => self.read(read).unwrap_or_else(Outcome::Failed),
            Wish::Write(write) => {
                let Some(family) = family else { unreachable!("{write}, and nobody says in whose words") };
                self.write(write, family).map_or_else(Outcome::Failed, |()| Outcome::Written)
            }
            Wish::Link(_) => {
                let good = u32::from(self.input.byte() % 11);
                Outcome::Link(Link { good, asked: 10 })
            }
            Wish::Halts(_) => Outcome::Halts(Some(self.halts)),
            wish => unreachable!("{wish}"),
        }
    }

    fn read(&mut self, read: &Read) -> Result<Outcome<Fault>, Fault> {
        let asked = self.since_start();
        let how = self.fate(false)?;
        let places = (read.place.address..=u16::MAX).take(read.count.into());
        let words = places.map(|address| self.word(how, Place { address, ..read.place })).collect();
        let answered = self.since_start();
        Ok(if read.is_stamped { Outcome::Stamped(Stamped { words, asked, answered }) } else { Outcome::Words(words) })
    }

    fn since_start(&self) -> Duration {
        self.now.saturating_duration_since(Instant::ZERO)
    }

    fn word(&mut self, how: u8, place: Place) -> u16 {
        match how {
            8 | 9 => {
                let word = self.input.word();
                self.words.insert(place, word);
            }
            // The code of some family.
            10 => {
                let families = Families::shipped();
                let codes: Vec<u16> =
                    families.iter().flat_map(|each| each.profile().identifications()).map(|row| row.code).collect();
                let word = codes[usize::from(self.input.byte()) % codes.len()];
                self.words.insert(place, word);
            }
            // A small number, as states and commands are.
            11 => {
                let word = u16::from(self.input.byte());
                self.words.insert(place, word);
            }
            _ => {}
        }
        self.words.get(&place).copied().unwrap_or_default()
    }

    fn write(&mut self, write: &Write, family: &Family) -> Result<(), Fault> {
        if self.commands.is_some() {
            return self.command(write, family);
        }
        self.written += 1;
        let word = match &write.payload {
            Payload::Word(word) => Some(*word),
            Payload::Words(words) => words.first().copied().filter(|_| words.len() == 1),
        };
        let profile = family.profile();
        let mut halts = HALTS.iter().flat_map(|&halt| [profile.command_first(halt), profile.command(halt)]).flatten();
        assert!(
            halts.any(|(place, code)| (place, Some(code)) == (write.place, word)),
            "{write} does not halt {}",
            profile.title()
        );
        assert!(write.is_urgent);
        let came = self.fate(true).map(drop);
        let is_taken = match &came {
            Ok(()) => true,
            Err(fault) => match fault.cause {
                Cause::Refused(code, _) => family.meaning_of(code) == Meaning::Taken,
                _ => false,
            },
        };
        self.taken += usize::from(is_taken);
        self.went_out |= came.as_ref().map_or_else(LineError::was_sent, |()| true);
        came
    }

    /// How the unit answers, or what becomes of a request that it does not.
    fn fate(&mut self, may_stay: bool) -> Result<u8, Fault> {
        let head = self.input.byte();
        self.now = self.now + Duration::from_millis(TAKES[usize::from(head >> 4)]);
        let fault = |cause, was_sent| Err(Fault { cause, raw: Vec::new(), was_sent });
        match head & 0x0F {
            0 => fault(Cause::NoAnswer, true),
            1 => {
                let count = usize::from(self.input.byte() % 9);
                Err(Fault { cause: Cause::BadAnswer, raw: self.input.bytes(count).to_vec(), was_sent: true })
            }
            2 | 3 => {
                let code = ExceptionCode(self.input.byte() % 0x20);
                fault(Cause::Refused(code, code.meaning()), true)
            }
            4 => {
                self.connection += 1;
                fault(Cause::Port, !may_stay)
            }
            5 => {
                self.connection += u64::from(self.input.byte() & 1);
                fault(Cause::Port, true)
            }
            6 if self.input.byte() == 0 => {
                self.is_closed = true;
                fault(Cause::Port, false)
            }
            7 if self.input.byte() == 0 => fault(Cause::Other, false),
            how => Ok(how),
        }
    }
}

/// What does not fit the `wish` is refused, and the task waits for the same still.
fn misuse<T>(task: &mut Task<T, Fault>, wish: &Wish, seen: Seen) {
    let unfit = if matches!(wish, Wish::Sleep(_)) { Outcome::Written } else { Outcome::Slept };
    assert!(matches!(task.step(seen, Some(unfit)), Err(Misuse::Unfit(_))));
    assert!(matches!(task.step(seen, None), Err(Misuse::NoOutcome(_))));
    // Nor does a moment before the last, where there was one.
    if !matches!(wish, Wish::Sleep(_)) {
        let earlier = Seen { now: Instant::ZERO, ..seen };
        let came = task.step(earlier, Some(Outcome::Slept));
        assert!(matches!(came, Err(Misuse::WentBack(_) | Misuse::Unfit(_))));
    }
    assert_eq!(task.pending(), Some(wish));
}
