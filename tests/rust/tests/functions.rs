//! Answers to functions without a name in the core, held against `tests/vectors/functions.toml`.
//!
//! Python runs the same file through `decode_answer` in `tests/python/test_vectors.py`.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::PathBuf;

use drivebus_rtu::{Answer, AnswerLength, Request};
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
    wrong: Vec<String>,
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

proptest! {
    /// §6.1, §6.2: the byte count is the quantity by eight, and one more where that leaves a rest.
    #[test]
    fn bits_have_one_length_of_answer(function in 1_u8..=2, address: u16, count in 1_u16..=2_000, bytes in 0_u8..=251) {
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
