//! Invariant: a passive listener accounts for every byte, at whatever moments it comes, and tells exactly the frames
//! that trying every place and length between two silences finds; what they mean is what their bytes say.
//!
//! This is the part of a capture that exists: there is no file format yet.

use drivebus_rtu::{Answer, Framer, Instant, Request};

use crate::framer::{bytes_of, look, wait};
use crate::oracle;
use crate::stream::{Arrival, Input, SILENCE, arrivals};
use crate::told::pdu_of;

/// Longer bursts than this no listener need hold: twice the longest frame.
pub(crate) const HELD: usize = 511;

/// See the file's first lines. The input: a stream.
pub fn listener(data: &[u8]) {
    let stream = arrivals(&mut Input::new(data));
    let mut framer = Framer::new(SILENCE);
    // As a listener that was a master's before.
    framer.expect_anything();
    let mut heard = Vec::new();
    let mut now = Instant::ZERO;
    for Arrival { gap, bytes } in &stream {
        let next = now + *gap;
        wait(&mut framer, now, next, &mut heard);
        now = next;
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            rest = &rest[framer.receive(now, rest)..];
            look(&mut framer, now, &mut heard);
        }
    }
    wait(&mut framer, now, now + SILENCE, &mut heard);
    assert_eq!(framer.pending(), [], "silence ends everything");

    let heard = bytes_of(heard);
    for bytes in heard.iter().flatten() {
        check_meaning(bytes);
    }
    let bursts = bursts(&stream);
    let fed: Vec<u8> = bursts.concat();
    let told: Vec<u8> = heard.iter().flat_map(|event| event.clone().unwrap_or_else(|byte| vec![byte])).collect();
    assert_eq!(told, fed, "every byte comes out once, in order");
    check_beginnings(&heard, &bursts);
    if bursts.iter().all(|burst| burst.len() <= HELD) {
        let tried: Vec<Result<Vec<u8>, u8>> =
            bursts.iter().flat_map(|burst| oracle::frames_in(burst)).map(|event| event.map(<[u8]>::to_vec)).collect();
        assert_eq!(heard, tried);
    }
}

/// The bytes between two silences each.
pub(crate) fn bursts(stream: &[Arrival]) -> Vec<Vec<u8>> {
    let mut bursts = vec![Vec::new()];
    let mut quiet = std::time::Duration::ZERO;
    for Arrival { gap, bytes } in stream {
        quiet += *gap;
        if bytes.is_empty() {
            continue;
        }
        if quiet >= SILENCE {
            bursts.push(Vec::new());
        }
        quiet = std::time::Duration::ZERO;
        if let Some(burst) = bursts.last_mut() {
            burst.extend_from_slice(bytes);
        }
    }
    bursts
}

/// A frame whose length its function does not tell is one only after silence, or right behind another frame.
fn check_beginnings(heard: &[Result<Vec<u8>, u8>], bursts: &[Vec<u8>]) {
    let ends = bursts.iter().scan(0, |end, burst| {
        *end += burst.len();
        Some(*end)
    });
    let mut beginnings: Vec<usize> = [0].into_iter().chain(ends).collect();
    let mut place = 0;
    for event in heard {
        match event {
            Ok(bytes) => {
                let told = oracle::lengths(bytes).contains(&bytes.len());
                assert!(told || beginnings.contains(&place), "{bytes:02X?} has no beginning");
                place += bytes.len();
                beginnings.push(place);
            }
            Err(_) => place += 1,
        }
    }
}

fn check_meaning(bytes: &[u8]) {
    let Some((_, pdu)) = oracle::frame(bytes) else {
        unreachable!("{bytes:02X?} is no frame");
    };
    assert_eq!(Request::parse(pdu).is_ok(), oracle::is_request(pdu));
    assert_eq!(Answer::parse(pdu).is_ok(), oracle::is_answer(pdu));
    let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
    match Request::parse(pdu) {
        Ok(Request::Read { table, address, count, .. }) => {
            assert_eq!((table.function(), address, count), (pdu[0], word(1), word(3)));
        }
        Ok(Request::WriteCoil { address, on, .. }) => {
            assert_eq!((address, if on { 0xFF00 } else { 0 }), (word(1), word(3)));
        }
        Ok(Request::WriteSingle { address, value, .. }) => assert_eq!((address, value), (word(1), word(3))),
        Ok(Request::Echo { data, .. }) => assert_eq!(data, word(3)),
        Ok(Request::WriteMultiple { address, words, .. }) => {
            assert_eq!((address, words.len()), (word(1), usize::from(word(3))));
            assert!((0..words.len()).all(|n| words.get(n) == Some(word(6 + 2 * n))));
        }
        Ok(other) => assert_eq!(pdu_of(&other), pdu),
        Err(_) => {}
    }
    match Answer::parse(pdu) {
        Ok(Answer::Read { table, words, .. }) if table.is_bits() => {
            assert!(words.iter().enumerate().all(|(n, bit)| bit == u16::from(pdu[2 + n / 8] >> (n % 8) & 1)));
        }
        Ok(Answer::Read { words, .. }) => {
            assert!(words.iter().enumerate().all(|(n, value)| value == word(2 + 2 * n)));
        }
        Ok(Answer::Exception { function, code, .. }) => assert_eq!([function | 0x80, code.0], pdu),
        _ => {}
    }
}
