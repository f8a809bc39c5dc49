use std::sync::Arc;

use drivebus_drives::{Command, Entry, State};
use drivebus_rtu::UnitAddress;
use proptest::prelude::*;

use super::super::tests::{Acknowledges, Whatever, of, order};
use super::super::{After, Order};
use super::*;
use crate::family::Family;
use crate::look::Looks;
use crate::record::Record;
use crate::same_unit::SameUnit;
use crate::scripted::{
    Fault, Reply, Script, Unit, any_confirmation, any_family, any_reply, fails, like, refuses, shipped, words_of,
};
use crate::speed::Speeds;
use crate::taken::Taken;
use crate::task::{Cause, Link, Read, Write};

/// A unit on the line, and what it is named as.
#[derive(Clone)]
struct Plant {
    named: Arc<Family>,
    is: Arc<Family>,
    record: Record,
    /// What becomes of each write.
    confirms: Result<(), Fault>,
    /// For how long it still shows that it runs, once it was told.
    rests_after: Duration,
    told: Option<Instant>,
}

impl Plant {
    /// One that obeys at once, and that this line has identified.
    fn new(family: &str) -> Self {
        let (named, record) = (shipped(family), Record::default());
        record.identity(named.name(), 0).settle(0, Instant::ZERO);
        Self { is: Arc::clone(&named), named, record, confirms: Ok(()), rests_after: Duration::ZERO, told: None }
    }

    /// The same, of which nothing is known yet.
    fn unknown(self) -> Self {
        Self { record: Record::default(), ..self }
    }

    fn silent(self) -> Self {
        Self { confirms: fails(Cause::NoAnswer), ..self }
    }

    fn rests_after(self, rests_after: Duration) -> Self {
        Self { rests_after, ..self }
    }

    fn is_silent(&self) -> bool {
        self.confirms == fails(Cause::NoAnswer)
    }

    fn halt(&self, unit: UnitAddress, order: &Order, now: Instant) -> Halt<Fault> {
        let same = SameUnit::new(unit, &self.named, &self.record.identity(self.named.name(), 0), false);
        let profile = self.named.profile();
        let (looks, speeds) = (Arc::new(Looks::new(profile, true)), Arc::new(Speeds::new(profile, true)));
        Halt::new(Taken::as_named(same, &looks, &speeds), &self.record, order.clone(), Families::shipped(), now)
    }
}

impl Unit for Plant {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        if self.is_silent() {
            return fails(Cause::NoAnswer);
        }
        let profile = self.is.profile();
        if profile.role("state").and_then(Entry::place) != Some(read.place) {
            return like(&self.is, &[])(read);
        }
        let rests = self.told.is_some_and(|told| now >= told + self.rests_after);
        let shows = if rests { State::Stopped } else { State::Forward };
        Ok((0..=u16::MAX).find(|&raw| profile.state(raw) == shows && !profile.is_in_fault(raw)).unwrap())
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.confirms.clone()?;
        if self.is.profile().command(Command::Stop).is_some_and(|stop| stop == (write.place, words_of(write)[0])) {
            self.told.get_or_insert(now);
        }
        Ok(())
    }
}

/// Units at the addresses 1 and on.
struct Line(Vec<Plant>);

impl Line {
    fn at(&mut self, unit: UnitAddress) -> &mut Plant {
        &mut self.0[usize::from(unit.get()) - 1]
    }
}

impl Unit for Line {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        self.at(read.unit).read(read, now)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.at(write.unit).write(write, now)
    }
}

fn address(place: usize) -> UnitAddress {
    UnitAddress::new(u8::try_from(place + 1).unwrap()).unwrap()
}

/// What came of each, and the line it was done over.
fn halted(mut script: Script, order: &Order, plants: Vec<Plant>) -> (Vec<Result<(), NotHalted<Fault>>>, Script) {
    let halts: Vec<_> =
        plants.iter().enumerate().map(|(place, plant)| plant.halt(address(place), order, script.now)).collect();
    let done = script.carry_out(Line(plants), |line| async move { halt_all(&line, Families::shipped(), halts).await });
    (done, script)
}

fn stopped(plants: Vec<Plant>) -> (Vec<Result<(), NotHalted<Fault>>>, Script) {
    halted(Script::new(), &order(Command::Stop), plants)
}

/// To whom was written, in that order.
fn told(script: &Script) -> Vec<u8> {
    script.sent.iter().map(|(_, write)| write.unit.get()).collect()
}

fn took(script: &Script) -> Duration {
    script.now.saturating_duration_since(Instant::ZERO)
}

/// GD350 operation manual, section 9.4.5: 5 at 2000H stops it. VFD500 manual, chapter 9: 6 at 7000H stops it, and 5 lets it
/// coast.
#[test]
fn each_is_told_in_its_own_words_before_the_first_is_looked_at() {
    let plants = ["gd350", "vfd500", "gd600"].map(Plant::new).to_vec();
    let (done, script) = stopped(plants);
    assert!(done.len() == 3 && done.iter().all(Result::is_ok), "{done:?}");
    assert_eq!(script.written(), [(0x2000, vec![5]), (0x7000, vec![6]), (0x2000, vec![5])]);
    assert_eq!(told(&script), [1, 2, 3]);
    let last_sent = script.sent.last().unwrap().0;
    assert_eq!(last_sent, Instant::ZERO + Duration::from_millis(3), "nothing was asked before");
}

#[test]
fn the_proofs_go_on_side_by_side() {
    let slow = || Plant::new("gd350").rests_after(Duration::from_millis(900));
    let (done, alone) = stopped(vec![slow()]);
    assert!(done[0].is_ok());
    let (done, together) = stopped(vec![slow(), slow(), slow(), slow()]);
    assert!(done.iter().all(Result::is_ok), "{done:?}");
    assert!(took(&together) < took(&alone) + Duration::from_millis(100), "{:?} {:?}", took(&together), took(&alone));
}

#[test]
fn what_the_others_take_counts_against_no_proof() {
    let order = Order { confirm: Duration::from_millis(300), ..order(Command::Stop) };
    let slow = || Plant::new("gd350").rests_after(Duration::from_millis(1200));
    let (done, _) = halted(Script::new(), &order, vec![slow()]);
    assert!(matches!(&done[..], [Err(NotHalted { why: Why::Unshown(_), .. })]), "{done:?}");
    let script = Script { silence: Duration::from_millis(100), ..Script::new() };
    let (done, _) = halted(script, &order, vec![slow(), Plant::new("gd350").silent()]);
    assert!(matches!(&done[..], [Ok(()), Err(_)]), "{done:?}");
}

#[test]
fn who_is_silent_or_has_to_be_asked_first_keeps_nobody_waiting() {
    let (silent, asked) = (Link { good: 0, asked: 3 }, Link { good: 1, asked: 10 });
    let mut script = Script::new();
    script.links = [(address(0), silent), (address(1), asked)].into();
    // 5 runs an EDS300 (its manual, p. 46): what is named as a GD350 and not known is asked before.
    let plants = vec![Plant::new("gd350"), Plant::new("gd350").unknown(), Plant::new("gd350"), Plant::new("vfd500")];
    let (done, script) = halted(script, &order(Command::Stop), plants);
    assert!(done.iter().all(Result::is_ok), "{done:?}");
    assert_eq!(told(&script), [3, 4, 2, 1]);
    assert_eq!(script.asked[0].unit, address(1), "and only that one is asked before");
}

#[test]
fn one_that_is_not_halted_keeps_no_other_from_it() {
    let refusing = Plant { confirms: refuses(0x04), ..Plant::new("vfd500") };
    let runs_on = Plant::new("gd350").rests_after(Duration::from_secs(3600));
    let plants = vec![Plant::new("gd350").silent(), Plant::new("gd350"), refusing, runs_on, Plant::new("gd600")];
    let (done, script) = stopped(plants);
    let [Err(silent), Ok(()), Err(refuses), Err(runs), Ok(())] = &done[..] else { panic!("{done:?}") };
    assert_eq!((silent.unit, refuses.unit, runs.unit), (address(0), address(2), address(3)));
    assert!(matches!(silent.why, Why::Unanswered { after: After::Unread(_), .. }), "{silent}");
    assert!(matches!(refuses.why, Why::Refused { .. }), "{refuses}");
    assert!(matches!(runs.why, Why::Unshown(_)), "{runs}");
    assert_eq!(told(&script)[..5], [1, 2, 3, 4, 5], "all are told before one is told again");
}

/// As where one is halted alone: a drive that says by 05H that it is at it, and shows nothing, is told once more.
#[test]
fn what_is_only_acknowledged_has_to_show() {
    let family = shipped("sunfar-e300");
    for (obeys, times) in [(true, 1), (false, 2)] {
        let (mut script, halts) = (Script::new(), vec![of(&family, order(Command::Stop), &Record::default())]);
        let unit = Acknowledges::new(&family, obeys);
        let done = script.carry_out(unit, |line| async move { halt_all(&line, Families::shipped(), halts).await });
        assert_eq!((done[0].is_ok(), script.sent.len()), (obeys, times));
    }
}

/// EDS300 manual, p. 46: 5 runs it, and 6 stops it.
#[test]
fn one_that_shows_another_family_is_halted_as_that() {
    let named_wrongly = Plant { is: shipped("eds300"), ..Plant::new("gd350").unknown() };
    let (done, script) = stopped(vec![named_wrongly, Plant::new("vfd500")]);
    assert!(done.iter().all(Result::is_ok), "{done:?}");
    let words: Vec<_> = script.sent.iter().map(|(_, write)| (write.unit.get(), words_of(write)[0])).collect();
    assert_eq!(words, [(2, 6), (1, 6)]);
}

#[test]
fn nobody_is_told_nothing() {
    let (done, script) = stopped(Vec::new());
    assert!(done.is_empty() && script.sent.is_empty() && script.asked.is_empty());
}

/// A line that has no time any more.
#[test]
fn a_pause_that_fails_ends_them_one_by_one() {
    let plants = vec![Plant::new("gd350").rests_after(Duration::from_secs(9)); 3];
    let script = Script { pauses: fails(Cause::Other), ..Script::new() };
    let (done, script) = halted(script, &order(Command::Stop), plants);
    assert_eq!(told(&script), [1, 2, 3]);
    assert_eq!(done.len(), 3);
    for (place, came) in done.iter().enumerate() {
        let Err(NotHalted { unit, was_sent: true, why: Why::Failed(_), .. }) = came else { panic!("{came:?}") };
        assert_eq!(*unit, address(place));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever comes, it ends, and there is one result for each, whose number is its own.
    #[test]
    fn each_comes_to_something(
        families in proptest::collection::vec(any_family(), 1..4),
        replies in proptest::collection::vec(any_reply(), 1..12),
        confirms in proptest::collection::vec(any_confirmation(), 1..6),
        within in 0u64..600,
        is_closed: bool,
    ) {
        let order = Order { within: Duration::from_millis(within), ..order(Command::Stop) };
        let plants = families.iter().map(|family| Plant::new(family.name()).unknown());
        let halts: Vec<_> =
            plants.enumerate().map(|(place, plant)| plant.halt(address(place), &order, Instant::ZERO)).collect();
        let mut script = Script { is_closed, ..Script::new() };
        let unit = Whatever::new(replies, confirms);
        let done = script.carry_out(unit, |line| async move { halt_all(&line, Families::shipped(), halts).await });
        prop_assert_eq!(done.len(), families.len());
        for (place, came) in done.iter().enumerate() {
            prop_assert!(came.as_ref().map_or_else(|why| why.unit == address(place), |()| told(&script).contains(&address(place).get())));
        }
    }
}
