//! Answers behind noise, answers that break off, and right ones behind damaged ones: found, and quickly.

use std::time::Duration;

use drivebus_line::{CallOptions, Failure};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Request};

use crate::scripted::{FORMAT, Pieces, Rig, after, at_once, lumps, millis, right, unit};

/// What a unit makes of 08H.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Echo {
    Returned,
    Refused,
    Unheard,
}

const ECHOES: [Echo; 3] = [Echo::Returned, Echo::Refused, Echo::Unheard];

/// The answer of such a unit, or nothing.
fn answer(echo: Echo, request: &[u8]) -> Option<Vec<u8>> {
    match (echo, request[1]) {
        (Echo::Unheard, 8) => None,
        (Echo::Refused, 8) => {
            let refusal = Answer::exception(8, ExceptionCode::ILLEGAL_FUNCTION);
            Some(Adu::answer(unit(1), &refusal).as_bytes().to_vec())
        }
        _ => Some(right(request)),
    }
}

/// Noise that comes before each answer: what it is called, and the first so many bytes of it, for the request of a number.
type Noise = fn(usize, usize) -> Vec<u8>;

/// Bytes that a chip's shift register would give, other ones for each request.
fn random(number: usize, count: usize) -> Vec<u8> {
    let mut state = 0x9E37_79B9_u32 ^ u32::try_from(31 * number + count).unwrap();
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state.to_le_bytes()[2]
    };
    (0..count).map(|_| next()).collect()
}

fn repeated(pattern: &[u8], count: usize) -> Vec<u8> {
    pattern.iter().copied().cycle().take(count).collect()
}

const NOISES: [(&str, Noise); 7] = [
    ("00", |_, count| repeated(&[0x00], count)),
    ("FF", |_, count| repeated(&[0xFF], count)),
    ("random", random),
    ("address and function", |_, count| repeated(&[0x01, 0x03], count)),
    ("the beginning of an answer", |_, count| repeated(&[0x01, 0x03, 0x02, 0x00, 0x01], count)),
    ("the beginning of a confirmation", |_, count| repeated(&[0x01, 0x06, 0x30], count)),
    ("the beginning of an echo", |_, count| repeated(&[0x01, 0x08, 0x00, 0x00], count)),
];

#[test]
fn whatever_comes_before_each_answer_all_is_answered() {
    for (what, noise) in NOISES {
        for count in 3..=30 {
            for (fresh, echo) in
                [true, false].into_iter().zip([ECHOES; 2]).flat_map(|(fresh, all)| all.map(|e| (fresh, e)))
            {
                let script = move |number: usize, request: &[u8]| {
                    let answer = answer(echo, request);
                    answer.map_or_else(Vec::new, |answer| at_once(&[noise(number, count), answer].concat()))
                };
                let rig = Rig::fresh(|_, _| Vec::new(), script);
                if !fresh {
                    rig.pass(millis(2_000));
                }
                let case = format!("{count} bytes of {what}, fresh {fresh}, 08H {echo:?}");
                let stop = CallOptions::new().in_doubt(true);
                rig.call(unit(1).into(), &Request::write(0x3000, 5), stop, &mut || false, &mut |_| ())
                    .unwrap_or_else(|error| panic!("stop, {case}: {error}"));
                for address in [0x3000, 0x3001] {
                    assert_eq!(rig.read(address, 1).unwrap_or_else(|error| panic!("read, {case}: {error}")), [address]);
                }
                rig.ask(&Request::write(0x3001, 7)).unwrap_or_else(|error| panic!("write, {case}: {error}"));
                let many = Request::write_many(0x3001, &[7, 8]).unwrap();
                rig.ask(&many).unwrap_or_else(|error| panic!("write of two, {case}: {error}"));
                // One word of 65536 makes a frame of the noise before it; not this one.
                let echoed = rig.ask(&Request::echo(0x5AC3)).map_err(|error| error.failure);
                match echo {
                    Echo::Returned => assert_eq!(echoed, Ok(Vec::new()), "{case}"),
                    Echo::Refused => assert!(matches!(echoed, Err(Failure::Refused { .. })), "{case}: {echoed:?}"),
                    Echo::Unheard => assert!(matches!(echoed, Err(Failure::NoAnswer { .. })), "{case}: {echoed:?}"),
                }
            }
        }
    }
}

/// Noise is no sign of an adapter without echo either, where the echo is in it.
#[test]
fn an_echo_behind_noise_is_still_an_echo() {
    for (what, noise) in NOISES {
        let rig = Rig::echoing(
            move |number, sent| vec![(Duration::ZERO, [noise(number, 9), sent.to_vec()].concat())],
            |_, request| if request[1] == 3 { vec![(millis(80), right(request))] } else { Vec::new() },
        );
        rig.read(0x3000, 1).unwrap();
        let error = rig.ask(&Request::write(0x3001, 7)).expect_err("its own echo");
        assert!(matches!(error.failure, Failure::NoAnswer { .. }), "{what}: {error}");
    }
}

/// How long the call took, from its first bit to its end.
fn took(rig: &Rig, request: &Request<'_>) -> (Result<Vec<u16>, Failure>, Duration) {
    let before = rig.wire.lock().unwrap().now;
    let result = rig.ask(request).map_err(|error| error.failure);
    (result, rig.wire.lock().unwrap().now.saturating_duration_since(before))
}

fn without(bytes: &[u8], place: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes.remove(place);
    bytes
}

/// One character of each answer is lost: told within a fifth of the time-out on a line that nobody knows, and in a few
/// characters and a moment on one that hands over answers in one piece.
#[test]
fn an_answer_that_lost_a_character_is_given_up_early() {
    for (settled, most) in [(false, 150), (true, 70)] {
        for (read, place) in [(1, 7), (16, 37)].into_iter().flat_map(|(count, len)| (0..len).map(move |at| (count, at)))
        {
            let rig = Rig::new(move |_, request| {
                let whole = right(request);
                at_once(&if request[3] == 0x77 { without(&whole, place) } else { whole })
            });
            for address in 0..if settled { 10 } else { 0 } {
                rig.read(address, 1).unwrap();
            }
            let (result, time) = took(&rig, &Request::read(0x0077, read).unwrap());
            let case =
                format!("{read} words without the character {place}, settled {settled}: {result:?} after {time:?}");
            assert!(matches!(result, Err(Failure::Corrupt(_))) && time < millis(most), "{case}");
        }
    }
}

/// Reads `rounds` times, each time words that nobody has read before, and counts the right answers; one that is not right must
/// be none.
fn right_or_none(rig: &Rig, rounds: u16, case: &str) -> usize {
    let addresses = (0..rounds).map(|round| 0x100 + 2 * round);
    let answered = addresses.filter_map(|address| Some((address, rig.read(address, 2).ok()?)));
    answered.inspect(|(address, words)| assert_eq!(words, &[*address, *address + 1], "{case}")).count()
}

/// What is given up is not the answer any more, though it comes: neither to this question nor to the next.
#[test]
fn what_an_answer_lacked_and_comes_late_is_never_delivered() {
    for (lump, pause) in (1..9).flat_map(|lump| (20..480).step_by(11).map(move |pause| (lump, pause))) {
        let rig = Rig::new(move |number, request| {
            let whole = right(request);
            if number < 12 {
                return at_once(&whole);
            }
            let (first, second) = whole.split_at(lump.min(whole.len() - 1));
            [after(Duration::ZERO, first), after(millis(pause), second)].concat()
        });
        assert_eq!(right_or_none(&rig, 12, "undisturbed"), 12);
        right_or_none(&rig, 64, &format!("pauses of {pause} ms behind {lump}"));
    }
}

/// A damaged answer is the answer, unless the line brings it again: whole, and long after.
#[test]
fn what_comes_whole_long_after_it_came_damaged_is_never_the_answer_to_another_question() {
    for (each, behind) in (1..4).flat_map(|each| (10..480).step_by(7).map(move |behind| (each, behind))) {
        let rig = Rig::new(move |number, request| {
            let whole = right(request);
            if number < 12 || number % each > 0 {
                return at_once(&whole);
            }
            let end = FORMAT.chars(u32::try_from(whole.len()).unwrap());
            [at_once(&without(&whole, 5)), after(end + millis(behind), &whole)].concat()
        });
        assert_eq!(right_or_none(&rig, 12, "undisturbed"), 12);
        right_or_none(&rig, 64, &format!("each {each}. again after {behind} ms"));
    }
}

#[test]
fn a_line_that_hands_over_in_lumps_is_believed_from_the_first_answer_on() {
    let rig = Rig::new(|_, request| lumps(millis(5), &right(request)));
    for address in 0..40 {
        assert_eq!(rig.read(address, 16).unwrap(), (address..address + 16).collect::<Vec<_>>());
    }
    assert_eq!(rig.bus.stats().total.requests, 40);
}

/// Pauses far longer than are waited for on a line that nobody knows: they are found out, because the rest comes.
#[test]
fn pauses_longer_than_were_ever_seen_are_learned() {
    let rig = Rig::new(|_, request| {
        let whole = right(request);
        let (first, second) = whole.split_at(4);
        [after(Duration::ZERO, first), after(millis(170), second)].concat()
    });
    let right = (0..40).filter(|&address| rig.read(address, 2).is_ok_and(|words| words == [address, address + 1]));
    assert!(right.count() > 30, "{:?}", rig.bus.stats());
}

/// What is made of the right answer.
type Spoiling = fn(&[u8]) -> Vec<u8>;

/// What comes in the place of an answer.
const SPOILT: [(&str, Spoiling); 4] = [
    ("damaged", |right| right.iter().enumerate().map(|(at, &byte)| byte ^ u8::from(at == 4)).collect()),
    ("damaged in its CRC", |right| {
        right.iter().rev().enumerate().map(|(at, &byte)| byte ^ u8::from(at == 0)).rev().collect()
    }),
    ("too long", |right| [&right[..right.len() - 2], &[0x55, 0xAA], &right[right.len() - 2..]].concat()),
    ("words too many", |right| match right[1] {
        3 => Adu::answer(unit(1), &Answer::read(&[7; 9]).unwrap()).as_bytes().to_vec(),
        _ => [&right[..5], &[0x55; 6]].concat(),
    }),
];

#[test]
fn the_right_answer_behind_a_spoilt_one_is_taken() {
    for ((what, spoil), fresh) in SPOILT.into_iter().flat_map(|each| [(each, true), (each, false)]) {
        let rig = Rig::fresh(
            |_, _| Vec::new(),
            move |_, request| {
                let right = right(request);
                let spoilt = spoil(&right);
                let end = FORMAT.chars(u32::try_from(spoilt.len()).unwrap());
                [at_once(&spoilt), after(end + millis(5), &right)].concat()
            },
        );
        if !fresh {
            rig.pass(millis(2_000));
        }
        for address in 0..20 {
            assert_eq!(rig.read(address, 1).unwrap_or_else(|error| panic!("{what}: {error}")), [address]);
            rig.ask(&Request::write(address, 7)).unwrap_or_else(|error| panic!("{what}: {error}"));
        }
        let requests = rig.bus.stats().total.requests;
        assert!(requests <= 42, "{what}: {requests} requests for 40 calls, fresh {fresh}");
    }
}

/// Most damaged answers are all that comes: nobody waits much for more.
#[test]
fn a_damaged_answer_is_told_soon() {
    let rig = Rig::new(|_, request| {
        let mut answer = right(request);
        answer[4] ^= u8::from(request[3] == 0x77);
        at_once(&answer)
    });
    for address in 0..10 {
        rig.read(address, 1).unwrap();
    }
    let (result, time) = took(&rig, &Request::read(0x0077, 1).unwrap());
    assert!(matches!(result, Err(Failure::Corrupt(_))) && time < millis(40), "{result:?} after {time:?}");
}

/// A unit whose answers come twice, the first of them damaged: the second is taken, and none for another question.
#[test]
fn an_answer_given_twice_belongs_to_no_other_question() {
    for between in 1..16 {
        let rig = Rig::new(move |number, request| -> Pieces {
            let right = right(request);
            let mut damaged = right.clone();
            damaged[right.len() - 1] ^= u8::from(number % 3 == 1);
            let end = FORMAT.chars(u32::try_from(right.len()).unwrap());
            match number % 3 {
                1 => [at_once(&damaged), after(end + millis(between), &right)].concat(),
                _ => at_once(&right),
            }
        });
        for address in 0..40 {
            if let Ok(words) = rig.read(address, 1) {
                assert_eq!(words, [address], "{between} ms between them");
            }
        }
    }
}
