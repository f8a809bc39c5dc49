//! The table on which masters are compared: one row, one kind of reply, one outcome.

use std::time::Duration;

use drivebus_line::{CallError, Failure};
use drivebus_rtu::{Adu, Answer, AnswerError, ExceptionCode, Request};

use crate::scripted::{FORMAT, Pieces, Rig, after, at_once, lumps, millis, right, unit};

/// Longer than the time-out of half a second: the reply comes while the next request is out.
const LATE: Duration = millis(503);

type Replies = fn(usize, &[u8]) -> Pieces;
/// What the unit does, how it replies, two reads (address and count), how they end.
type Row = (&'static str, Replies, [(u16, u16); 2], [Ends; 2]);

/// How a call ends.
#[derive(Debug, PartialEq)]
enum Ends {
    Words(Vec<u16>),
    NoAnswer,
    /// At once, with the number of words that came.
    Short(usize),
}

fn ends(result: Result<Vec<u16>, Box<CallError>>) -> Ends {
    match result {
        Ok(words) => Ends::Words(words),
        Err(error) => match error.failure {
            Failure::NoAnswer { .. } => Ends::NoAnswer,
            Failure::Wrong(AnswerError::Count { came, .. }) => Ends::Short(came),
            other => panic!("{other:?}"),
        },
    }
}

fn joined(pieces: [&[u8]; 2]) -> Vec<u8> {
    pieces.concat()
}

fn late_once(number: usize, request: &[u8]) -> Pieces {
    if number == 0 { after(LATE, &right(request)) } else { at_once(&right(request)) }
}

fn other_unit(request: &[u8]) -> Vec<u8> {
    let count = u16::from_be_bytes([request[4], request[5]]);
    let words = vec![0xBAD; usize::from(count)];
    Adu::answer(unit(2), &Answer::read(&words).unwrap()).as_bytes().to_vec()
}

fn function_04(request: &[u8]) -> Vec<u8> {
    let count = request[5];
    let mut pdu = vec![0x04, 2 * count];
    pdu.extend(vec![0xBA; 2 * usize::from(count)]);
    Adu::answer(unit(1), &Answer::custom(&pdu).unwrap()).as_bytes().to_vec()
}

#[test]
fn reads() {
    use Ends::*;
    #[rustfmt::skip]
    let table: [Row; 11] = [
        ("the reply comes during the next read", late_once, [(100, 1), (200, 1)], [NoAnswer, Words(vec![200])]),
        ("the same, and the reads differ in length", late_once, [(100, 2), (200, 1)], [NoAnswer, Words(vec![200])]),
        ("00 before the reply", |_, request| at_once(&joined([&[0x00], &right(request)])),
            [(100, 1), (200, 2)], [Words(vec![100]), Words(vec![200, 201])]),
        ("FF before the reply", |_, request| at_once(&joined([&[0xFF], &right(request)])),
            [(100, 1), (200, 2)], [Words(vec![100]), Words(vec![200, 201])]),
        ("00 after the reply", |_, request| at_once(&joined([&right(request), &[0x00]])),
            [(100, 1), (200, 2)], [Words(vec![100]), Words(vec![200, 201])]),
        ("00 a while after the reply", |_, request| {
            [at_once(&right(request)), after(millis(1), &joined([&right(request), &[0x00]])[7..])].concat()
        }, [(100, 1), (200, 1)], [Words(vec![100]), Words(vec![200])]),
        ("fewer words than asked for", |number, request| {
            let shorter = Adu::request(unit(1).into(), &Request::read(100, 1).unwrap());
            at_once(&right(if number == 0 { shorter.as_bytes() } else { request }))
        }, [(100, 2), (200, 1)], [Short(1), Words(vec![200])]),
        ("function 04, then the reply", |_, request| {
            if request[1] == 3 {
                [at_once(&function_04(request)), after(millis(20), &right(request))].concat()
            } else {
                at_once(&right(request))
            }
        }, [(100, 1), (200, 1)], [Words(vec![100]), Words(vec![200])]),
        ("another unit, then the reply", |_, request| {
            [at_once(&other_unit(request)), after(millis(20), &right(request))].concat()
        }, [(100, 1), (200, 1)], [Words(vec![100]), Words(vec![200])]),
        ("another unit only", |_, request| {
            if request[1] == 3 { at_once(&other_unit(request)) } else { at_once(&right(request)) }
        }, [(100, 1), (200, 1)], [NoAnswer, NoAnswer]),
        ("four bytes every 16 ms", |_, request| lumps(millis(5), &right(request)),
            [(100, 1), (200, 16)], [Words(vec![100]), Words((200..216).collect())]),
    ];
    for (what, replies, asked, expected) in table {
        let rig = Rig::new(replies);
        let came = asked.map(|(address, count)| ends(rig.read(address, count)));
        assert_eq!(came, expected, "{what}");
    }
}

#[test]
fn a_late_reply_is_counted() {
    let rig = Rig::new(late_once);
    rig.read(100, 1).unwrap_err();
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    let stats = rig.bus.stats();
    assert_eq!(
        (stats.total.late, stats.total.resyncs, stats.total.foreign, stats.total.noise_bytes),
        (1, 1, 0, 0),
        "{stats:?}"
    );
}

#[test]
fn a_late_reply_that_is_queued_already_is_counted_and_dropped() {
    let rig = Rig::new(late_once);
    rig.read(100, 1).unwrap_err();
    rig.pass(millis(100));
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.bus.stats().total.late, 1);
}

/// Nothing is in doubt here, but what came before the question cannot be its answer.
#[test]
fn what_is_queued_before_a_request_is_never_its_answer() {
    let rig = Rig::new(|_, request| [at_once(&right(request)), after(millis(20), &right(request))].concat());
    assert_eq!(rig.read(100, 1).unwrap(), [100]);
    rig.pass(millis(100));
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.bus.stats().total.late, 1);
}

#[test]
fn both_writes_are_told_truly() {
    let (first, second) = (Request::write(100, 5), Request::write(200, 6));
    let frame = Adu::request(unit(1).into(), &first);
    let rig = Rig::new(move |_, request| {
        after(if request == frame.as_bytes() { LATE } else { Duration::ZERO }, &right(request))
    });
    let error = rig.ask(&first).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { .. }) && error.sent.is_some(), "{error}");
    rig.ask(&second).unwrap();
    assert_eq!((rig.sent(&first), rig.sent(&second)), (1, 1));
}

#[test]
fn a_late_reply_does_not_confirm_a_write_that_the_unit_missed() {
    let mut writes = 0;
    let rig = Rig::new(move |_, request| {
        writes += u32::from(request[1] == 6);
        match (request[1], writes) {
            (6, 1) => after(LATE, &right(request)),
            (6, _) => Vec::new(),
            _ => at_once(&right(request)),
        }
    });
    rig.ask(&Request::write(100, 5)).unwrap_err();
    assert!(matches!(rig.ask(&Request::write(100, 5)).unwrap_err().failure, Failure::NoAnswer { .. }));
}

#[test]
fn a_refusal_is_told_at_its_last_byte() {
    let refusal = Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS);
    let frame = Adu::answer(unit(1), &refusal).as_bytes().to_vec();
    let rig = Rig::new(move |_, _| at_once(&frame));
    let error = rig.read(100, 1).unwrap_err();
    assert!(matches!(error.failure, Failure::Refused { function: 3, code: ExceptionCode::ILLEGAL_ADDRESS }));
    let took = error.ended.unwrap().saturating_duration_since(error.sent.unwrap());
    assert_eq!(took, FORMAT.chars(8) + FORMAT.t35() + FORMAT.chars(5));
}
