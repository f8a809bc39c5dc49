//! An adapter that sends our own bytes back: its echo is never the unit's answer.

use std::time::Duration;

use drivebus_line::{CallOptions, Failure};
use drivebus_rtu::{Adu, Answer, AnswerLength, Destination, IdentificationLevel, Request};

use crate::scripted::{FORMAT, Pieces, Rig, at_once, lumps, millis, right, unit};

type Echo = fn(usize, &[u8]) -> Pieces;

fn whole(_: usize, sent: &[u8]) -> Pieces {
    vec![(Duration::ZERO, sent.to_vec())]
}

/// How adapters send back what was sent.
const ECHOES: [(&str, Echo); 4] = [
    ("whole", whole),
    ("a glitch when the direction is switched", |_, sent| vec![(Duration::ZERO, [&[0x00], sent].concat())]),
    ("a glitch that looks like the unit", |_, sent| vec![(Duration::ZERO, [&sent[..1], sent].concat())]),
    ("in lumps", |_, sent| lumps(Duration::ZERO, sent)),
];

/// What can be asked of unit 1, and whether its answer repeats the request.
fn requests() -> Vec<(&'static str, Request<'static>)> {
    vec![
        ("read", Request::read(0x2100, 1).unwrap()),
        ("read whose echo begins like its answer", Request::read(0x2000, 16).unwrap()),
        ("06H", Request::write(0x2001, 1000)),
        ("10H", Request::write_many(0x2000, &[1, 1000]).unwrap()),
        ("08H", Request::echo(0xBEEF)),
        ("0FH", Request::write_coils(0x13, &[1, 0, 1]).unwrap()),
        ("11H", Request::report_server_id()),
        ("16H", Request::mask_write(4, 0xF2, 0x25)),
        ("17H", Request::read_write(3, 6, 0x0E, &[0xFF, 0xFF]).unwrap()),
        ("2BH", Request::read_identification(IdentificationLevel::Extended, 0)),
        ("05H", Request::custom(&[0x05, 0, 1, 0xFF, 0], AnswerLength::BySilence).unwrap()),
        ("05H of known length", Request::custom(&[0x05, 0, 1, 0xFF, 0], AnswerLength::Bytes(5)).unwrap()),
    ]
}

/// The unit answers after the echo is over, however slowly the adapter delivers it.
fn answering(_: usize, request: &[u8]) -> Pieces {
    vec![(millis(80), right(request))]
}

#[test]
fn every_request_is_answered_by_the_unit() {
    for (how, echo) in ECHOES {
        for (what, request) in requests() {
            let rig = Rig::echoing(echo, answering);
            for round in 0..3 {
                assert!(rig.ask(&request).is_ok(), "{what}, echo {how}, round {round}");
            }
        }
    }
}

#[test]
fn no_echo_is_taken_for_the_answer_of_a_deaf_unit() {
    for (how, echo) in ECHOES {
        for (what, request) in requests() {
            let rig = Rig::echoing(echo, |_, _| Vec::new());
            for round in 0..4 {
                let error = rig.ask(&request).expect_err(&format!("{what}, echo {how}, round {round}"));
                assert!(matches!(error.failure, Failure::NoAnswer { .. }), "{what}, echo {how}: {error}");
            }
        }
    }
}

#[test]
fn a_broadcast_does_not_hide_that_the_adapter_echoes() {
    for request in [Request::write(0x2000, 5), Request::write_many(0x2000, &[5]).unwrap()] {
        let rig = Rig::echoing(whole, |_, _| Vec::new());
        rig.call(Destination::Broadcast, &request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
        let stats = rig.bus.stats();
        assert_eq!((stats.total.own_echoes, stats.total.late), (1, 0));
        rig.ask(&Request::write(0x2001, 7)).unwrap_err();
    }
}

/// The probe that ends a quarantine is a request whose echo looks like its answer.
#[test]
fn an_interrupted_first_call_does_not_let_the_echo_end_the_quarantine() {
    // The adapter delivers late, so that the call is given up before its echo is there.
    let rig = Rig::echoing(
        |number, sent| vec![(if number == 0 { millis(60) } else { Duration::ZERO }, sent.to_vec())],
        |number, request| if number == 0 { vec![(millis(700), right(request))] } else { Vec::new() },
    );
    let request = Request::read(100, 1).unwrap();
    let error =
        rig.call(unit(1).into(), &request, CallOptions::default(), &mut || true, &mut |_: Answer<'_>| ()).unwrap_err();
    assert_eq!(error.failure, Failure::Interrupted);
    let error = rig.ask(&Request::write(0x2001, 7)).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { .. }), "{error}");
    assert_eq!(error.sent, None, "the unit has not returned an echo, so the write must not go out");
}

#[test]
fn another_adapter_at_the_same_port_is_looked_at_anew() {
    let rig = Rig::echoing(
        |number, sent| if number < 2 { Vec::new() } else { whole(number, sent) },
        |number, request| if number < 1 { at_once(&right(request)) } else { Vec::new() },
    );
    assert_eq!(rig.read(100, 1).unwrap(), [100]);
    rig.wire.lock().unwrap().vanish_after_sending = true;
    rig.read(100, 1).unwrap_err();
    let write = Request::write(0x2001, 7);
    for _ in 0..3 {
        rig.ask(&write).expect_err("its own echo");
    }
}

#[test]
fn the_answer_is_still_there_at_its_last_byte() {
    let rig = Rig::echoing(whole, |_, request| at_once(&right(request)));
    for request in [Request::write(0x2001, 7), Request::read(100, 16).unwrap()] {
        let done = rig.call(unit(1).into(), &request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
        let frame = Adu::request(unit(1).into(), &request);
        let answer = u32::try_from(right(frame.as_bytes()).len()).unwrap();
        let shortest = FORMAT.chars(8) + FORMAT.t35() + FORMAT.chars(answer);
        assert_eq!(done.ended.saturating_duration_since(done.sent), shortest);
    }
}

/// What is left of an echo that lost some bytes is noise in front of the answer, and no sign of an adapter without echo.
#[test]
fn an_echo_that_lost_bytes_does_not_pass_for_none() {
    for lost in 1..=5 {
        let rig = Rig::echoing(
            move |number, sent| vec![(Duration::ZERO, if number == 0 { sent[lost..].to_vec() } else { sent.to_vec() })],
            |_, request| if request[1] == 3 { vec![(millis(80), right(request))] } else { Vec::new() },
        );
        assert_eq!(rig.read(100, 1).unwrap(), [100]);
        let error = rig.ask(&Request::write(0x2001, 7)).expect_err("its own echo");
        assert!(matches!(error.failure, Failure::NoAnswer { .. }), "{lost} bytes lost: {error}");
    }
}

/// An adapter that was taken for one without echo is known as soon as it sends back what no unit answers.
#[test]
fn an_adapter_that_begins_to_echo_is_noticed() {
    let rig = Rig::echoing(
        |number, sent| if number < 2 { Vec::new() } else { whole(number, sent) },
        |_, request| if request[1] == 3 { vec![(millis(80), right(request))] } else { Vec::new() },
    );
    for address in 0..3 {
        assert_eq!(rig.read(address, 1).unwrap(), [address]);
    }
    rig.ask(&Request::write(0x2001, 7)).expect_err("its own echo");
}
