use std::sync::{Arc, LazyLock};

use drivebus_drives::{Place, Table};
use drivebus_rtu::Instant;
use proptest::prelude::*;

use super::*;
use crate::halt::{After, LastLook};
use crate::ready::Ignores;
use crate::scripted::{self, Fault, Obeys, Reply, Script, fails, refuses, shipped};
use crate::setpoint::NotSet;
use crate::settled::NotSettled;
use crate::task::{Cause, Link, Read, Write};

/// What was written, where, and by one word or by several.
type Sent = Vec<(Place, Payload)>;

struct Called {
    script: Script,
    done: Result<(), NotCommanded<Fault>>,
}

impl Called {
    fn sent(&self) -> Sent {
        self.script.sent.iter().map(|(_, write)| (write.place, write.payload.clone())).collect()
    }

    fn not_ready(self) -> NotReady<Fault> {
        assert!(self.script.sent.is_empty(), "{:?}", self.script.sent);
        match self.done.unwrap_err() {
            error if error.why.may_have_acted() => panic!("{error}"),
            NotCommanded { why: Why::NotReady(why), .. } => why,
            error => panic!("{error}"),
        }
    }

    fn not_set(self) -> NotSet<Fault> {
        assert!(self.script.sent.is_empty(), "{:?}", self.script.sent);
        match self.done.unwrap_err().why {
            Why::NotSet(why) => why,
            why => panic!("{why}"),
        }
    }
}

fn start_over(script: Script, drive: &Obeys, is_trusted: bool, start: Start) -> Called {
    carried_out(script, drive.seen(is_trusted), drive.clone(), start)
}

fn carried_out(script: Script, seen: Unit, unit: impl scripted::Unit, start: Start) -> Called {
    carried_out_among(Families::shipped(), script, seen, unit, start)
}

fn carried_out_among(
    families: &'static Families,
    mut script: Script,
    seen: Unit,
    unit: impl scripted::Unit,
    start: Start,
) -> Called {
    let operation = |line| async move { seen.start(&line, families, &start).await };
    let done = script.carry_out(unit, operation);
    Called { script, done }
}

/// A drive of which some reads are not answered, and each write comes to this.
struct But {
    drive: Obeys,
    silent_at: Option<u16>,
    takes: Result<(), Fault>,
}

impl scripted::Unit for But {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        if self.silent_at.is_some_and(|address| read.place == address.into()) {
            return fails(Cause::NoAnswer);
        }
        self.drive.read(read, now)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.takes.clone().and_then(|()| self.drive.write(write, now))
    }
}

fn start(drive: &Obeys, is_trusted: bool, start: Start) -> Called {
    start_over(Script::new(), drive, is_trusted, start)
}

fn reset(drive: &Obeys, is_trusted: bool) -> Called {
    let (mut script, unit) = (Script::new(), drive.seen(is_trusted));
    let confirm = Duration::from_secs(1);
    let operation = |line| async move { unit.reset_fault(&line, Families::shipped(), confirm).await };
    let done = script.carry_out(drive.clone(), operation);
    Called { script, done }
}

fn one(address: u16, word: u16) -> (Place, Payload) {
    (address.into(), Payload::Word(word))
}

fn many(address: u16, words: &[u16]) -> (Place, Payload) {
    (address.into(), Payload::Words(words.to_vec()))
}

fn coil(address: u16, word: u16) -> (Place, Payload) {
    (Place::new(Table::Coil, address), Payload::Word(word))
}

const FORWARD: Start = Start::run(false, Some(10.0));
const REVERSE: Start = Start::run(true, Some(10.0));

/// At rest, with its highest frequency at 50 Hz; the bus commands it. GD350 operation manual, section 9.4.5.
fn gd350() -> Obeys {
    let words = [(0x2103, 0x01A0), (0x2100, 3), (0x2101, 0x40), (0x0001, 2), (0x0006, 8), (0x0003, 5000)];
    Obeys::new("gd350", &words, &[(1, 0x2100, 1), (2, 0x2100, 2), (3, 0x2100, 1), (4, 0x2100, 2), (7, 0x2100, 3)])
}

/// At rest, and set to count in hertz. VFD500 manual, pp. 96 and 135.
fn vfd500() -> Obeys {
    let family = shipped("vfd500");
    let at = |name: &str| family.profile().find(name).unwrap().address().unwrap();
    let state = at("status_word_1");
    let words = [(at("P30.14"), 1), (at("status_word_2"), 2), (at("P00.02"), 2), (state, 0)];
    Obeys::new("vfd500", &words, &[(1, state, 1), (2, state, 3), (3, state, 1), (4, state, 3), (8, state, 0)])
}

/// At rest. CP2000 manual, p. 514, and MS300 manual, p. 799.
fn ms300() -> Obeys {
    let words = [(0x2101, 0x400), (0x0015, 2), (0x0014, 1)];
    Obeys::new("ms300", &words, &[(0x12, 0x2101, 0x403), (0x22, 0x2101, 0x40B)])
}

/// At rest. WJ200 manual, p. 353, and Omron MX2 manual, p. 309.
fn wj200() -> Obeys {
    Obeys::new("wj200", &[(0x1003, 0)], &[(1, 0x1003, 1)])
}

/// At rest, and its access is at L3. Altivar 312 manual, pp. 10, 11 and 36.
fn atv312() -> Obeys {
    let words = [(0x0BBE, 2), (0x20DD, 164), (0x0C20, 500), (0x0C81, 0x40)];
    let shows = [(0x06, 0x0C81, 0x21), (0x07, 0x0C81, 0x23), (0x0F, 0x0C81, 0x27), (0x80F, 0x0C81, 0x8027)];
    Obeys::new("atv312", &words, &shows)
}

/// GD350 operation manual, section 9.4.5: 1 to 4 at 2000H, and the frequency in hundredths at 2001H, which one frame takes.
#[test]
fn a_gd350_gets_its_command_and_its_frequency_in_one_frame() {
    let of = |start_so| {
        let called = start(&gd350(), false, start_so);
        assert!(called.done.is_ok(), "{:?}", called.done);
        called.sent()
    };
    assert_eq!(of(FORWARD), [many(0x2000, &[1, 1000])]);
    assert_eq!(of(REVERSE), [many(0x2000, &[2, 1000])]);
    assert_eq!(of(Start::run(false, None)), [one(0x2000, 1)]);
    assert_eq!(of(Start::jog(false)), [one(0x2000, 3)]);
    assert_eq!(of(Start::jog(true)), [one(0x2000, 4)]);
}

/// VFD500 manual, p. 135.
#[test]
fn a_vfd500_is_started_by_the_words_of_its_manual() {
    let of = |start_so| {
        let called = start(&vfd500(), true, start_so);
        assert!(called.done.is_ok(), "{:?}", called.done);
        called.sent()
    };
    assert_eq!(of(FORWARD), [many(0x7000, &[1, 1000])]);
    assert_eq!(of(REVERSE), [many(0x7000, &[2, 1000])]);
    assert_eq!(of(Start::jog(true)), [one(0x7000, 4)]);
}

/// No page of a GD20 proves what its state means: it is believed.
#[test]
fn what_tells_no_state_is_believed() {
    let gd20 = Obeys::new("gd20", &[(0x2103, 0x0106), (0x2101, 0x40)], &[]);
    let called = start(&gd20, false, Start::run(false, None));
    assert!(called.done.is_ok(), "{:?}", called.done);
    assert_eq!(called.sent(), [one(0x2000, 1)]);
}

/// CP2000 manual, p. 514: 12H and 22H.
#[test]
fn an_ms300_is_started_by_bits() {
    for (start_so, word) in [(FORWARD, 0x12), (REVERSE, 0x22)] {
        let called = start(&ms300(), true, start_so);
        assert!(called.done.is_ok(), "{:?}", called.done);
        assert_eq!(called.sent(), [many(0x2000, &[word, 1000])]);
    }
}

/// WJ200 manual, p. 353: which way it turns is coil 1 on the wire, and coil 0 runs it.
#[test]
fn a_wj200_is_told_the_way_before_it_is_told_to_run() {
    let called = start(&wj200(), true, FORWARD);
    assert!(called.done.is_ok(), "{:?}", called.done);
    assert_eq!(called.sent(), [one(0x0001, 1000), coil(1, 0), coil(0, 1)]);
    let mut reverse = REVERSE;
    reverse.confirm = Duration::ZERO;
    assert_eq!(start(&wj200(), true, reverse).sent(), [one(0x0001, 1000), coil(1, 1), coil(0, 1)]);
}

/// Altivar 312 manual, pp. 10 to 13: 06H, 07H and 0FH, and the frequency in tenths behind the last.
#[test]
fn an_atv312_is_led_up_to_its_start() {
    for (start_so, word) in [(FORWARD, 0x0F), (REVERSE, 0x80F)] {
        let called = start(&atv312(), false, start_so);
        assert!(called.done.is_ok(), "{:?}", called.done);
        assert_eq!(called.sent(), [one(0x2135, 0x06), one(0x2135, 0x07), many(0x2135, &[word, 100])]);
    }
    // One that turns is not led up again.
    let called = start(&atv312().with(&[(0x0C81, 0x27)]), false, Start::run(false, None));
    assert_eq!(called.sent(), [one(0x2135, 0x0F)]);
}

/// One that says that it has not taken the first of its words gets no other one.
#[test]
fn a_word_that_does_not_show_is_the_last() {
    let drive = Obeys::new("atv312", &[(0x0BBE, 2), (0x20DD, 164), (0x0C81, 0x40)], &[]);
    let called = start(&drive, false, Start::run(false, None));
    assert_eq!(called.sent(), [one(0x2135, 0x06)]);
    let error = called.done.unwrap_err();
    assert!(matches!(error.why, Why::NotLedUp(NotLedUp { number: 0, why: WhyNotLedUp::Unshown(_) })), "{error}");
    assert!(error.why.may_have_acted());
}

/// GD350: 7; VFD500: 8; MS300: 2 at 2002H; WJ200: coil 3.
#[test]
fn a_fault_is_reset_by_the_word_of_the_family_and_only_where_there_is_one() {
    let called = reset(&gd350().with(&[(0x2100, 4), (0x2102, 3)]), false);
    assert_eq!(called.sent(), [one(0x2000, 7)]);
    assert!(called.done.is_ok(), "{:?}", called.done);
    assert_eq!(reset(&ms300().with(&[(0x2100, 3)]), true).sent(), [one(0x2002, 2)]);
    for (drive, is_trusted) in [(gd350(), false), (vfd500(), true), (ms300(), true), (wj200(), true)] {
        let called = reset(&drive, is_trusted);
        assert!(called.done.is_ok() && called.sent().is_empty(), "{:?}", called.script.sent);
    }
}

#[test]
fn what_is_not_ready_gets_nothing() {
    let run = Start::run(false, None);
    let not_ready = |drive: &Obeys, start_so| start(drive, false, start_so).not_ready();
    let blank = |name: &str| Obeys::new(name, &[], &[]);

    // A WJ200 has no word that jogs; no page of an ACS355 proves its state; of a GD3000 only the run is printed.
    assert!(matches!(start(&wj200(), true, Start::jog(false)).not_ready(), NotReady::MayNot(_)));
    assert!(matches!(not_ready(&blank("acs355"), run), NotReady::Unseen(_)));
    assert!(matches!(not_ready(&blank("gd3000"), run), NotReady::Unstoppable { .. }));

    let wrong = |why| match why {
        NotReady::Settings { then, wrong } => (then, wrong[0].wanted.code.clone()),
        why => panic!("{why}"),
    };
    let of = |code: &str, then| (then, code.to_owned());
    assert_eq!(wrong(not_ready(&atv312().with(&[(0x0BBE, 1)]), run)), of("LAC", Ignores::Words));
    assert_eq!(wrong(not_ready(&atv312().with(&[(0x20DD, 1)]), run)), of("Fr1", Ignores::Commands));
    assert_eq!(wrong(not_ready(&gd350().with(&[(0x0006, 7)]), FORWARD)), of("P00.06", Ignores::Speed));
    // At its own speed it runs all the same.
    assert!(start(&gd350().with(&[(0x0006, 7)]), false, run).done.is_ok());

    let gd350_with = |words: &[(u16, u16)], start_so| not_ready(&gd350().with(words), start_so);
    assert!(matches!(gd350_with(&[(0x2100, 4), (0x2102, 3)], run), NotReady::InFault(look) if look.fault == Some(3)));
    assert!(matches!(gd350_with(&[(0x2100, 5)], run), NotReady::NoVoltage(_)));
    for word in [0, 7, 0xFFFF] {
        let told = gd350_with(&[(0x2100, word)], run);
        assert!(matches!(told, NotReady::UnknownState(look) if look.word == Some(word)), "{word}");
    }
    let by_keypad = gd350_with(&[(0x2101, 0x00)], run);
    assert!(matches!(by_keypad, NotReady::OtherSource(look) if look.other_source() == Some("keypad")));
    assert!(matches!(gd350_with(&[(0x2100, 1)], Start::jog(false)), NotReady::Turning(_)));
}

#[test]
fn a_line_that_may_not_carry_the_stop_carries_no_start() {
    let run = Start::run(false, None);
    let bad = || Script { link: Link { good: 5, asked: 10 }, ..Script::new() };
    let called = start_over(bad(), &gd350(), false, run);
    // Ten looks were made, and the line still says so.
    assert!(matches!(called.not_ready(), NotReady::BadLink { lost: 0, looks: 10, .. }));
    let mut forced = run;
    forced.is_forced = true;
    assert!(start_over(bad(), &gd350(), false, forced).done.is_ok());
    let one_lost = Script { link: Link { good: 9, asked: 10 }, ..Script::new() };
    assert!(start_over(one_lost, &gd350(), false, run).done.is_ok());
    let silent = But { drive: gd350(), silent_at: Some(0x2100), takes: Ok(()) };
    let called = carried_out(Script::new(), gd350().seen(false), silent, run);
    assert!(matches!(called.not_ready(), NotReady::Failed(Fault { cause: Cause::NoAnswer, .. })));
}

#[test]
fn a_frequency_that_the_drive_does_not_take_is_not_sent() {
    let at = |hz| Start::run(false, Some(hz));
    let gd350_at = |hz| start(&gd350().with(&[(0x0003, 4000)]), false, at(hz));
    assert!(gd350_at(40.0).done.is_ok());
    let above = gd350_at(40.01).not_set();
    assert!(matches!(above, NotSet::Above { ref limit, highest } if limit == "P00.03" && highest.count() == 4000));
    for hz in [-0.01, 630.01, f64::NAN, f64::INFINITY] {
        assert!(matches!(gd350_at(hz).not_set(), NotSet::Unfit(_)), "{hz}");
    }
    let unit_is = |raw| {
        let family = shipped("vfd500");
        let place = family.profile().find("P30.14").unwrap().address().unwrap();
        start(&vfd500().with(&[(place, raw)]), true, FORWARD).not_set()
    };
    assert!(matches!(unit_is(2), NotSet::NotInHz(unit) if unit == "rpm"));
    assert!(matches!(unit_is(9), NotSet::NotSettled(NotSettled::Unknown { raw: 9, .. })));
    let unset = |drive: &Obeys| {
        let unit = drive.seen(false);
        let operation = |line| async move { unit.set_frequency(&line, Families::shipped(), 10.0).await };
        Script::new().carry_out(drive.clone(), operation).unwrap_err()
    };
    assert!(matches!(unset(&vfd500()), NotSet::NotSettled(NotSettled::Unproved { .. })));
    assert!(matches!(unset(&Obeys::new("gd3000-rectifier", &[], &[])), NotSet::NoRegister));
}

/// WJ200 manual, p. 353: a motor that runs turns round by the first of its two words.
#[test]
fn the_way_alone_moves_a_motor_that_runs() {
    let turning = Obeys::new("wj200", &[(0x1003, 1)], &[]);
    let but = Coil { drive: turning.clone(), refused: Place::new(Table::Coil, 0) };
    let called = carried_out(Script::new(), turning.seen(true), but, Start::run(true, None));
    assert_eq!(called.sent(), [coil(1, 1), coil(0, 1)]);
    let error = called.done.unwrap_err();
    assert!(error.why.may_have_acted(), "{error}");
    // At rest it moves nothing.
    let rests = Obeys::new("wj200", &[], &[]);
    let but = Coil { drive: rests.clone(), refused: Place::new(Table::Coil, 0) };
    let called = carried_out(Script::new(), rests.seen(true), but, Start::run(true, None));
    assert!(!called.done.unwrap_err().why.may_have_acted());
}

/// It took the first word, and does not say any more what it is when the second is due. SJ200 manual (manualslib 68018), p. 233: its first
/// word starts no drive of another family, and its second one turns a WJ200 in reverse. An X200 has a coil where the first one goes, so that
/// it is left out here.
#[test]
fn the_way_alone_is_told_where_the_other_word_is_held_back() {
    static FAMILIES: LazyLock<Families> = LazyLock::new(|| {
        let profiles = Families::shipped().iter().map(|family| Arc::clone(family.profile()));
        Families::of(profiles.filter(|profile| profile.name() != "x200"))
    });
    for (runs, moves) in [(1, true), (0, false)] {
        let drive = Obeys::new("sj200", &[(0x000C, runs)], &[]);
        let seen = drive.seen(true);
        let forgets = Forgets { drive, is_told: false };
        let called = carried_out_among(&FAMILIES, Script::new(), seen, forgets, Start::run(true, None));
        assert_eq!(called.sent(), [coil(2, 0)]);
        let error = called.done.unwrap_err();
        assert_eq!(error.why.may_have_acted(), moves, "{error}");
        assert_eq!(matches!(error.why, Why::HalfWritten(_)), moves, "{error}");
    }
}

/// A drive that is silent when it is asked what it is, and refuses that when it was written to.
struct Forgets {
    drive: Obeys,
    is_told: bool,
}

impl scripted::Unit for Forgets {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        let is_question = !read.is_stamped && read.place == Place::from(0x000C);
        match self.is_told {
            false if is_question => fails(Cause::NoAnswer),
            true if is_question => refuses(0x02),
            _ => self.drive.read(read, now),
        }
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.is_told = true;
        self.drive.write(write, now)
    }
}

/// A drive that refuses what is written to one place.
struct Coil {
    drive: Obeys,
    refused: Place,
}

impl scripted::Unit for Coil {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        self.drive.read(read, now)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        if write.place == self.refused { refuses(0x02) } else { self.drive.write(write, now) }
    }
}

/// A motor that turns round slows down first. So does one that trips on the way.
#[test]
fn what_trips_on_its_way_round_does_not_run() {
    let turning = |shows: &[(u16, u16, u16)]| {
        let words = [(0x2103, 0x01A0), (0x2100, 1), (0x2101, 0x40), (0x3000, 5000)];
        start(&Obeys::new("gd350", &words, shows), false, Start::run(true, None))
    };
    // It is on its way, and forward still.
    assert!(turning(&[(2, 0x3000, 4900)]).done.is_ok());
    let tripped = turning(&[(2, 0x2100, 4), (2, 0x2102, 3), (2, 0x3000, 0)]);
    let error = tripped.done.unwrap_err();
    assert!(matches!(error.why, Why::Unshown(LastLook::Seen { ref look, .. }) if look.is_tripped()), "{error}");
    // Nor does one that somebody stopped.
    assert!(turning(&[(2, 0x2100, 3), (2, 0x3000, 0)]).done.is_err());
}

/// Whatever comes of it, a start goes out once; what the error says of it is so.
#[test]
fn a_start_is_sent_once() {
    let sent = |cause, was_sent| Err(Fault { cause, raw: Vec::new(), was_sent });
    let outcomes = [
        (fails(Cause::NoAnswer), true),
        (fails(Cause::BadAnswer), true),
        (sent(Cause::Port, true), true),
        (sent(Cause::Port, false), false),
        (sent(Cause::Halted, false), false),
        (refuses(0x06), false),
        (refuses(0x02), false),
    ];
    for (takes, may_have_acted) in outcomes {
        let but = But { drive: gd350(), silent_at: None, takes: takes.clone() };
        let called = carried_out(Script::new(), gd350().seen(false), but, FORWARD);
        assert_eq!(called.sent(), [many(0x2000, &[1, 1000])], "{takes:?}");
        let error = called.done.unwrap_err();
        assert_eq!(error.why.may_have_acted(), may_have_acted, "{error}");
        let is_looked_at = matches!(error.why, Why::Unanswered { after: After::Seen(_), .. });
        assert_eq!(is_looked_at, may_have_acted, "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever the drive has as its maximum, and whatever is asked for, no word above that is sent.
    #[test]
    fn no_frequency_above_the_maximum_is_sent(
        hz in prop_oneof![0.0..70.0, any::<f64>(), (0u32..7000).prop_map(|counts| f64::from(counts) / 100.0)],
        highest in prop_oneof![0u16..7000, any::<u16>()],
        is_atv312 in any::<bool>(),
    ) {
        // P00.03 in hundredths, HSP in tenths.
        let (drive, counts) = if is_atv312 {
            (atv312().with(&[(0x0C20, highest)]), 10.0)
        } else {
            (gd350().with(&[(0x0003, highest)]), 100.0)
        };
        let called = start(&drive, false, Start::run(false, Some(hz)));
        let sent = called.sent();
        let given: Vec<_> = sent.iter().filter_map(|(_, payload)| match payload {
            Payload::Words(words) => words.get(1).copied(),
            Payload::Word(_) => None,
        }).collect();
        prop_assert!(given.iter().all(|&word| word <= highest), "{given:?}");
        match called.done {
            Ok(()) => prop_assert!((0.0..=f64::from(highest) / counts).contains(&hz) && given.len() == 1),
            Err(error) => prop_assert!(sent.is_empty() && !error.why.may_have_acted(), "{}", error),
        }
    }
}
