//! Invariant: how the bytes of a moment are cut, looking more often than needed, and for a listener looking only when the
//! next bytes are there, never changes which frames come out; every byte fed comes out once, in order; a frame has a
//! right CRC; and the answer that is hunted for comes out whatever lumps it arrives in.

use std::time::Duration;

use drivebus_rtu::{AnswerLength, Framer, Instant, Request, UnitAddress};

use crate::oracle;
use crate::stream::{Arrival, GAPS, Input, SILENCE, arrivals, right_answer};

/// What came out, and when: skipped bytes one by one, because in how many pieces they come is nobody's promise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Heard {
    Frame(Instant, Vec<u8>),
    Skipped(u8),
}

/// How a run handles the bytes of a moment.
#[derive(Debug, Clone, Copy)]
enum Cut<'a> {
    Whole,
    Single,
    /// By these numbers in turn, looking once more between them.
    By(&'a [u8]),
    /// Not, and nobody looks before the next bytes are there.
    Late,
}

/// See the file's first lines. The input: what is hunted for, three cuts, then a stream.
pub fn framer(data: &[u8]) {
    let mut input = Input::new(data);
    let hunted = input.byte();
    let cuts = input.bytes(3);
    let pdu = [0x41, 0x00];
    let hunt = match hunted & 7 {
        1 => Request::read(0, 1 + u16::from(hunted >> 3)).ok(),
        2 => Some(Request::write(0x0102, 0x0304)),
        3 => Some(Request::echo(0x0102)),
        4 => Request::custom(&pdu, AnswerLength::BySilence).ok(),
        5 => Request::custom(&pdu, AnswerLength::Bytes(1 + (hunted >> 3))).ok(),
        6 => return check_lumps(1 + u16::from(hunted >> 3), &mut input),
        _ => None,
    };
    let framer = || {
        let mut framer = Framer::new(SILENCE);
        if let Some(request) = hunt {
            framer.expect(UnitAddress::MIN, request.expected());
        }
        framer
    };
    let stream = arrivals(&mut input);
    let whole = run(framer(), &stream, Cut::Whole);
    // Longer ones take long, and show nothing that other cuts do not show.
    if stream.iter().map(|arrival| arrival.bytes.len()).sum::<usize>() < 300 {
        assert_eq!(run(framer(), &stream, Cut::Single), whole);
    }
    assert_eq!(run(framer(), &stream, Cut::By(cuts)), whole);
    // Who hunts for an answer may miss what others send.
    if hunt.is_none() {
        assert_eq!(bytes_of(run(framer(), &stream, Cut::Late)), bytes_of(whole));
    }
}

/// The same, whenever it came out.
pub(crate) fn bytes_of(heard: Vec<Heard>) -> Vec<Result<Vec<u8>, u8>> {
    let bytes = |event| match event {
        Heard::Frame(_, bytes) => Ok(bytes),
        Heard::Skipped(byte) => Err(byte),
    };
    heard.into_iter().map(bytes).collect()
}

/// Feeds the stream, looking at every deadline and every arrival, and checks what holds by itself.
fn run(mut framer: Framer, stream: &[Arrival], cut: Cut<'_>) -> Vec<Heard> {
    let mut heard = Vec::new();
    let mut now = Instant::ZERO;
    let mut fed = Vec::new();
    for Arrival { gap, bytes } in stream {
        let next = now + *gap;
        if !matches!(cut, Cut::Late) {
            wait(&mut framer, now, next, &mut heard);
        }
        now = next;
        let mut rest = &bytes[..];
        let mut turn = 0;
        while !rest.is_empty() {
            let count = match cut {
                Cut::Whole | Cut::Late | Cut::By([]) => rest.len(),
                Cut::Single => 1,
                // Few cuts of many bytes: each costs a look at all that is held.
                Cut::By(cuts) => usize::from(cuts[turn % cuts.len()]).max(1 + bytes.len() / 64).min(rest.len()),
            };
            turn += 1;
            let count = framer.receive(now, &rest[..count]);
            assert!(count > 0, "no room after looking");
            fed.extend_from_slice(&rest[..count]);
            rest = &rest[count..];
            look(&mut framer, now, &mut heard);
            if matches!(cut, Cut::By(_)) {
                assert_eq!(framer.poll(now), None, "nothing has changed since");
            }
        }
    }
    // Silence, and then longer silence: it changes nothing more.
    let end = now + Duration::from_secs(10);
    wait(&mut framer, now, end, &mut heard);
    assert_eq!(framer.poll(end), None);
    let mut out = Vec::new();
    for event in &heard {
        match event {
            Heard::Frame(_, bytes) => {
                assert!(oracle::frame(bytes).is_some(), "{bytes:02X?} is no frame");
                out.extend_from_slice(bytes);
            }
            Heard::Skipped(byte) => out.push(*byte),
        }
    }
    out.extend_from_slice(framer.pending());
    assert_eq!(out, fed, "every byte comes out once, in order");
    heard
}

/// Lets time pass until `next`, and looks whenever the framer wants it.
pub(crate) fn wait(framer: &mut Framer, mut now: Instant, next: Instant, heard: &mut Vec<Heard>) {
    while let Some(deadline) = framer.deadline().filter(|&deadline| deadline <= next) {
        now = now.max(deadline);
        look(framer, now, heard);
        assert!(framer.deadline().is_none_or(|later| later > now), "a deadline in the past for ever");
    }
}

/// Takes all that there is to say at `now`.
pub(crate) fn look(framer: &mut Framer, now: Instant, heard: &mut Vec<Heard>) {
    while let Some(event) = framer.poll(now) {
        match event {
            Ok(frame) => heard.push(Heard::Frame(now, frame.as_bytes().to_vec())),
            Err(skipped) => {
                assert!(!skipped.bytes.is_empty() && !skipped.to_string().is_empty());
                heard.extend(skipped.bytes.iter().map(|&byte| Heard::Skipped(byte)));
            }
        }
    }
}

/// The answer to a read of `count` words, cut anywhere, with any pauses: out at its last byte.
fn check_lumps(count: u16, input: &mut Input<'_>) {
    let Ok(request) = Request::read(0, count) else { return };
    let count = u8::try_from(count).unwrap_or_default();
    let answer = right_answer(&oracle::sealed(&[1, 3, 0, 0, 0, count]), input.word());
    let mut framer = Framer::new(SILENCE);
    framer.expect(UnitAddress::MIN, request.expected());
    let mut heard = Vec::new();
    let mut now = Instant::ZERO;
    let mut rest = &answer[..];
    while !rest.is_empty() {
        let how = input.byte();
        let (lump, later) = rest.split_at(usize::from(how & 0x0F).clamp(1, rest.len()));
        let next = now + Duration::from_micros(GAPS[usize::from(how >> 4)]);
        wait(&mut framer, now, next, &mut heard);
        now = next;
        assert_eq!(heard, [], "nothing before the last byte");
        assert_eq!(framer.receive(now, lump), lump.len());
        look(&mut framer, now, &mut heard);
        rest = later;
    }
    assert_eq!(heard, [Heard::Frame(now, answer)]);
}
