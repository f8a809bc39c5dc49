//! Invariant: what parses emits the same bytes again, what is built parses to itself, and the judge of the
//! specification agrees on every frame, request, answer and CRC.

use drivebus_rtu::crc::{START, update};
use drivebus_rtu::{Adu, Answer, AnswerLength, Destination, Frame, FrameError, Request, UnitAddress, Words, crc16};

use crate::oracle::{self, Asked, Length, Verdict};
use crate::stream::Input;

/// See the file's first lines. The input: where to cut, then the bytes.
pub fn frame(data: &[u8]) {
    let mut input = Input::new(data);
    let cut = usize::from(input.word());
    let bytes = input.bytes(usize::MAX);
    let (head, tail) = bytes.split_at(cut % (bytes.len() + 1));

    assert_eq!(crc16(bytes), oracle::crc(bytes));
    assert_eq!(update(update(START, head), tail), oracle::crc(bytes));

    check_frame(bytes);
    check_frame(&oracle::sealed(bytes));
    check_pdu(head);
    check_pdu(tail);
    check_built(bytes);
    check_verdict(head, tail);
}

fn check_frame(bytes: &[u8]) {
    match (Frame::parse(bytes), oracle::frame(bytes)) {
        (Ok(frame), Some((address, pdu))) => {
            assert_eq!((frame.address(), frame.pdu(), frame.as_bytes()), (address, pdu, bytes));
            check_emission(bytes, address, pdu);
        }
        (Err(FrameError::TooShort { len }), None) => assert!(len == bytes.len() && len < 4),
        (Err(FrameError::TooLong { len }), None) => assert!(len == bytes.len() && len > 256),
        (Err(error @ FrameError::Crc { computed, received }), None) => {
            let (body, end) = bytes.split_at(bytes.len() - 2);
            assert_eq!((computed, received.to_le_bytes().as_slice()), (oracle::crc(body), end));
            assert!(computed != received && !error.to_string().is_empty());
        }
        (parsed, judged) => assert!(parsed.is_err() && judged.is_none(), "{parsed:?}, {judged:?}"),
    }
}

/// The frame `bytes`, taken apart, gives the same bytes again.
fn check_emission(bytes: &[u8], address: u8, pdu: &[u8]) {
    if let (Ok(destination), Ok(request)) = (Destination::from_wire(address), Request::parse(pdu)) {
        assert_eq!(Adu::request(destination, &request).as_bytes(), bytes);
    }
    if let (Ok(unit), Ok(answer)) = (UnitAddress::new(address), Answer::parse(pdu)) {
        assert_eq!(Adu::answer(unit, &answer).as_bytes(), bytes);
    }
}

fn check_pdu(pdu: &[u8]) {
    match Request::parse(pdu) {
        Ok(request) => {
            assert!(oracle::is_request(pdu), "{request:?}");
            assert_eq!(request.function(), pdu[0]);
            let adu = Adu::request(Destination::Broadcast, &request);
            assert_eq!(oracle::frame(adu.as_bytes()), Some((0, pdu)));
        }
        Err(error) => assert!(!oracle::is_request(pdu) && !error.to_string().is_empty(), "{error}"),
    }
    match Answer::parse(pdu) {
        Ok(answer) => {
            assert!(oracle::is_answer(pdu), "{answer:?}");
            let adu = Adu::answer(UnitAddress::MAX, &answer);
            assert_eq!(oracle::frame(adu.as_bytes()), Some((247, pdu)));
        }
        Err(error) => assert!(!oracle::is_answer(pdu) && !error.to_string().is_empty(), "{error}"),
    }
}

/// Whatever the constructors take comes back from its own bytes.
fn check_built(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let (address, second) = (input.word(), input.word());
    let words: Vec<u16> = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    let requests = [
        Request::read(address, second),
        Ok(Request::write(address, second)),
        Ok(Request::echo(second)),
        Request::write_many(address, &words),
        Request::custom(bytes, AnswerLength::BySilence),
    ];
    for request in requests.into_iter().flatten() {
        let adu = Adu::request(Destination::Broadcast, &request);
        let (_, pdu) = oracle::frame(adu.as_bytes()).unwrap_or_default();
        // A PDU of the caller's own may be one that has a name, or a spoilt one.
        match (request, Request::parse(pdu)) {
            (Request::Custom { pdu: own, .. }, parsed) => {
                assert_eq!((own, parsed.is_ok()), (pdu, oracle::is_request(pdu)));
            }
            (built, parsed) => assert_eq!(parsed, Ok(built)),
        }
    }
    if let Ok(built) = Answer::read(&words) {
        let adu = Adu::answer(UnitAddress::MIN, &built);
        let (_, pdu) = oracle::frame(adu.as_bytes()).unwrap_or_default();
        assert_eq!(Answer::parse(pdu), Ok(built));
        assert_eq!(Words::from_wire(&pdu[2..]), Some(Words::new(&words)));
    }
}

/// `head` as a request, `tail` as what came: right, refused or wrong, as the specification says.
fn check_verdict(head: &[u8], tail: &[u8]) {
    let len = u8::try_from(tail.len()).unwrap_or(u8::MAX);
    for (request, length) in [
        (Request::parse(head), Length::Named),
        (Request::custom(head, AnswerLength::BySilence), Length::Any),
        (Request::custom(head, AnswerLength::Bytes(len)), Length::Given(len)),
        (Request::custom(head, AnswerLength::Bytes(5)), Length::Given(5)),
    ] {
        let Ok(request) = request else { continue };
        let nameless = length == Length::Named && matches!(request, Request::Custom { .. });
        let asked = Asked { pdu: head.to_vec(), length: if nameless { Length::Any } else { length } };
        // The same words back, an exception, and whatever the input has.
        for pdu in [tail, head, &[head[0] | 0x80, len]] {
            let judged = match request.judge(pdu) {
                Ok(Answer::Exception { function, code, .. }) => {
                    assert_eq!([function | 0x80, code.0], pdu);
                    Verdict::Refusal
                }
                Ok(_) => Verdict::Right,
                Err(error) => {
                    assert!(!error.to_string().is_empty());
                    Verdict::Wrong
                }
            };
            let fits = pdu.len() <= 253;
            assert!(!fits || judged == asked.judge(pdu), "{asked:?}, {pdu:?}: {judged:?}");
        }
    }
}
