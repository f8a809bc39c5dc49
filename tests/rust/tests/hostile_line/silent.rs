//! Units that were silent, on a line that others use: how long their callers wait, and what counts as a sign of life.

use std::time::Duration;

use drivebus_line::{CallError, CallOptions, Failure, Priority};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Request};

use crate::scripted::{Pieces, Rig, at_once, millis, right, unit};

/// What becomes of the question of this number that unit 1 is asked; unit 2 answers all.
fn rig(mut script: impl FnMut(u16, &[u8]) -> Pieces + Send + 'static) -> Rig {
    let rig = Rig::new(move |_, request| match request {
        [1, 3, high, low, ..] => script(u16::from_be_bytes([*high, *low]), request),
        _ => at_once(&right(request)),
    });
    others(&rig).unwrap();
    rig
}

/// Somebody else uses the line.
fn others(rig: &Rig) -> Result<(), Box<CallError>> {
    let read = Request::read(7, 1).unwrap();
    rig.call(unit(2).into(), &read, CallOptions::default(), &mut || false, &mut |_| ()).map(|_| ())
}

/// Asks unit 1; whether the question of this number reached it, and how the call ended.
fn ask(rig: &Rig, number: u16, options: CallOptions, given_up: bool) -> (bool, Result<(), Box<CallError>>) {
    let read = Request::read(number, 1).unwrap();
    let result = rig.call(unit(1).into(), &read, options, &mut || given_up, &mut |_| ()).map(|_| ());
    let question = Adu::request(unit(1).into(), &read);
    let is_sent = |sent: &Vec<u8>| sent[..4] == question.as_bytes()[..4];
    (rig.wire.lock().unwrap().sent.iter().any(is_sent), result)
}

fn once(rig: &Rig, number: u16) -> (bool, Result<(), Box<CallError>>) {
    ask(rig, number, CallOptions::default(), false)
}

/// A unit that was silent twice, and then does what `script` says.
fn dead(script: impl FnMut(u16, &[u8]) -> Pieces + Send + 'static) -> Rig {
    let rig = rig(script);
    for number in 0..2 {
        let (sent, result) = once(&rig, number);
        assert!(sent && matches!(result.unwrap_err().failure, Failure::NoAnswer { .. }));
    }
    others(&rig).unwrap();
    rig
}

fn is_not_asked(result: &Result<(), Box<CallError>>) -> bool {
    matches!(result, Err(error) if matches!(error.failure, Failure::NotAsked { .. }) && error.sent.is_none())
}

/// No longer than by one more silence, with all its retries; who polls has others to ask.
#[test]
fn a_caller_waits_for_a_dead_unit_as_long_as_for_a_silent_one() {
    let polls = Some(Priority::Poll);
    for (timeout, retries, priority, waits) in
        [(100, 0, None, 100), (100, 2, None, 300), (300, 1, None, 600), (300, 1, polls, 0)]
    {
        let rig = dead(|_, _| Vec::new());
        let (before, counted) = (rig.now(), rig.bus.stats().units[&unit(1)].not_asked);
        let options = CallOptions::new().timeout(millis(timeout)).retries(retries).priority(priority);
        let (sent, result) = ask(&rig, 2, options, false);
        assert!(!sent && is_not_asked(&result), "{result:?}");
        assert_eq!(rig.since(before), millis(waits), "{timeout} ms, {retries} retries, {priority:?}");
        assert_eq!(rig.bus.stats().units[&unit(1)].not_asked, counted + 1);
    }
}

/// A second after its last silence it is asked, once.
#[test]
fn who_waits_long_enough_asks_a_dead_unit_again() {
    let rig = dead(|number, request| if number < 2 { Vec::new() } else { at_once(&right(request)) });
    let before = rig.now();
    let options = CallOptions::new().retries(3);
    let (_, result) = ask(&rig, 2, options, false);
    result.unwrap();
    let waited = rig.since(before);
    assert!(waited > millis(800) && waited < millis(1_200), "{waited:?}");
}

#[test]
fn who_gives_up_does_not_wait_for_a_dead_unit() {
    let rig = dead(|_, _| Vec::new());
    let before = rig.now();
    let (sent, result) = ask(&rig, 2, CallOptions::default(), true);
    assert_eq!((sent, result.unwrap_err().failure), (false, Failure::Interrupted));
    assert!(rig.since(before) <= millis(50));
}

/// Nobody has a line that is not there, and whoever asks finds out whether it came back.
#[test]
fn a_dead_unit_keeps_nobody_from_opening_a_port_that_was_lost() {
    let rig = dead(|number, request| if number < 2 { Vec::new() } else { at_once(&right(request)) });
    rig.wire.lock().unwrap().vanish_after_sending = true;
    others(&rig).unwrap_err();
    let (sent, result) = once(&rig, 2);
    assert!(sent && result.is_ok(), "{result:?}");
    assert_eq!(rig.wire.lock().unwrap().opened, 2);
}

#[test]
fn a_unit_that_refuses_is_not_dead() {
    let refusal = Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS);
    let refusal = Adu::answer(unit(1), &refusal).as_bytes().to_vec();
    let rig = rig(move |_, _| at_once(&refusal));
    for number in 0..5 {
        let (sent, result) = once(&rig, number);
        assert!(sent && matches!(result.unwrap_err().failure, Failure::Refused { .. }));
    }
}

fn damaged(request: &[u8]) -> Vec<u8> {
    let mut answer = right(request);
    answer[4] ^= 1;
    answer
}

/// Two silences in a row make it dead, and an answer that came damaged is no silence.
#[test]
fn a_unit_that_is_heard_between_two_silences_is_not_dead() {
    let rig = rig(|number, request| match number {
        1 => at_once(&damaged(request)),
        0 | 2 => Vec::new(),
        _ => at_once(&right(request)),
    });
    for number in 0..3 {
        assert!(once(&rig, number).1.is_err(), "{number}");
    }
    let (sent, result) = once(&rig, 3);
    assert!(sent && result.is_ok(), "{result:?}");
}

/// Who gave up while it waited has heard nothing.
#[test]
fn giving_up_between_two_silences_is_no_sign_of_life() {
    let rig = rig(|_, _| Vec::new());
    once(&rig, 0).1.unwrap_err();
    let (sent, result) = ask(&rig, 1, CallOptions::new().in_doubt(true), true);
    assert_eq!((sent, result.unwrap_err().failure), (true, Failure::Interrupted));
    once(&rig, 2).1.unwrap_err();
    let (sent, result) = ask(&rig, 3, CallOptions::new().timeout(Duration::ZERO), false);
    assert!(!sent && is_not_asked(&result), "{result:?}");
}
