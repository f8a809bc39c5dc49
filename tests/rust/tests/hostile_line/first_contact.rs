//! A stop's reads on a line that was just opened, at a unit that returns no echo: soon, and never another program's answer.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use drivebus_line::{CallOptions, Failure, Priority};
use drivebus_rtu::{Adu, Answer, ExceptionCode, FIRST_CONTACT, Instant, Request};

use crate::scripted::{FORMAT, Pieces, Rig, millis, right, unit};

/// The unit has no register from here on, and answers no read that reaches so far.
const END: u16 = 0x300;

/// What a unit makes of 08H.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Echo {
    Refused,
    Unheard,
}

fn refusal(function: u8) -> Vec<u8> {
    Adu::answer(unit(1), &Answer::exception(function, ExceptionCode::ILLEGAL_FUNCTION)).as_bytes().to_vec()
}

fn words(count: u16) -> Vec<u8> {
    right(Adu::request(unit(1).into(), &Request::read(100, count).unwrap()).as_bytes())
}

/// The answer of such a unit, or nothing. It has holding registers alone.
fn answer(echo: Echo, request: &[u8]) -> Option<Vec<u8>> {
    match (request[1], echo) {
        (8, Echo::Unheard) => None,
        (8, Echo::Refused) | (4, _) => Some(refusal(request[1])),
        (3, _) if u16::from_be_bytes([request[2], request[3]]) + u16::from(request[5]) > END => Some(refusal(3)),
        _ => Some(right(request)),
    }
}

/// A unit that answers in order, and has `strangers` to answer first: after the request of each number, so many of the
/// answers that it owes; after the others all. `last`: behind which request the last of the strangers' came.
fn behind(
    echo: Echo,
    strangers: &[Vec<u8>],
    gives: Vec<usize>,
    last: Arc<AtomicUsize>,
) -> impl FnMut(usize, &[u8]) -> Pieces + Send + 'static {
    let mut owed: VecDeque<Vec<u8>> = strangers.iter().cloned().collect();
    let mut strange = owed.len();
    move |number, request| {
        owed.extend(answer(echo, request));
        let count = gives.get(number).copied().unwrap_or(usize::MAX).min(owed.len());
        if strange > 0 && count > 0 {
            strange = strange.saturating_sub(count);
            last.store(number, Ordering::Relaxed);
        }
        let mut at = Duration::ZERO;
        let spoken = owed.drain(..count).map(|frame| {
            at += FORMAT.t35() + FORMAT.chars(u32::try_from(frame.len()).unwrap());
            (at, frame)
        });
        spoken.collect()
    }
}

/// The same on a line that was just opened.
fn fresh(echo: Echo, strangers: &[Vec<u8>], gives: Vec<usize>) -> (Rig, Arc<AtomicUsize>) {
    let last = Arc::new(AtomicUsize::new(0));
    let rig = Rig::fresh(|_, _| Vec::new(), behind(echo, strangers, gives, Arc::clone(&last)));
    // A unit that is behind does not listen before it speaks.
    rig.wire.lock().unwrap().collides = true;
    (rig, last)
}

/// Whether an answer to another program came later than a second after the line was opened, which no unit does.
fn is_too_late(rig: &Rig, last: &AtomicUsize) -> bool {
    let wire = rig.wire.lock().unwrap();
    wire.times[last.load(Ordering::Relaxed)] >= Instant::ZERO + FIRST_CONTACT
}

/// As a stop reads.
fn urgent(rig: &Rig, address: u16) -> Result<Vec<u16>, Failure> {
    let options = CallOptions::new().priority(Priority::Stop).timeout(millis(100));
    let mut came = Vec::new();
    rig.call(unit(1).into(), &Request::read(address, 1).unwrap(), options, &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            came = words.iter().collect();
        }
    })
    .map(|_| came)
    .map_err(|error| error.failure)
}

#[test]
fn a_stops_reads_of_a_unit_that_returns_no_echo_wait_for_no_second() {
    // The last register is asked for together with none behind it: there is none.
    for (first, requests) in [(0x200, 5), (END - 1, 7)] {
        for (echo, most) in [(Echo::Refused, 100), (Echo::Unheard, 220)] {
            let (rig, _) = fresh(echo, &[], Vec::new());
            for address in [first, 0x210, 0x220] {
                assert_eq!(urgent(&rig, address), Ok(vec![address]), "08H {echo:?}");
            }
            assert!(matches!(urgent(&rig, END), Err(Failure::Refused { .. })));
            let took = rig.since(Instant::ZERO);
            assert!(took < millis(most), "08H {echo:?}, from {first:03X}H: {took:?}");
            let sent = rig.bus.stats().total.requests;
            assert!(sent <= requests + 1 + u64::from(echo == Echo::Unheard), "{sent} requests, 08H {echo:?}");
        }
    }
}

/// What is not a stop's has the time.
#[test]
fn other_reads_wait_until_first_contact_is_over() {
    let (rig, _) = fresh(Echo::Refused, &[], Vec::new());
    assert_eq!(urgent(&rig, 0x200), Ok(vec![0x200]));
    assert_eq!(rig.read(0x210, 1).unwrap(), [0x210]);
    assert!(rig.since(Instant::ZERO) >= FIRST_CONTACT);
}

#[test]
fn a_late_answer_of_the_asked_shape_is_not_taken() {
    for echo in [Echo::Refused, Echo::Unheard] {
        for count in [1, 2] {
            for number in 0..4 {
                // It comes while the request of this number is waited for, and the unit's own answers behind it.
                let gives = vec![0; number];
                let (rig, _) = fresh(echo, &[words(count)], gives);
                let came: Vec<_> = (0..20).filter_map(|_| urgent(&rig, 0x200).ok()).collect();
                assert!(!came.is_empty() && came.iter().all(|words| words == &[0x200]), "{count} words: {came:?}");
            }
        }
    }
}

/// All that two questions of another program can be answered with, and each order in which the unit works off what it owes.
#[test]
fn whatever_two_questions_another_program_left_open_no_answer_to_them_is_taken() {
    let shapes = [words(1), words(2), words(3), refusal(3), refusal(8), refusal(4)];
    let mut queues: Vec<Vec<Vec<u8>>> = vec![Vec::new()];
    queues.extend(shapes.iter().map(|one| vec![one.clone()]));
    queues.extend(shapes.iter().flat_map(|one| shapes.iter().map(|other| vec![one.clone(), other.clone()])));
    let orders = (0..3_usize.pow(4)).map(|code| (0..4).map(|at| [1, 0, 3][code / 3_usize.pow(at) % 3]).collect());
    let orders: Vec<Vec<usize>> = orders.collect();
    let mut answered = 0;
    for (queue, gives) in queues.iter().flat_map(|queue| orders.iter().map(move |gives| (queue, gives))) {
        for (echo, first) in [Echo::Refused, Echo::Unheard].into_iter().flat_map(|echo| [(echo, 0x200), (echo, END)]) {
            let (rig, last) = fresh(echo, queue, gives.clone());
            for address in [first, 0x200, 0x210, END - 1, END, 0x220] {
                let case = || format!("{address:03X}H after {first:03X}H, 08H {echo:?}, {gives:?}, {queue:02X?}");
                let result = urgent(&rig, address);
                if is_too_late(&rig, &last) {
                    break;
                }
                match result {
                    Ok(words) => assert_eq!(words, [address], "{}", case()),
                    Err(Failure::Refused { .. }) => assert_eq!(address, END, "{}", case()),
                    Err(_) => continue,
                }
                answered += usize::from(rig.since(Instant::ZERO) < FIRST_CONTACT);
            }
        }
    }
    assert!(answered > queues.len() * orders.len() * 4, "{answered} answers are worth something");
}
