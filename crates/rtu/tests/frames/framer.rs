//! Frames come out of any stream, however it is cut, and noise comes out as noise.

use crate::common::{answers, requests};
use drivebus_rtu::*;
use proptest::prelude::*;

const SILENCE: Duration = Duration::from_micros(1_750);

fn at(micros: u64) -> Instant {
    Instant::from_nanos(micros * 1_000)
}

/// Feeds everything at one moment in chunks, then lets silence end it; returns frames and the bytes skipped.
fn run(framer: &mut Framer, wire: &[u8], cuts: &[usize]) -> (Vec<Vec<u8>>, Vec<u8>) {
    let (mut heard, mut noise) = (Vec::new(), Vec::new());
    let mut drain = |framer: &mut Framer, now| {
        while let Some(event) = framer.poll(now) {
            match event {
                Ok(frame) => heard.push(frame.as_bytes().to_vec()),
                Err(skip) => noise.extend_from_slice(skip.bytes),
            }
        }
    };
    let mut rest = wire;
    let mut cuts = cuts.iter().copied().cycle();
    while !rest.is_empty() {
        let cut = cuts.next().unwrap_or(rest.len()).clamp(1, rest.len());
        let mut chunk = &rest[..cut];
        while !chunk.is_empty() {
            let count = framer.receive(at(0), chunk);
            chunk = &chunk[count..];
            drain(framer, at(0));
        }
        rest = &rest[cut..];
    }
    drain(framer, at(1_749));
    drain(framer, at(1_750));
    (heard, noise)
}

/// Bytes as a hostile line has them: heard of both directions, noise, cut heard, flipped bits.
fn streams() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        4 => (1..=247_u8, requests()).prop_map(|(unit, owned)| {
            Adu::request(UnitAddress::new(unit).unwrap().into(), &owned.borrow()).as_bytes().to_vec()
        }),
        4 => (1..=247_u8, answers()).prop_map(|(unit, owned)| {
            Adu::answer(UnitAddress::new(unit).unwrap(), &owned.borrow()).as_bytes().to_vec()
        }),
        2 => prop::collection::vec(prop_oneof![Just(0x00), Just(0xFF), Just(1), Just(3), any::<u8>()], 0..40),
        1 => (answers(), any::<prop::sample::Index>()).prop_map(|(owned, index)| {
            let adu = Adu::answer(UnitAddress::MIN, &owned.borrow());
            adu.as_bytes()[..index.index(adu.as_bytes().len())].to_vec()
        }),
    ];
    prop::collection::vec(piece, 0..8).prop_map(|pieces| pieces.concat())
}

proptest! {
    #[test]
    fn any_cut_gives_the_same_frames(wire in streams(), cuts in prop::collection::vec(1..300_usize, 0..9)) {
        let whole = run(&mut Framer::new(SILENCE), &wire, &[]);
        prop_assert_eq!(&run(&mut Framer::new(SILENCE), &wire, &[1]), &whole);
        prop_assert_eq!(&run(&mut Framer::new(SILENCE), &wire, &cuts), &whole);
        // Nothing is swallowed and nothing is invented.
        prop_assert_eq!(whole.0.iter().map(Vec::len).sum::<usize>() + whole.1.len(), wire.len());
    }

    #[test]
    fn any_cut_gives_the_same_answer(wire in streams(), cuts in prop::collection::vec(1..300_usize, 0..9)) {
        let expecting = || {
            let mut framer = Framer::new(SILENCE);
            framer.expect(UnitAddress::MIN, Request::read(0, 2).unwrap().expected());
            framer
        };
        let whole = run(&mut expecting(), &wire, &[]);
        prop_assert_eq!(&run(&mut expecting(), &wire, &[1]), &whole);
        prop_assert_eq!(&run(&mut expecting(), &wire, &cuts), &whole);
    }

    #[test]
    fn polling_early_changes_nothing(wire in streams(), early in prop::collection::vec(0..1_750_u64, 0..5)) {
        let mut polled = Framer::new(SILENCE);
        let mut count = 0;
        let mut rest = &wire[..];
        while !rest.is_empty() {
            rest = &rest[polled.receive(at(0), rest)..];
            while polled.poll(at(0)).is_some() { count += 1; }
        }
        let mut sorted = early;
        sorted.sort_unstable();
        for moment in sorted {
            prop_assert_eq!(polled.poll(at(moment)), None);
        }
        while polled.poll(at(1_750)).is_some() { count += 1; }
        let mut plain = Framer::new(SILENCE);
        let mut expected = 0;
        let mut rest = &wire[..];
        while !rest.is_empty() {
            rest = &rest[plain.receive(at(0), rest)..];
            while plain.poll(at(0)).is_some() { expected += 1; }
        }
        while plain.poll(at(1_750)).is_some() { expected += 1; }
        prop_assert_eq!(count, expected);
    }

    #[test]
    fn the_answer_survives_noise_around_it(
        words in prop::collection::vec(any::<u16>(), 1..=16),
        before in prop::collection::vec(prop_oneof![Just(0x00), Just(0xFF)], 0..20),
        after in prop::collection::vec(any::<u8>(), 0..20),
    ) {
        let unit = UnitAddress::new(7).unwrap();
        let answer = Adu::answer(unit, &Answer::read(&words).unwrap());
        let wire = [&before[..], answer.as_bytes(), &after[..]].concat();
        let mut framer = Framer::new(SILENCE);
        framer.expect(unit, Request::read(0, u16::try_from(words.len()).unwrap()).unwrap().expected());
        framer.receive(at(0), &wire);
        // Noise from missing bias costs no time at all: the answer is there at its last byte.
        if !before.is_empty() {
            prop_assert_eq!(framer.poll(at(0)).unwrap().unwrap_err().bytes, &before[..]);
        }
        prop_assert_eq!(framer.poll(at(0)).unwrap().unwrap().as_bytes(), answer.as_bytes());
    }
}

#[test]
fn an_answer_in_lumps_is_whole_after_the_last_lump() {
    let unit = UnitAddress::MIN;
    let answer = Adu::answer(unit, &Answer::read(&[1, 2, 3, 4]).unwrap());
    let mut framer = Framer::new(SILENCE);
    framer.expect(unit, Request::read(0, 4).unwrap().expected());
    let mut now = 0;
    for lump in answer.as_bytes().chunks(4) {
        assert_eq!(framer.poll(at(now)), None);
        now += 16_000; // a USB adapter's latency timer: far beyond the silence
        framer.receive(at(now), lump);
    }
    assert_eq!(framer.poll(at(now)).unwrap().unwrap().as_bytes(), answer.as_bytes());
}

#[test]
fn silence_ends_what_no_length_can() {
    let pdu = [0x41, 1, 2, 3];
    let adu = Adu::request(UnitAddress::MIN.into(), &Request::custom(&pdu, AnswerLength::BySilence).unwrap());
    let mut framer = Framer::new(SILENCE);
    framer.receive(at(0), adu.as_bytes());
    assert_eq!(framer.deadline(), Some(at(1_750)));
    assert_eq!(framer.poll(at(1_749)), None);
    assert_eq!(framer.poll(at(1_750)).unwrap().unwrap().pdu(), pdu);
    assert_eq!(framer.deadline(), None);
}

#[test]
fn the_longest_frame_is_not_cut_into_what_it_carries() {
    // An echo stands in it as it would on the line; only silence tells that it is not one.
    let inner = Adu::request(UnitAddress::MIN.into(), &Request::echo(0x12AB));
    let pdu = [&[0x41][..], inner.as_bytes(), &[0; 244]].concat();
    let adu = Adu::request(UnitAddress::MIN.into(), &Request::custom(&pdu, AnswerLength::BySilence).unwrap());
    assert_eq!(adu.as_bytes().len(), MAX_ADU);
    let mut framer = Framer::new(SILENCE);
    framer.receive(at(0), adu.as_bytes());
    assert_eq!(framer.poll(at(1_749)), None);
    assert_eq!(framer.poll(at(1_750)).unwrap().unwrap().as_bytes(), adu.as_bytes());
}

#[test]
fn a_frame_broken_off_does_not_swallow_the_next() {
    let request = Adu::request(UnitAddress::MIN.into(), &Request::read(0x2100, 1).unwrap());
    let mut framer = Framer::new(SILENCE);
    framer.receive(at(0), &request.as_bytes()[..5]);
    framer.receive(at(5_000), request.as_bytes());
    assert_eq!(framer.poll(at(5_000)).unwrap().unwrap_err().bytes, &request.as_bytes()[..5]);
    assert_eq!(framer.poll(at(5_000)).unwrap().unwrap().as_bytes(), request.as_bytes());
}

#[test]
fn noise_that_silence_has_ended_takes_no_frame_with_it() {
    // Nobody looked after the noise, and the frame fills what room was left.
    let frame = Adu::request(UnitAddress::MIN.into(), &Request::custom(&[0x41], AnswerLength::BySilence).unwrap());
    let mut framer = Framer::new(SILENCE);
    assert_eq!(framer.receive(at(0), &[0x03; 510]), 510);
    assert_eq!(framer.receive(at(5_000), frame.as_bytes()), 2);
    assert_eq!(framer.poll(at(5_000)).unwrap().unwrap_err().bytes, [0x03; 510]);
    assert_eq!(framer.receive(at(5_000), &frame.as_bytes()[2..]), 2);
    assert_eq!(framer.poll(at(5_000)), None);
    assert_eq!(framer.poll(at(6_750)).unwrap().unwrap().as_bytes(), frame.as_bytes());
}

#[test]
fn what_begins_after_a_silence_is_not_cut_though_nobody_looked() {
    let inner = Adu::answer(UnitAddress::MIN, &Answer::read(&[0x01A0]).unwrap());
    let pdu = [&[0x41][..], inner.as_bytes(), &[0xFF]].concat();
    let frame = Adu::request(UnitAddress::MIN.into(), &Request::custom(&pdu, AnswerLength::BySilence).unwrap());
    let mut framer = Framer::new(SILENCE);
    framer.receive(at(0), &[0xFF]);
    framer.receive(at(5_000), frame.as_bytes());
    assert_eq!(framer.poll(at(5_000)).unwrap().unwrap_err().bytes, [0xFF]);
    assert_eq!(framer.poll(at(5_000)), None);
    assert_eq!(framer.poll(at(6_750)).unwrap().unwrap().as_bytes(), frame.as_bytes());
}

#[test]
fn silence_is_no_deadline_for_an_answer_that_only_lacks_its_end() {
    let unit = UnitAddress::MIN;
    let answer = Adu::answer(unit, &Answer::read(&[1, 2]).unwrap());
    let mut framer = Framer::new(SILENCE);
    framer.expect(unit, Request::read(0, 2).unwrap().expected());
    framer.receive(at(0), &answer.as_bytes()[..6]);
    assert_eq!(framer.deadline(), None, "only bytes can help");
    assert_eq!(framer.poll(at(1_750)), None);
    assert_eq!(framer.deadline(), None, "a loop would spin on a deadline that is over");
}

#[test]
fn a_corrupt_answer_is_reported_with_both_crcs() {
    let unit = UnitAddress::MIN;
    let mut bytes = Adu::answer(unit, &Answer::read(&[3]).unwrap()).as_bytes().to_vec();
    bytes[4] ^= 1;
    let mut framer = Framer::new(SILENCE);
    framer.expect(unit, Request::read(0, 1).unwrap().expected());
    framer.receive(at(0), &bytes);
    assert_eq!(framer.poll(at(1_749)), None);
    let skipped = framer.poll(at(1_750)).unwrap().unwrap_err();
    let FrameError::Crc { computed, received } = skipped.error else { panic!("{skipped}") };
    assert_eq!(received.to_le_bytes(), [0xF8, 0x45]);
    assert_eq!(computed, crc16(&bytes[..5]));
}

/// What has come when the rest is given up is handed out then, whatever it is cut into, and not earlier.
#[test]
fn an_answer_that_breaks_off_is_given_up_when_its_time_is_over() {
    let unit = UnitAddress::MIN;
    let answer = Adu::answer(unit, &Answer::read(&[1, 2, 3, 4]).unwrap());
    for (len, cut) in (1..answer.as_bytes().len()).flat_map(|len| (1..=len).map(move |cut| (len, cut))) {
        let mut framer = Framer::new(SILENCE);
        framer.expect(unit, Request::read(0, 4).unwrap().expected());
        framer.wait_for_the_rest(Duration::from_millis(20), at(15_000));
        for lump in answer.as_bytes()[..len].chunks(cut) {
            framer.receive(at(1_000), lump);
            assert_eq!(framer.poll(at(1_000)), None);
        }
        assert_eq!(framer.deadline(), Some(at(21_000)));
        assert_eq!(framer.poll(at(20_999)), None);
        assert_eq!(framer.poll(at(21_000)).unwrap().unwrap_err().bytes, &answer.as_bytes()[..len]);
        assert_eq!(framer.poll(at(21_000)), None);
        assert_eq!(framer.deadline(), None);
    }
}

/// Noise that begins like a longer answer hides a refusal no longer than its rest is waited for.
#[test]
fn a_refusal_behind_a_false_beginning_is_found() {
    let unit = UnitAddress::MIN;
    let refusal = Adu::answer(unit, &Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS));
    let mut framer = Framer::new(SILENCE);
    framer.expect(unit, Request::read(0, 16).unwrap().expected());
    framer.wait_for_the_rest(Duration::from_millis(10), at(0));
    framer.receive(at(0), &[&[0x01, 0x03, 0x20], refusal.as_bytes()].concat());
    assert_eq!(framer.poll(at(9_999)), None);
    assert_eq!(framer.poll(at(10_000)).unwrap().unwrap_err().bytes, [0x01, 0x03, 0x20]);
    assert_eq!(framer.poll(at(10_000)).unwrap().unwrap().as_bytes(), refusal.as_bytes());
}

proptest! {
    #[test]
    fn any_cut_gives_the_same_answer_however_short_the_patience(
        wire in streams(), cuts in prop::collection::vec(1..300_usize, 0..9), pause in 0..5_u64,
    ) {
        let expecting = || {
            let mut framer = Framer::new(SILENCE);
            framer.expect(UnitAddress::MIN, Request::read(0, 2).unwrap().expected());
            framer.wait_for_the_rest(Duration::from_millis(pause), at(0));
            framer
        };
        let whole = run(&mut expecting(), &wire, &[]);
        prop_assert_eq!(&run(&mut expecting(), &wire, &[1]), &whole);
        prop_assert_eq!(&run(&mut expecting(), &wire, &cuts), &whole);
    }
}
