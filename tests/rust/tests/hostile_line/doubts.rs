//! Answers that may belong to another question: another program's, a unit's that knows no echo, a gateway's.

use std::time::Duration;

use drivebus_line::{CallOptions, Failure, Priority};
use drivebus_rtu::{Answer, FIRST_CONTACT, Instant, Request};

use crate::scripted::{Pieces, Rig, after, at_once, millis, right, unit};

/// The answer to what another program asked last, register 100, and then the right one to whatever is asked.
fn owing(delay: Duration) -> impl FnMut(usize, &[u8]) -> Pieces + Send + 'static {
    move |number, request| match number {
        0 => {
            let owed = right(&[1, 3, 0, 100, 0, 1, 0xC5, 0xD5]);
            [after(delay, &owed), after(delay + millis(10), &right(request))].concat()
        }
        _ => at_once(&right(request)),
    }
}

#[test]
fn an_answer_to_another_programs_question_is_never_ours() {
    for delay in [0, 5, 100, 480] {
        let rig = Rig::fresh(|_, _| Vec::new(), owing(millis(delay)));
        assert_eq!(rig.read(200, 1).unwrap(), [200], "{delay} ms");
        let stats = rig.bus.stats();
        assert_eq!(stats.total.resyncs, 1, "{stats:?}");
        // Once is enough.
        assert_eq!(rig.read(300, 1).unwrap(), [300]);
        assert_eq!(rig.bus.stats().total.resyncs, 1);
    }
}

#[test]
fn nobody_is_probed_on_a_line_that_was_listened_to() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.wire.lock().unwrap().sent.len(), 1);
}

fn mute(lost: usize) -> impl FnMut(usize, &[u8]) -> Pieces + Send + 'static {
    let mut reads = 0;
    move |_, request| {
        if request[1] == 8 {
            return Vec::new();
        }
        reads += 1;
        if reads == lost { after(millis(503), &right(request)) } else { at_once(&right(request)) }
    }
}

#[test]
fn a_unit_that_knows_no_echo_is_asked_when_first_contact_is_over() {
    let rig = Rig::fresh(|_, _| Vec::new(), mute(0));
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert!(rig.wire.lock().unwrap().now.as_nanos() < 1_100_000_000, "within a tenth of a second more");
}

/// A unit that knows no echo, a port that was just opened, and one answer that comes 1.4 time-outs late, be it the first one
/// or a later one.
#[test]
fn a_unit_without_an_echo_is_right_again_with_the_next_call() {
    for (timeout, late, retries) in
        [100, 200, 500].into_iter().flat_map(|ms| (1..6).flat_map(move |late| [(ms, late, 0), (ms, late, 2)]))
    {
        let (what, timeout) = (format!("{timeout} ms, read {late}, {retries} retries"), millis(timeout));
        let mut reads = 0;
        let rig = Rig::fresh(
            |_, _| Vec::new(),
            move |_, request| {
                reads += u32::from(request[1] == 3);
                match request[1] {
                    8 => Vec::new(),
                    _ if reads == late => after(timeout.mul_f64(1.4), &right(request)),
                    _ => at_once(&right(request)),
                }
            },
        );
        let options = CallOptions::new().retries(retries).timeout(timeout);
        let mut failed = Vec::new();
        for address in 100..120 {
            let (read, mut came) = (Request::read(address, 1).unwrap(), Vec::new());
            let result = rig.call(unit(1).into(), &read, options, &mut || false, &mut |answer| {
                if let Answer::Read { words, .. } = answer {
                    came = words.iter().collect();
                }
            });
            match result {
                Ok(_) => assert_eq!(came, [address], "{what}"),
                Err(_) => failed.push(address),
            }
        }
        assert!(failed.len() <= usize::from(retries == 0), "{what}: {failed:?}");
        // First contact, the late answer, an echo in vain, and a quarter of a second for the rest.
        let end = rig.wire.lock().unwrap().now.saturating_duration_since(Instant::ZERO);
        assert!(end < FIRST_CONTACT + timeout.mul_f64(1.4) + millis(300), "{what}: {end:?}");
        // The look at the adapter, the echo, the twenty reads, and the one that is repeated.
        assert!(rig.bus.stats().total.requests <= 23, "{what}: {:?}", rig.bus.stats());
    }
}

#[test]
fn a_read_that_can_be_told_apart_needs_no_echo_of_a_unit_that_knows_none() {
    let mut reads = 0;
    let rig = Rig::new(move |_, request| {
        reads += u32::from(request[1] == 3);
        match (request[1], reads) {
            (8, _) => Vec::new(),
            (_, 2 | 4) => after(millis(503), &right(request)),
            _ => at_once(&right(request)),
        }
    });
    assert_eq!(rig.read(7, 1).unwrap(), [7]);
    rig.read(100, 1).unwrap_err();
    assert_eq!(rig.read(150, 1).unwrap(), [150], "an echo comes first; nobody knew");
    rig.read(100, 1).unwrap_err();
    assert_eq!(rig.read(200, 1).unwrap(), [200], "and what was not asked for is cut off");
    assert_eq!(rig.sent(&Request::read(200, 2).unwrap()), 1, "a length that the open answer has not");
    let stats = rig.bus.stats();
    assert_eq!((stats.total.late, stats.total.resyncs, stats.total.requests), (2, 2, 6), "{stats:?}");
}

#[test]
fn a_unit_that_knows_no_echo_is_settled_by_a_read_of_another_length() {
    let rig = Rig::new(|_, request| match request[1..4] {
        [8, ..] | [6, 0, 100 | 101] => Vec::new(),
        _ => at_once(&right(request)),
    });
    assert_eq!(rig.read(7, 1).unwrap(), [7]);
    rig.ask(&Request::write(100, 1)).unwrap_err();
    rig.ask(&Request::write(200, 1)).unwrap();
    assert_eq!(rig.sent(&Request::read(7, 1).unwrap()), 2, "the register that is known to be readable");
    assert_eq!(rig.bus.stats().total.resyncs, 2, "an echo in vain, and the read");
    rig.ask(&Request::write(101, 1)).unwrap_err();
    rig.ask(&Request::write(200, 2)).unwrap();
    assert_eq!(rig.bus.stats().total.resyncs, 3, "that it knows no echo is kept in mind");
}

/// A unit that answers each new question only when the next one has come: one behind, for as long as it is asked new ones.
#[test]
fn a_unit_that_no_probe_settles_is_trusted_again_when_it_was_left_alone() {
    let mut held: Vec<u8> = Vec::new();
    let rig = Rig::new(move |number, request| {
        if request[1] == 8 {
            return Vec::new();
        }
        let behind = (1..8).contains(&number);
        let answer = if behind { std::mem::replace(&mut held, right(request)) } else { right(request) };
        if answer.is_empty() { Vec::new() } else { at_once(&answer) }
    });
    assert_eq!(rig.read(7, 1).unwrap(), [7]);
    let mut seconds = 0;
    let words = loop {
        if let Ok(words) = rig.read(200, 1) {
            break words;
        }
        rig.pass(millis(1_000));
        seconds += 1;
        assert!(seconds < 10, "{:?}", rig.bus.stats());
    };
    assert_eq!(words, [200]);
}

/// The unit has no register after those that are asked for, and the echo comes back before the answer that is late, later than
/// anybody watches for it.
#[test]
fn where_answers_overtake_the_same_words_have_to_come_twice() {
    let late = |number: usize, request: &[u8]| match (number, &request[1..6]) {
        (0, _) => after(millis(1_040), &right(request)),
        (_, [3, .., 2]) => at_once(&[1, 0x83, 2, 0xC0, 0xF1]),
        // It has it in hand, and hands on the other one.
        (3, _) => after(millis(80), &right(request)),
        _ => at_once(&right(request)),
    };
    let rig = Rig::new(late);
    rig.read(100, 1).unwrap_err();
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.sent(&Request::read(200, 2).unwrap()), 1, "refused, and not asked for again");
    assert!(rig.sent(&Request::read(200, 1).unwrap()) >= 2);
    assert_eq!(rig.bus.stats().total.verified, 1);
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.sent(&Request::read(200, 2).unwrap()), 1);
    // An hour later nothing is late any more.
    rig.pass(Duration::from_secs(3_600));
    let before = rig.wire.lock().unwrap().sent.len();
    assert_eq!(rig.read(300, 1).unwrap(), [300]);
    assert_eq!(rig.wire.lock().unwrap().sent.len(), before + 1);
}

/// A write could be confirmed by the answer to the same one before: nothing but time tells.
#[test]
fn a_write_waits_until_no_earlier_one_can_confirm_it() {
    let rig = Rig::new(|number, request| match number {
        // The adapter is looked at by a read, then comes the write.
        1 => after(millis(700), &right(request)),
        3 => Vec::new(), // lost on its way, never written
        _ => at_once(&right(request)),
    });
    let write = Request::write(100, 5);
    rig.ask(&write).unwrap_err();
    let error = rig.ask(&write).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { .. }), "the late confirmation is not this one's: {error}");
    assert_eq!(rig.sent(&write), 2);
}

#[test]
fn a_read_can_be_verified() {
    let verify = CallOptions::new().verify(true);
    let read = Request::read(100, 1).unwrap();
    let answer = |word: u16| {
        let mut answer = right(&[1, 3, 0, 0, 0, 1, 0x84, 0x0A]);
        answer[3..5].copy_from_slice(&word.to_be_bytes());
        let crc = drivebus_rtu::crc16(&answer[..5]).to_le_bytes();
        answer[5..].copy_from_slice(&crc);
        answer
    };
    let rig = Rig::new(move |number, _| at_once(&answer(if number == 0 { 0xBAD } else { 100 })));
    let mut words = Vec::new();
    let mut take = |given: Answer<'_>| {
        if let Answer::Read { words: given, .. } = given {
            words.extend(given.iter());
        }
    };
    rig.call(unit(1).into(), &read, verify, &mut || false, &mut take).unwrap();
    assert_eq!((words, rig.sent(&read)), (vec![100], 3));

    let rig = Rig::new(move |number, _| at_once(&answer(u16::try_from(number).unwrap())));
    let error = rig.call(unit(1).into(), &read, verify, &mut || false, &mut |_| ()).unwrap_err();
    assert!(matches!(error.failure, Failure::Disagreeing { asked: 4 }), "{error}");
}

/// A unit that refuses the echo, at a line that was just opened: its refusal could be that of another program's echo.
#[test]
fn a_refusal_of_the_echo_is_no_proof_at_first_contact() {
    let rig = Rig::fresh(
        |_, _| Vec::new(),
        |_, request| {
            let refusal = [1, 0x88, 0x01, 0x87, 0xC0];
            at_once(if request[1] == 8 { &refusal } else { return at_once(&right(request)) })
        },
    );
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert!(rig.wire.lock().unwrap().now >= Instant::ZERO + FIRST_CONTACT);
}

/// An echo of the caller's own word at a unit that refuses each: that is what the caller is told, at first contact too.
#[test]
fn an_echo_is_refused_by_a_unit_that_refuses_each() {
    let rig = Rig::fresh(
        |_, _| Vec::new(),
        |_, request| {
            let refusal = [1, 0x88, 0x01, 0x87, 0xC0];
            at_once(if request[1] == 8 { &refusal } else { return at_once(&right(request)) })
        },
    );
    for _ in 0..3 {
        let error = rig.ask(&Request::echo(0x12AB)).unwrap_err();
        assert!(matches!(error.failure, Failure::Refused { .. }), "{error}");
    }
}

/// Another drive in the place of the one that was there: what the old one knew, the new one may not.
#[test]
fn a_unit_that_returns_no_echo_any_more_is_trusted_again() {
    let mut read_lost = false;
    let rig = Rig::new(move |number, request| match (number, request[1]) {
        // The look at the adapter, and one echo.
        (0, _) | (1, 8) => at_once(&right(request)),
        (_, 8) => Vec::new(),
        _ if !std::mem::replace(&mut read_lost, true) => Vec::new(),
        _ => at_once(&right(request)),
    });
    rig.read(7, 1).unwrap();
    rig.ask(&Request::echo(0xBEEF)).unwrap();
    rig.read(100, 1).unwrap_err();
    let words = (0..20).find_map(|_| {
        rig.pass(millis(1_000));
        rig.read(200, 1).ok()
    });
    assert_eq!(words, Some(vec![200]), "{:?}", rig.bus.stats());
}

/// The refusal of an earlier write says nothing of the stop: only the stop's own would mean that nothing was done.
#[test]
fn a_stop_in_doubt_is_not_refused_by_the_late_refusal_of_another_write() {
    let refusal = [1, 0x86, 2, 0xC3, 0xA1];
    let rig = Rig::new(move |number, request| match number {
        1 => after(millis(520), &refusal),
        2 => after(millis(60), &right(request)),
        _ => at_once(&right(request)),
    });
    rig.read(7, 1).unwrap();
    rig.ask(&Request::write(0x0100, 1)).unwrap_err();
    let stop = CallOptions::new().in_doubt(true);
    rig.call(unit(1).into(), &Request::write(0x2000, 5), stop, &mut || false, &mut |_| ()).unwrap();
}

/// An echo proves something only by a word that no open echo carries.
#[test]
fn an_echo_asked_twice_is_not_confirmed_by_its_first_answer() {
    let echo = Request::echo(0x1234);
    let rig = Rig::new(|number, request| match number {
        1 => after(millis(520), &right(request)),
        _ if request == drivebus_rtu::Adu::request(unit(1).into(), &Request::echo(0x1234)).as_bytes() => Vec::new(),
        _ => after(millis(60), &right(request)),
    });
    rig.read(7, 1).unwrap();
    rig.ask(&echo).unwrap_err();
    rig.ask(&echo).expect_err("the second one was lost");
}

/// A caller's own code may panic at any moment; the bus is there for the others.
#[test]
fn a_caller_that_panics_leaves_a_bus_that_works() {
    let rig = Rig::new(|number, request| match number {
        1 => after(millis(300), &right(request)),
        _ => at_once(&right(request)),
    });
    rig.read(7, 1).unwrap();
    let read = Request::read(100, 1).unwrap();
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        rig.call(unit(1).into(), &read, CallOptions::default(), &mut || panic!("asked"), &mut |_| ())
    }));
    assert!(panicked.is_err());
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
}

/// To be sure of an answer is no reason to ask more often than the caller allows while there is none.
#[test]
fn a_verified_read_is_not_repeated_more_often_than_allowed() {
    let verify = CallOptions::new().verify(true);
    let read = Request::read(100, 1).unwrap();
    let rig = Rig::new(|_, request| {
        let mut answer = right(request);
        answer[4] ^= 1;
        at_once(&answer)
    });
    let error = rig.call(unit(1).into(), &read, verify, &mut || false, &mut |_| ()).unwrap_err();
    assert!(matches!(error.failure, Failure::Corrupt(_)), "{error}");
    assert_eq!(rig.sent(&read), 1);
}

/// A read that is repeated within its call goes out in doubt only while nobody else has asked the unit in between.
#[test]
fn a_read_that_a_stop_overtook_is_repeated_beyond_doubt() {
    let rig = Rig::new(|number, request| match number {
        1 => Vec::new(),
        // An echo comes first, then the read that overtakes.
        3 => after(millis(520), &right(request)),
        _ => after(millis(60), &right(request)),
    });
    rig.read(7, 1).unwrap();
    let (waits, it_waits) = std::sync::mpsc::channel();
    std::thread::scope(|scope| {
        let stop = || {
            let urgent = CallOptions::new().priority(Priority::Stop);
            let mut give_up = || waits.send(()).is_err();
            let read = Request::read(300, 1).unwrap();
            rig.call(unit(1).into(), &read, urgent, &mut give_up, &mut |_| ()).unwrap_err();
        };
        let (mut stop, mut came) = (Some(stop), Vec::new());
        let mut give_up = || {
            if let Some(stop) = stop.take() {
                scope.spawn(stop);
                it_waits.recv().unwrap(); // asked whether it gives up: it stands in the queue
            }
            false
        };
        let twice = CallOptions::new().retries(1);
        let read = Request::read(100, 1).unwrap();
        rig.call(unit(1).into(), &read, twice, &mut give_up, &mut |answer| {
            if let Answer::Read { words, .. } = answer {
                came = words.iter().collect();
            }
        })
        .unwrap();
        assert_eq!(came, [100]);
    });
}
