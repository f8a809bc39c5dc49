//! Answers beside those of 03H, 06H, 08H/0000 and 10H, held against `tests/vectors/functions.toml`.
//!
//! Python runs the same file through `decode_answer` in `tests/python/test_vectors.py`.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::PathBuf;

use drivebus_rtu::{
    Adu, Answer, AnswerLength, Duration, Event, Frame, Instant, Master, Request, SerialFormat, Slave, SlaveEvent,
    UnitAddress,
};
use proptest::prelude::*;
use serde::Deserialize;

#[derive(Deserialize)]
struct Document {
    function: Vec<Function>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Function {
    what: String,
    #[serde(rename = "source")]
    _source: String,
    request: String,
    answer: String,
    #[serde(default)]
    values: Vec<u16>,
    wrong: Vec<String>,
}

impl Function {
    /// Whether it reads a table or writes a coil.
    fn is_of_a_table(&self) -> bool {
        matches!(self.request.get(..2), Some("01" | "02" | "04" | "05"))
    }
}

fn functions() -> Vec<Function> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../vectors/functions.toml");
    toml::from_str::<Document>(&fs::read_to_string(path).unwrap()).unwrap().function
}

fn bytes(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

#[test]
fn what_the_specification_prints_is_taken_and_what_it_excludes_is_not() {
    for Function { what, request, answer, wrong, .. } in functions() {
        let (request, answer) = (bytes(&request), bytes(&answer));
        let asked = Request::parse(&request).unwrap();
        assert!(asked.judge(&answer).is_ok(), "{what}");
        for wrong in wrong {
            assert!(asked.judge(&bytes(&wrong)).is_err(), "{what}: {wrong}");
        }
    }
}

#[test]
fn who_gives_the_length_of_the_answer_is_held_to_that_alone() {
    for Function { what, request, wrong, .. } in functions() {
        let request = bytes(&request);
        for wrong in wrong.iter().map(|wrong| bytes(wrong)) {
            let length = AnswerLength::Bytes(u8::try_from(wrong.len()).unwrap());
            let taken = Request::custom(&request, length).unwrap();
            if wrong[0] == request[0] {
                assert!(matches!(taken.judge(&wrong), Ok(Answer::Custom { .. })), "{what}");
            }
        }
    }
}

/// `bytes` as they may arrive: whole, byte by byte, with noise after them.
fn three_ways(bytes: &[u8], mut check: impl FnMut(&mut dyn FnMut(&mut dyn FnMut(&[u8])))) {
    for (chunk, after) in [(256, &[][..]), (1, &[]), (256, &[0x00, 0x00])] {
        let image = [bytes, after].concat();
        check(&mut |receive| image.chunks(chunk).for_each(receive));
    }
}

#[test]
fn a_unit_hears_what_the_specification_prints_however_it_arrives() {
    let unit = UnitAddress::new(17).unwrap();
    for Function { what, request, .. } in functions().iter().filter(|function| function.is_of_a_table()) {
        let pdu = bytes(request);
        let asked = Request::parse(&pdu).unwrap();
        assert!(!matches!(asked, Request::Custom { .. }), "{what}");
        let frame = Adu::request(unit.into(), &asked);
        assert_eq!(Frame::parse(frame.as_bytes()).unwrap().pdu(), pdu, "{what}");
        three_ways(frame.as_bytes(), |arrive| {
            let mut slave = Slave::new(unit, &SerialFormat::DEFAULT);
            arrive(&mut |piece| assert_eq!(slave.receive(Instant::ZERO, piece), piece.len()));
            let heard = slave.poll(Instant::ZERO);
            assert_eq!(heard, Some(SlaveEvent::Request { request: asked, broadcast: false }), "{what}");
        });
    }
}

#[test]
fn a_master_takes_what_the_specification_prints_however_it_arrives() {
    let unit = UnitAddress::new(17).unwrap();
    for Function { what, request, answer, values, .. } in functions().iter().filter(|function| function.is_of_a_table())
    {
        let (asked, pdu) = (bytes(request), bytes(answer));
        let asked = Request::parse(&asked).unwrap();
        let frame = Adu::answer(unit, &Answer::custom(&pdu).unwrap());
        three_ways(frame.as_bytes(), |arrive| {
            let mut master = Master::new(&SerialFormat::DEFAULT);
            let now = Instant::ZERO + Duration::from_secs(2);
            master.begin(now, unit.into(), &asked, Duration::from_millis(500)).unwrap();
            let now = master.deadline().unwrap_or(now);
            assert!(matches!(master.poll(now), Some(Event::Transmit(_))), "{what}");
            master.sent(now);
            let later = now + Duration::from_millis(10);
            let mut came = None;
            arrive(&mut |piece| {
                master.receive(later, piece);
                match master.poll(later) {
                    Some(Event::Answer(Answer::Read { words, .. })) => came = Some(words.iter().collect::<Vec<_>>()),
                    Some(Event::Answer(Answer::WriteCoil { .. })) => came = Some(Vec::new()),
                    Some(other) => panic!("{what}: {other:?}"),
                    None => {}
                }
            });
            assert_eq!(came.as_ref(), Some(values), "{what}");
        });
    }
}

proptest! {
    /// §6.1, §6.2: the byte count is the quantity by eight, and one more where that leaves a rest.
    #[test]
    fn bits_have_one_length_of_answer(function in 1_u8..=2, address in 0_u16..=63_536, count in 1_u16..=2_000, bytes in 0_u8..=251) {
        let [a1, a0] = address.to_be_bytes();
        let [c1, c0] = count.to_be_bytes();
        let request = [function, a1, a0, c1, c0];
        let asked = Request::parse(&request).unwrap();
        let right = u8::try_from(count / 8 + u16::from(count % 8 > 0)).unwrap();
        for came in [bytes, right] {
            let answer = [&[function, came][..], &vec![0x55; usize::from(came)]].concat();
            prop_assert_eq!(asked.judge(&answer).is_ok(), came == right);
        }
    }

    /// Whatever is asked, judging any answer ends.
    #[test]
    fn no_request_and_no_answer_is_too_odd(
        request in proptest::collection::vec(any::<u8>(), 1..253),
        answer in proptest::collection::vec(any::<u8>(), 0..253),
    ) {
        if let Ok(request) = Request::parse(&request) {
            let _ = request.judge(&answer);
        }
    }
}
