use super::*;
use crate::record::Record;
use crate::scripted::{Fault, Reply, Script, Unit as Scripted, call, fails, like, shipped};
use crate::task::{Cause, Read, Write};

/// GD350 operation manual, section 9.4.5: 2100H says what the motor does, 2102H its fault; 3000H and 3001H count
/// hundredths of a hertz, at the output and of the setpoint.
const STATE: u16 = 0x2100;
const FAULT: u16 = 0x2102;
const OUTPUT: u16 = 0x3000;
const SETPOINT: u16 = 0x3001;

/// What the words of [`STATE`] are called.
const FORWARD: u16 = 1;
const STOPPED: u16 = 3;
const TRIPPED: u16 = 4;

const SECOND: Duration = Duration::from_secs(1);

/// A GD350 whose words are a function of the milliseconds since the start.
struct InTime<F>(F);

impl<F: FnMut(u16, u64) -> Option<u16>> Scripted for InTime<F> {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        let millis = u64::try_from(now.saturating_duration_since(Instant::ZERO).as_millis()).unwrap();
        match (self.0)(read.place.address, millis) {
            Some(word) => Ok(word),
            None => like(&shipped("gd350"), &[])(read),
        }
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        panic!("nobody expects {write}")
    }
}

fn until<F: FnMut(u16, u64) -> Option<u16>>(
    words: F,
    hz: Option<f64>,
    within: Duration,
) -> (Result<Status, NotReached<Fault>>, Script) {
    let mut script = Script::new();
    let unit = call(&shipped("gd350"), &Record::default(), false);
    let came = script.carry_out(InTime(words), |line| async move { unit.wait_for_speed(&line, hz, 0.1, within).await });
    (came, script)
}

fn until_stopped<F: FnMut(u16, u64) -> Option<u16>>(words: F) -> (Result<Status, NotReached<Fault>>, Script) {
    let mut script = Script::new();
    let unit = call(&shipped("gd350"), &Record::default(), false);
    let came = script.carry_out(InTime(words), |line| async move { unit.wait_until_stopped(&line, SECOND).await });
    (came, script)
}

/// What it does that runs up to 50 Hz by 0.1 Hz a millisecond.
fn runs_up(address: u16, millis: u64) -> Option<u16> {
    match address {
        STATE => Some(FORWARD),
        OUTPUT => u16::try_from(millis * 10).ok().map(|counts| counts.min(5000)),
        SETPOINT => Some(5000),
        _ => None,
    }
}

/// One that keeps its speed, whatever its setpoint is.
fn keeps(counts: u16) -> impl Fn(u16, u64) -> Option<u16> + Copy {
    move |address, millis| if address == OUTPUT { Some(counts) } else { runs_up(address, millis) }
}

#[test]
fn a_motor_is_looked_at_until_it_has_its_speed() {
    let (status, script) = until(runs_up, None, SECOND);
    assert!(status.unwrap().frequency.is_some_and(|frequency| frequency >= 49.9));
    let took = script.now.saturating_duration_since(Instant::ZERO);
    assert!(Duration::from_millis(499) <= took && took < Duration::from_millis(530), "{took:?}");
}

#[test]
fn a_speed_that_is_named_counts_and_not_the_setpoint() {
    assert!(until(keeps(2000), Some(20.0), Duration::ZERO).0.is_ok());
    assert!(matches!(until(keeps(2000), None, SECOND).0, Err(NotReached::Late(_))));
}

/// In binary, 49.9 is a little more than 0.1 off 50.
#[test]
fn a_motor_that_is_off_by_the_tolerance_has_its_speed() {
    for (counts, has_it) in [(4989, false), (4990, true), (5010, true), (5011, false)] {
        for hz in [None, Some(50.0)] {
            assert_eq!(until(keeps(counts), hz, Duration::ZERO).0.is_ok(), has_it, "{counts} {hz:?}");
        }
    }
}

#[test]
fn a_motor_that_does_not_run_has_no_speed() {
    let stands = |address: u16, _: u64| (address == STATE).then_some(STOPPED);
    let (status, script) = until(stands, Some(0.0), SECOND);
    assert!(matches!(status, Err(NotReached::Late(status)) if status.frequency == Some(0.0)));
    let took = script.now.saturating_duration_since(Instant::ZERO);
    assert!(SECOND <= took && took < SECOND + Duration::from_millis(30), "{took:?}");
}

#[test]
fn one_look_is_made_where_there_is_no_time() {
    let (status, script) = until(runs_up, None, Duration::ZERO);
    assert!(matches!(status, Err(NotReached::Late(_))));
    assert_eq!(script.places().iter().filter(|&&place| place == u32::from(OUTPUT)).count(), 1);
}

#[test]
fn a_drive_that_trips_ends_the_wait() {
    let number = |address: u16, _: u64| (address == FAULT).then_some(7);
    let state = |address: u16, _: u64| (address == STATE).then_some(TRIPPED);
    for (came, _) in [until(number, None, SECOND), until(state, None, SECOND), until_stopped(number)] {
        assert!(matches!(came, Err(NotReached::Tripped { before: true, .. })), "{came:?}");
    }
    let (came, script) = until(
        |address, millis| match address {
            FAULT if millis > 100 => Some(7),
            _ => runs_up(address, millis),
        },
        None,
        SECOND,
    );
    assert!(matches!(came, Err(NotReached::Tripped { before: false, .. })));
    assert!(script.now < Instant::ZERO + Duration::from_millis(140));
}

#[test]
fn a_motor_stands_once_its_output_has_no_frequency() {
    let coasts = |address: u16, millis: u64| match address {
        STATE => Some(if millis < 300 { FORWARD } else { STOPPED }),
        OUTPUT => Some(if millis < 600 { 6 } else { 5 }),
        _ => None,
    };
    let (status, script) = until_stopped(coasts);
    assert_eq!(status.unwrap().frequency, Some(0.05));
    assert!(script.now >= Instant::ZERO + Duration::from_millis(600));
    assert!(matches!(until_stopped(runs_up).0, Err(NotReached::Late(_))));
}

/// GD350 operation manual, section 9.4.5: 2100H is 1 while it turns forward, and 2 in reverse.
#[test]
fn a_motor_that_is_reversed_is_waited_for_until_it_turns_the_other_way() {
    // From 12 Hz forward through its new speed, 8 Hz, to a standstill after 600 ms, and on to 8 Hz in reverse.
    let reverses = |address, millis: u64| match address {
        STATE => Some(if millis < 600 { FORWARD } else { 2 }),
        OUTPUT => u16::try_from(1200_u64.abs_diff(millis * 2).min(if millis < 600 { 1200 } else { 800 })).ok(),
        SETPOINT => Some(800),
        _ => None,
    };
    let wait = |started: Option<State>| {
        let (mut script, record) = (Script::new(), Record::default());
        record.note(|sent| sent.started_as = started);
        let unit = call(&shipped("gd350"), &record, false);
        let came = script
            .carry_out(InTime(reverses), |line| async move { unit.wait_for_speed(&line, None, 0.5, 2 * SECOND).await });
        came.map(|status| (status.look.state, status.frequency)).map_err(|why| why.to_string())
    };
    let (state, frequency) = wait(Some(State::Reverse)).unwrap();
    assert_eq!(state, State::Reverse);
    assert!(frequency.is_some_and(|frequency| frequency >= 7.5));
    // Who did not start it, or by a jog, is not kept waiting.
    for started in [None, Some(State::Unknown), Some(State::Forward)] {
        assert_eq!(wait(started).unwrap().0, State::Forward, "{started:?}");
    }
    // One that somebody else turned round is not as it was started.
    let (mut script, record) = (Script::new(), Record::default());
    record.note(|sent| sent.started_as = Some(State::Reverse));
    let unit = call(&shipped("gd350"), &record, false);
    let came = script
        .carry_out(InTime(keeps(5000)), |line| async move { unit.wait_for_speed(&line, None, 0.1, SECOND).await });
    assert!(matches!(came, Err(NotReached::Late(ref status)) if status.look.state == State::Forward));
}

#[test]
fn what_is_not_told_is_not_waited_for() {
    let untold = |name, is_trusted, hz| {
        let mut script = Script::new();
        let family = shipped(name);
        let unit = call(&family, &Record::default(), is_trusted);
        let came = script
            .carry_out(like(&family, &[]), |line| async move { unit.wait_for_speed(&line, hz, 0.1, SECOND).await });
        assert_eq!((&script.asked[..], script.now), (&[][..], Instant::ZERO));
        came.unwrap_err()
    };
    assert!(matches!(untold("sunfar-e300", false, None), NotReached::Untold { role: "setpoint", why: None }));
    // Of the SAJ 8000M the state is printed, and the frequencies are not.
    assert!(matches!(untold("saj8000m", false, None), NotReached::Untold { role: "frequency", why: Some(_) }));
    // Of the CHV100 no state word is known.
    assert!(matches!(untold("chv100", true, None), NotReached::Unseen(_)));
}

#[test]
fn a_line_that_fails_ends_the_wait() {
    let unit = call(&shipped("gd350"), &Record::default(), false);
    let silent = |_: Read| fails(Cause::NoAnswer);
    let came = Script::new().carry_out(silent, |line| async move { unit.wait_until_stopped(&line, SECOND).await });
    assert!(matches!(came, Err(NotReached::NotRead(NotRead::Failed(_)))));
}
