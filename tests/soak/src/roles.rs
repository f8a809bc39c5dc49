//! What the threads do: reading what is known, writing what is unique, commanding motors.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Debug;
use std::time::Duration;

use drivebus_line::{CallError, CallOptions, Done, Failure, Priority};
use drivebus_rtu::{Answer, Instant, Request};

use crate::chance::Chance;
use crate::rig::{BLOCKS, Rig, UNITS, known};
use crate::verdict::Verdict;

/// Parameters without a range, each with a writer of its own: P04.27, P05.13, P09.04, P11.51, P15.13, P27.00.
const SINGLE: [u16; 6] = [0x041B, 0x050D, 0x0904, 0x0B33, 0x0F0D, 0x1B00];
/// P04.01 and P04.02, written together.
const PAIR: u16 = 0x0401;
const COMMAND: u16 = 0x2000;
const SETPOINT: u16 = 0x2001;
const STOP: u16 = 5;
/// Forward, reverse, coast; setpoints tell them apart.
const COMMANDS: [u16; 3] = [1, 2, 6];
/// 630.00 Hz and a little less.
const SETPOINTS: u16 = 63_000;
/// How long an answer that is late may be owed: eight times as long as the line holds one back.
const OWED: Duration = Duration::from_secs(1);
/// Writes that may still turn up in a log.
const REMEMBERED: usize = 8;

/// One line of work.
pub(crate) trait Role: Send + Debug {
    /// Makes one call, and looks whether all is true.
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict);

    /// Looks once more, when nobody asks any more.
    fn settle(&mut self, _rig: &Rig, _verdict: &mut Verdict) {}
}

/// Reads words whose values are known.
#[derive(Debug)]
pub(crate) struct Reader(Chance);

impl Reader {
    pub(crate) fn new(chance: Chance) -> Self {
        Self(chance)
    }
}

impl Role for Reader {
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict) {
        let (Some(unit), Some((first, length))) = (some_unit(rig, &mut self.0, &UNITS), self.0.one_of(&BLOCKS)) else {
            return;
        };
        // Many of the same length, which only the address tells apart, and nothing in the answer does.
        let count = if self.0.below(2) == 0 { 2 } else { 1 + self.0.below(length) };
        let address = first + self.0.below(length - count + 1);
        let expected: Vec<u16> = (address..address + count).map(|address| known(unit, address)).collect();
        // Half of them are not repeated: the next one then comes while the answer may still be on its way.
        let retries = (self.0.below(2) == 0).then_some(0);
        read(rig, unit, address, &expected, retries, verdict);
    }
}

/// Most of the time the unit that everybody asks, if it is one of `units`.
pub(crate) fn some_unit(rig: &Rig, chance: &mut Chance, units: &[u8]) -> Option<u8> {
    let focus = rig.focus();
    if chance.below(4) > 0 && units.contains(&focus) { Some(focus) } else { chance.one_of(units) }
}

/// Reads as many words as are `expected`, or says what came instead.
pub(crate) fn read(rig: &Rig, unit: u8, address: u16, expected: &[u16], retries: Option<u32>, verdict: &mut Verdict) {
    if let Some(came) = words(rig, unit, address, expected.len(), retries, verdict) {
        judge(rig, unit, address, &[expected], &came, verdict);
    }
}

/// What is read, if anything is.
fn words(
    rig: &Rig,
    unit: u8,
    address: u16,
    count: usize,
    retries: Option<u32>,
    verdict: &mut Verdict,
) -> Option<Vec<u16>> {
    let request = Request::read(address, u16::try_from(count).ok()?).ok()?;
    let mut came = Vec::with_capacity(count);
    let result = rig.ask(unit, &request, CallOptions::new().retries(retries), &mut |answer| {
        came.clear();
        if let Answer::Read { words, .. } = answer {
            came.extend(words.iter());
        }
    });
    result.map_err(|error| note(rig, &error, verdict)).ok().map(|_| came)
}

/// Whether `came` is one of the things that may be there.
pub(crate) fn judge(rig: &Rig, unit: u8, address: u16, right: &[&[u16]], came: &[u16], verdict: &mut Verdict) {
    if right.contains(&came) {
        verdict.right += 1;
        return;
    }
    verdict.wrong_values += 1;
    verdict.blame(format!("unit {unit}, {address:04X}H: {right:?} is there, {came:?} was read"), rig.trace());
}

/// Counts an error by its kind. Everything asked here is allowed: a refusal was meant for something else.
pub(crate) fn note(rig: &Rig, error: &CallError, verdict: &mut Verdict) {
    if matches!(error.failure, Failure::Refused { .. }) {
        verdict.false_refusals += 1;
        verdict.blame(format!("{error}, but no drive refuses that"), rig.trace());
    }
    let kind = match error.failure {
        Failure::Port(_) => "port",
        Failure::NoAnswer { .. } => "no answer",
        Failure::Busy { .. } => "busy",
        Failure::Wrong(_) => "wrong answer",
        Failure::Corrupt(_) => "damaged answer",
        Failure::Refused { .. } => "refused",
        Failure::NotBegun(_) => "not begun",
        Failure::NotAsked { .. } => "not asked",
        Failure::NotTaken { .. } => "not taken",
        Failure::Doubtful => "doubtful",
        Failure::Disagreeing { .. } => "disagreeing",
        _ => "other",
    };
    *verdict.errors.entry(kind).or_default() += 1;
}

/// What became of one write by its own account.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Said {
    Done,
    NotDone,
    Perhaps,
}

impl Said {
    fn of(result: &Result<Done, Box<CallError>>) -> Self {
        match result {
            Ok(_) => Self::Done,
            Err(error) if error.sent.is_none() => Self::NotDone,
            Err(error) if matches!(error.failure, Failure::Refused { .. } | Failure::NotTaken { .. }) => Self::NotDone,
            Err(_) => Self::Perhaps,
        }
    }
}

/// A write that was asked for.
#[derive(Debug)]
struct Asked {
    value: u16,
    said: Said,
    taken: u32,
}

/// The writes to one address of one unit, against the drive's own log.
#[derive(Debug, Default)]
struct Account {
    asked: VecDeque<Asked>,
    next: u16,
    /// What the drive took last.
    current: Option<u16>,
}

impl Account {
    /// A value that was not written for long.
    fn fresh(&mut self, bound: u16) -> u16 {
        self.next = (self.next + 1) % bound;
        self.next
    }

    /// Keeps what was said of `value`.
    fn asked(&mut self, value: u16, said: Said) {
        if self.asked.len() == REMEMBERED {
            self.asked.pop_front();
        }
        self.asked.push_back(Asked { value, said, taken: 0 });
    }

    /// Compares with what the drive `taken` since the last time; returns what is not true.
    fn check(&mut self, taken: &[u16], verdict: &mut Verdict) -> Option<String> {
        let mut wrong = None;
        for &value in taken {
            self.current = Some(value);
            let Some(asked) = self.asked.iter_mut().find(|asked| asked.value == value) else {
                verdict.unasked += 1;
                wrong = Some(format!("{value} was taken, and nobody wrote it"));
                continue;
            };
            asked.taken += 1;
            if asked.taken > 1 {
                verdict.twice += 1;
                wrong = Some(format!("{value} was written once and taken {} times", asked.taken));
            } else if asked.said == Said::NotDone {
                verdict.unasked += 1;
                wrong = Some(format!("{value} was taken, though it was said not to be"));
            }
        }
        if let Some(last) = self.asked.back_mut()
            && last.said == Said::Done
            && last.taken == 0
        {
            verdict.not_done += 1;
            // It is counted once.
            last.said = Said::Perhaps;
            wrong = Some(format!("{} was reported done, and not taken", last.value));
        }
        wrong
    }
}

/// Writes parameters, one or two at a time, and reads them back.
#[derive(Debug)]
pub(crate) struct Writer {
    chance: Chance,
    units: Vec<u8>,
    accounts: BTreeMap<(u8, u16), Account>,
}

impl Writer {
    pub(crate) fn new(chance: Chance, units: &[u8]) -> Self {
        Self { chance, units: units.to_vec(), accounts: BTreeMap::new() }
    }

    /// Reads what was written. The log may say something new meanwhile: a request that went out just before the adapter
    /// was pulled out is taken a little later.
    fn read_back(&mut self, rig: &Rig, unit: u8, address: u16, verdict: &mut Verdict) {
        let Some(account) = self.accounts.get_mut(&(unit, address)) else { return };
        let before = account.current.map(|value| as_written(address, value)).unwrap_or_default();
        let Some(came) = words(rig, unit, address, before.len(), None, verdict) else { return };
        account.check(&rig.journal.taken(unit, address), verdict);
        let after = account.current.map(|value| as_written(address, value)).unwrap_or_default();
        judge(rig, unit, address, &[&before, &after], &came, verdict);
    }

    fn write(&mut self, rig: &Rig, unit: u8, address: u16, verdict: &mut Verdict) {
        let account = self.accounts.entry((unit, address)).or_default();
        let value = account.fresh(u16::MAX);
        let words = as_written(address, value);
        let request = match Request::write_many(address, &words) {
            Ok(request) if address == PAIR => request,
            _ => Request::write(address, value),
        };
        // Half of them are cleared up by reading back, and repeated only where the drive shows the value before.
        let read_back = (self.chance.below(2) == 0).then_some(address);
        let result = rig.ask(unit, &request, CallOptions::new().read_back(read_back), &mut |_| ());
        conclude(rig, account, unit, address, value, &result, verdict);
        if address == PAIR {
            let second = rig.journal.taken(unit, PAIR + 1);
            let account = self.accounts.entry((unit, PAIR + 1)).or_default();
            account.asked(!value, Said::of(&result));
            if let Some(wrong) = account.check(&second, verdict) {
                verdict.blame(format!("unit {unit}, {:04X}H: {wrong}", PAIR + 1), rig.trace());
            }
        }
    }
}

/// The words that a write of `value` leaves at `address`.
fn as_written(address: u16, value: u16) -> Vec<u16> {
    if address == PAIR { vec![value, !value] } else { vec![value] }
}

/// Takes `result` of writing `value` down, and compares with the log.
fn conclude(
    rig: &Rig,
    account: &mut Account,
    unit: u8,
    address: u16,
    value: u16,
    result: &Result<Done, Box<CallError>>,
    verdict: &mut Verdict,
) {
    match result {
        Ok(_) => verdict.done += 1,
        Err(error) => note(rig, error, verdict),
    }
    account.asked(value, Said::of(result));
    if let Some(wrong) = account.check(&rig.journal.taken(unit, address), verdict) {
        verdict.blame(format!("unit {unit}, {address:04X}H: {wrong}; {result:?}"), rig.trace());
    }
}

impl Role for Writer {
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict) {
        let Some(unit) = some_unit(rig, &mut self.chance, &self.units) else { return };
        let place = usize::from(self.chance.below(7));
        let address = SINGLE.get(place).copied().unwrap_or(PAIR);
        let written = self.accounts.get(&(unit, address)).is_some_and(|account| account.current.is_some());
        if written && self.chance.below(2) == 0 {
            self.read_back(rig, unit, address, verdict);
        } else {
            self.write(rig, unit, address, verdict);
        }
    }

    fn settle(&mut self, rig: &Rig, verdict: &mut Verdict) {
        for (&(unit, address), account) in &mut self.accounts {
            account.check(&rig.journal.taken(unit, address), verdict);
        }
    }
}

/// Runs, coasts and stops every motor.
#[derive(Debug)]
pub(crate) struct Commander {
    chance: Chance,
    commands: BTreeMap<u8, Account>,
    stops: BTreeMap<u8, Stops>,
}

/// The stops of one unit. They are all alike, so that only their number tells.
#[derive(Debug, Default)]
struct Stops {
    /// When the answer to one of them was given up, which may still come, whatever is answered meanwhile.
    owed: Option<Instant>,
    /// One went out and is not in the log yet: the adapter was pulled out in the silence after it.
    under_way: bool,
}

impl Stops {
    /// Compares with the commands that were `taken` since the last time: `said` of a stop, or `None` of no stop at all.
    fn check(&mut self, now: Instant, taken: &[u16], said: Option<Said>, verdict: &mut Verdict) -> Option<String> {
        let owed = self.owed.is_some_and(|then| now < then + OWED);
        let stops = taken.iter().filter(|&&command| command == STOP).count();
        let sent = usize::from(said.is_some_and(|said| said != Said::NotDone));
        let possible = sent + usize::from(self.under_way);
        let missing = stops == 0 && sent > 0;
        let mut wrong = None;
        if stops > possible {
            verdict.twice += 1;
            wrong = Some(format!("{possible} stops were sent, {taken:?} was done"));
        } else if missing && said == Some(Said::Done) {
            if owed {
                verdict.confirmed_by_earlier += 1;
            } else {
                verdict.not_done += 1;
                wrong = Some(String::from("a stop was reported done, and not taken"));
            }
        }
        self.under_way = missing;
        // What was confirmed by an earlier one's answer has its own still to come.
        if said == Some(Said::Perhaps) || (said == Some(Said::Done) && owed) {
            self.owed = Some(now);
        }
        wrong
    }
}

impl Commander {
    pub(crate) fn new(chance: Chance) -> Self {
        Self { chance, commands: BTreeMap::new(), stops: BTreeMap::new() }
    }

    /// One command with a setpoint of its own, in one frame.
    fn command(&mut self, rig: &Rig, unit: u8, verdict: &mut Verdict) {
        let account = self.commands.entry(unit).or_default();
        let (Some(command), setpoint) = (self.chance.one_of(&COMMANDS), account.fresh(SETPOINTS)) else { return };
        let words = [command, setpoint];
        let Ok(request) = Request::write_many(COMMAND, &words) else { return };
        let result = rig.ask(unit, &request, CallOptions::default(), &mut |_| ());
        conclude(rig, account, unit, SETPOINT, setpoint, &result, verdict);
        let taken = rig.journal.taken(unit, COMMAND);
        let stops = self.stops.entry(unit).or_default();
        if let Some(wrong) = stops.check(rig.now(), &taken, None, verdict) {
            verdict.blame(format!("unit {unit}: {wrong}"), rig.trace());
        }
    }

    /// A stop overtakes those who wait, and does not wait for the unit's debts.
    fn stop(&mut self, rig: &Rig, unit: u8, verdict: &mut Verdict) {
        let request = Request::write(COMMAND, STOP);
        let result = rig.ask(unit, &request, at_once(), &mut |_| ());
        let taken = rig.journal.taken(unit, COMMAND);
        match &result {
            Ok(_) => verdict.done += 1,
            Err(error) => note(rig, error, verdict),
        }
        let stops = self.stops.entry(unit).or_default();
        if let Some(wrong) = stops.check(rig.now(), &taken, Some(Said::of(&result)), verdict) {
            verdict.blame(format!("unit {unit}: {wrong}; {result:?}"), rig.trace());
        }
    }
}

/// As a stop is sent.
fn at_once() -> CallOptions {
    CallOptions::new().priority(Priority::Stop).in_doubt(true)
}

impl Role for Commander {
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict) {
        let Some(unit) = some_unit(rig, &mut self.chance, &UNITS) else { return };
        if self.chance.below(4) == 0 {
            self.stop(rig, unit, verdict);
        } else {
            self.command(rig, unit, verdict);
        }
    }

    fn settle(&mut self, rig: &Rig, verdict: &mut Verdict) {
        for (&unit, account) in &mut self.commands {
            account.check(&rig.journal.taken(unit, SETPOINT), verdict);
            rig.journal.taken(unit, COMMAND);
        }
    }
}
