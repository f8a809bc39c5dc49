use drivebus_drives::Place;
use drivebus_rtu::Instant;

use super::*;
use crate::parameters::WhyNotKept;
use crate::scripted::{Bench, Fault, Keeper, Reply, Script, Unit as Scripted, call, fails, like, refuses, shipped};
use crate::task::{Cause, Notice, Outcome, Read, Seen, Step, Task, Wish, Write};
use crate::writing::NotWritten;

/// GD300 manual, p. 122: P14.04 is the time-out in tenths of a second, P14.05 what the drive then does: 0 coasts, 3 stops.
const TIMEOUT: u16 = 0x0E04;
const ACTION: u16 = 0x0E05;

/// GD350 operation manual, section 9.4.4: with bit 15 an address is kept in RAM only.
const RAM: u32 = 0x8000;

/// Section 9.4.5: what the motor does, and hundredths of a hertz at the output.
const STATE: u16 = 0x2100;
const OUTPUT: u16 = 0x3000;
const FORWARD: u16 = 1;
const STOPPED: u16 = 3;

const SECOND: Duration = Duration::from_secs(1);

fn armable(family: &str, is_trusted: bool, seconds: f64, action: OnSilence) -> Result<BusTimeout, NotArmable> {
    BusTimeout::new(Rule::of(shipped(family).profile(), is_trusted), seconds, action)
}

/// 30 s, after which it is stopped.
fn timeout() -> BusTimeout {
    armable("gd350", true, 30.0, OnSilence::Stop).unwrap()
}

/// A GD350 at rest that trips for 2 of P14.05, and has no time-out.
fn gd350() -> Bench {
    Bench::of("gd350", &[(0x2103, 0x01A0), (STATE, STOPPED), (TIMEOUT, 0), (ACTION, 2)]).trusting()
}

impl Bench {
    fn arm(&mut self, timeout: &BusTimeout) -> Result<(), NotArmed<Fault>> {
        let (unit, timeout) = (self.call(), timeout.clone());
        let work = |line| async move { timeout.set(&unit, &line, Families::shipped()).await };
        self.script.carry_out_with(&mut self.keeper, work)
    }

    fn give_back(&mut self, timeout: &BusTimeout) -> Result<bool, NotGivenBack<Fault>> {
        let (unit, timeout) = (self.call(), timeout.clone());
        let work = |line| async move { timeout.give_back(&unit, &line, Families::shipped()).await };
        self.script.carry_out_with(&mut self.keeper, work)
    }

    /// What the drive has as its time-out, and its action.
    fn has(&self) -> (u16, u16) {
        (self.keeper.words[&TIMEOUT.into()], self.keeper.words[&ACTION.into()])
    }
}

/// What goes to RAM of `address`.
fn ram(address: u16, word: u16) -> (u32, Vec<u16>) {
    (RAM | u32::from(address), vec![word])
}

#[test]
fn what_a_family_does_not_have_is_not_armed() {
    let refused = |family, is_trusted, seconds, action| armable(family, is_trusted, seconds, action).unwrap_err();
    assert_eq!(refused("gd600", true, 1.0, OnSilence::Coast), NotArmable::NoTimeout);
    // GD3000 manual, p. 214: P11.04 of the rectifier; no address for RAM alone is printed.
    assert_eq!(refused("gd3000-rectifier", true, 1.0, OnSilence::Coast), NotArmable::OnlyStored("P11.04".into()));
    assert!(
        matches!(refused("gd350", false, 1.0, OnSilence::Coast), NotArmable::NotPrinted(note) if note.contains("GD300"))
    );
    // GD200A operation manual, pp. 72 and 93.
    assert!(armable("gd200a", false, 1.0, OnSilence::Coast).is_ok());
    let known = vec![OnSilence::Coast, OnSilence::Stop];
    assert_eq!(refused("gd350", true, 1.0, OnSilence::Trip), NotArmable::NoAction { action: OnSilence::Trip, known });
    // VFD500 manual, p. 97: it trips Er.485, and that is all.
    let known = vec![OnSilence::Trip];
    assert_eq!(
        refused("vfd500", true, 1.0, OnSilence::Coast),
        NotArmable::NoAction { action: OnSilence::Coast, known }
    );
    assert!(armable("vfd500", true, 1.0, OnSilence::Trip).is_ok());
}

#[test]
fn a_time_out_is_one_that_the_drive_counts() {
    let coast = |seconds| armable("gd350", true, seconds, OnSilence::Coast);
    for seconds in [0.0, -1.0, 60.1, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let refused = coast(seconds).unwrap_err();
        assert!(matches!(refused, NotArmable::OutOfRange { .. }), "{seconds}: {refused}");
        assert!(refused.to_string().ends_with("allowed is more than 0 to 60.0"), "{refused}");
    }
    for seconds in [0.05, 0.25] {
        assert!(matches!(coast(seconds), Err(NotArmable::Unfit(_))), "{seconds}");
    }
    for seconds in [0.1, 0.3, 60.0] {
        let timeout = coast(seconds).unwrap();
        assert_eq!((timeout.seconds(), timeout.action(), timeout.is_armed()), (seconds, OnSilence::Coast, false));
    }
}

#[test]
fn three_answers_may_be_lost_before_the_drive_acts() {
    assert_eq!(timeout().interval(), Duration::from_millis(7500));
}

#[test]
fn it_is_set_in_ram_action_first_and_put_back_time_out_first() {
    let (mut bench, timeout) = (gd350(), timeout());
    bench.arm(&timeout).unwrap();
    assert_eq!((bench.has(), timeout.is_armed(), timeout.may_be_set()), ((300, 3), true, true));
    assert!(bench.give_back(&timeout).unwrap());
    assert_eq!((bench.has(), timeout.is_armed(), timeout.may_be_set()), ((0, 2), false, false));
    let all = [ram(ACTION, 3), ram(TIMEOUT, 300), ram(TIMEOUT, 0), ram(ACTION, 2)];
    assert_eq!(bench.script.written(), all);
}

#[test]
fn a_drive_that_cannot_be_read_is_left_alone() {
    let timeout = timeout();
    let unit = call(&shipped("gd350"), &crate::Record::default(), true);
    let (mut script, shared) = (Script::new(), timeout.clone());
    let silent = |_: Read| fails(Cause::NoAnswer);
    let error = script
        .carry_out(silent, |line| async move { shared.set(&unit, &line, Families::shipped()).await })
        .unwrap_err();
    assert!(matches!((&*error.why, &error.back), (WhyNotArmed::Unread(_), Back::Untouched)));
    assert_eq!((error.may_be_set(), timeout.may_be_set(), script.sent.len()), (false, false, 0));
}

#[test]
fn a_drive_that_refuses_a_part_gets_back_what_it_had() {
    let (mut bench, timeout) = (gd350(), timeout());
    bench.keeper.confirms = [Ok(()), refuses(0x08)].into();
    let error = bench.arm(&timeout).unwrap_err();
    assert_eq!((error.parts, error.may_be_set(), timeout.is_armed(), bench.has()), (1, false, false, (0, 2)));
    assert!(matches!((&*error.why, &error.back), (WhyNotArmed::NotKept(NotKept { .. }), Back::Given)));
    assert!(error.to_string().ends_with("; it has back what it had"), "{error}");
}

/// What went out and was not confirmed may be there; so may what was confirmed before.
#[test]
fn a_drive_that_cannot_be_given_back_what_it_had_may_act() {
    for (confirms, parts) in
        [(vec![fails(Cause::NoAnswer); 9], 0), (vec![Ok(()), fails(Cause::NoAnswer), fails(Cause::NoAnswer)], 1)]
    {
        let (mut bench, timeout) = (gd350(), timeout());
        bench.keeper.confirms = confirms.into();
        let error = bench.arm(&timeout).unwrap_err();
        assert!(matches!(error.back, Back::NotGiven(_)), "{error}");
        assert_eq!((error.parts, error.may_be_set(), timeout.may_be_set()), (parts, true, true), "{error}");
        assert!(!timeout.is_armed());
    }
    // What is refused is not there.
    let (mut bench, timeout) = (gd350(), timeout());
    bench.keeper.confirms = vec![refuses(0x04); 9].into();
    let error = bench.arm(&timeout).unwrap_err();
    assert!(matches!(
        (&*error.why, &error.back),
        (WhyNotArmed::NotKept(NotKept { why, .. }), Back::NotGiven(_))
            if matches!(**why, WhyNotKept::NotWritten { why: NotWritten::Failed(_), .. })
    ));
    assert_eq!((bench.has(), error.parts), ((0, 2), 0));
}

/// A drive that takes the time-out, and shows another one.
struct Forgets(Keeper);

impl Scripted for Forgets {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        self.0.read(read, now)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.0.write(write, now)?;
        if self.0.words[&Place::from(TIMEOUT)] == 300 {
            self.0.words.insert(TIMEOUT.into(), 299);
        }
        Ok(())
    }
}

#[test]
fn a_drive_that_shows_something_else_gets_back_what_it_had() {
    let (bench, timeout) = (gd350(), timeout());
    let (unit, shared, mut script) = (bench.call(), timeout.clone(), Script::new());
    let mut unit_of_it = Forgets(bench.keeper);
    let work = |line| async move { shared.set(&unit, &line, Families::shipped()).await };
    let error = script.carry_out_with(&mut unit_of_it, work).unwrap_err();
    assert!(matches!((&*error.why, &error.back), (WhyNotArmed::Others(_), Back::Given)));
    assert!(error.to_string().contains("shows P14.05 = 3, P14.04 = 29.9 s; it has back"), "{error}");
    assert_eq!((error.parts, error.may_be_set(), timeout.may_be_set()), (2, false, false));
    assert_eq!(script.written()[2..], [ram(TIMEOUT, 0), ram(ACTION, 2)]);
}

/// Carries `task` out with `keeper` as far as its `most`-th wish. Whether it is done by then.
fn dropped_after<T>(most: usize, keeper: &mut Keeper, mut task: Task<T, Fault>) -> bool {
    let seen = Seen { now: Instant::ZERO, connection: 0, is_closed: false };
    let mut outcome = None;
    for _ in 0..most {
        outcome = Some(match task.step(seen, outcome).unwrap() {
            Step::Done(_) => return true,
            Step::Wish(Wish::Read(read)) => {
                let mut word =
                    |address| keeper.read(Read { place: Place { address, ..read.place }, ..read }, seen.now).unwrap();
                let words = (read.place.address..).take(read.count.into()).map(&mut word).collect();
                let stamp = Duration::ZERO;
                if read.is_stamped {
                    Outcome::Stamped(crate::task::Stamped { words, asked: stamp, answered: stamp })
                } else {
                    Outcome::Words(words)
                }
            }
            Step::Wish(Wish::Write(write)) => {
                keeper.write(&write, seen.now).map_or_else(Outcome::Failed, |()| Outcome::Written)
            }
            Step::Wish(Wish::Tell(_)) => Outcome::Heard,
            Step::Wish(wish) => panic!("nobody expects {wish}"),
        });
    }
    false
}

/// A task that is dropped can send nothing more: who drops it puts back what the drive had.
#[test]
fn what_was_dropped_on_its_way_can_be_put_back() {
    let (mut left_something, mut most) = (0, 0);
    loop {
        let (mut bench, timeout) = (gd350(), timeout());
        let (unit, shared) = (bench.call(), timeout.clone());
        let set = Task::new(|line| async move { shared.set(&unit, &line, Families::shipped()).await });
        if dropped_after(most, &mut bench.keeper, set) {
            break;
        }
        assert!(!timeout.is_armed());
        assert!(timeout.may_be_set() || bench.has() == (0, 2), "after {most} wishes it has {:?}", bench.has());
        left_something += usize::from(bench.has() != (0, 2));
        if timeout.may_be_set() {
            let (unit, shared) = (bench.call(), timeout.clone());
            let back = |line| async move { shared.put_back(&unit, &line, Families::shipped()).await };
            bench.script.carry_out_with(&mut bench.keeper, back).unwrap();
        }
        assert_eq!((bench.has(), timeout.may_be_set()), ((0, 2), false), "after {most} wishes");
        most += 1;
    }
    assert!(left_something >= 2, "{left_something}");
}

/// A GD350 whose words are a function of the milliseconds since the start, and which takes what is written.
struct InTime<F>(F, Keeper);

impl<F: FnMut(u16, u64) -> Option<u16>> Scripted for InTime<F> {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        let millis = u64::try_from(now.saturating_duration_since(Instant::ZERO).as_millis()).unwrap();
        (self.0)(read.place.address, millis).map_or_else(|| self.1.read(read, now), Ok)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.1.write(write, now)
    }
}

/// What `give_back` comes to with a drive of these words, and how long that took; and what the drive has then.
fn given_back<F: FnMut(u16, u64) -> Option<u16>>(words: F) -> (bool, Duration, (u16, u16)) {
    let (bench, timeout, mut script) = (gd350(), timeout(), Script::new());
    let (unit, shared, mut drive) = (bench.call(), timeout.clone(), InTime(words, bench.keeper));
    let set = |line| async move { shared.set(&unit, &line, Families::shipped()).await };
    script.carry_out_with(&mut drive, set).unwrap();
    script.now = Instant::ZERO;
    let (unit, shared) = (call(&bench.family, &bench.record, true), timeout.clone());
    let back = |line| async move { shared.give_back(&unit, &line, Families::shipped()).await };
    let is_back = script.carry_out_with(&mut drive, back).unwrap();
    assert_eq!(timeout.is_armed(), !is_back);
    let has = (drive.1.words[&TIMEOUT.into()], drive.1.words[&ACTION.into()]);
    (is_back, script.now.saturating_duration_since(Instant::ZERO), has)
}

#[test]
fn a_motor_that_slows_down_is_waited_for() {
    // By a hundredth of a hertz in 0.7 s, so that most looks show nothing of it.
    let (is_back, took, has) = given_back(|address, millis| match address {
        STATE => Some(if millis < 7000 { FORWARD } else { STOPPED }),
        OUTPUT => u16::try_from(10 - (millis / 700).min(10)).ok(),
        _ => None,
    });
    assert_eq!((is_back, has), (true, (0, 2)));
    assert!(took >= 7 * SECOND, "{took:?}");
}

#[test]
fn a_motor_that_goes_on_is_left_to_the_drive() {
    for counts in [fn_of(|_| 1000), fn_of(|millis| u16::try_from(1000 + millis).unwrap())] {
        let (is_back, took, has) = given_back(move |address, millis| match address {
            STATE => Some(FORWARD),
            OUTPUT => Some(counts(millis)),
            _ => None,
        });
        assert_eq!((is_back, has), (false, (300, 3)));
        assert!(SECOND <= took && took < SECOND + Duration::from_millis(50), "{took:?}");
    }
}

fn fn_of(f: fn(u64) -> u16) -> fn(u64) -> u16 {
    f
}

/// SAJ 8000M and others: where no frequency may be read, nothing is known to fall.
#[test]
fn a_motor_whose_speed_is_not_told_is_looked_at_once() {
    let family = shipped("saj8000m");
    let unit = call(&family, &crate::Record::default(), false);
    let profile = Arc::clone(family.profile());
    let state = profile.role("state").unwrap().place().unwrap();
    let runs = (0..=u16::MAX).find(|&word| profile.state(word).is_running()).unwrap();
    let mut script = Script::new();
    let says = move |read: Read| if read.place == state { Ok(runs) } else { like(&shipped("saj8000m"), &[])(read) };
    let rests = script.carry_out(says, |line| async move { unit.comes_to_rest(&line).await });
    assert!(matches!(rests, Ok(false)));
    assert_eq!(script.places(), [state.number()]);
}

#[test]
fn a_drive_that_does_not_tell_what_it_does_keeps_its_time_out() {
    // Of the CHV100 no state word is known.
    let unit = call(&shipped("chv100"), &crate::Record::default(), true);
    let mut script = Script::new();
    let rests = script.carry_out(like(&shipped("chv100"), &[]), |line| async move { unit.comes_to_rest(&line).await });
    assert!(matches!(rests, Err(NotGivenBack::Unseen(_))));
    assert_eq!(script.asked.len(), 0);
}

#[test]
fn what_was_not_given_back_stays_armed() {
    let (mut bench, timeout) = (gd350(), timeout());
    bench.arm(&timeout).unwrap();
    bench.keeper.confirms = vec![fails(Cause::NoAnswer); 9].into();
    assert!(matches!(bench.give_back(&timeout), Err(NotGivenBack::NotKept(_))));
    assert_eq!((timeout.is_armed(), timeout.may_be_set(), bench.has()), (true, true, (300, 3)));
    bench.keeper.confirms.clear();
    assert!(bench.give_back(&timeout).unwrap());
}

#[test]
fn a_question_reads_the_state_and_is_over_with_its_line() {
    let timeout = timeout();
    let ask = |script: &mut Script, reply: Reply| {
        let (unit, timeout) = (call(&shipped("gd350"), &crate::Record::default(), true), timeout.clone());
        script.carry_out(move |_: Read| reply.clone(), |line| async move { timeout.ask(&unit, &line).await })
    };
    let mut script = Script::new();
    assert!(ask(&mut script, Ok(STOPPED)).is_ok());
    assert_eq!(script.places(), [u32::from(STATE)]);
    assert!(matches!(script.told[..], [Notice::Shows(_)]));
    let error = ask(&mut script, fails(Cause::NoAnswer)).unwrap_err();
    assert!(error.why.is_some() && !error.is_over);
    script.is_closed = true;
    assert!(ask(&mut script, fails(Cause::Port)).unwrap_err().is_over);
}
