//! What comes beside the answer or in its place: what is counted, and how the request ends.

use crate::asker::*;
use drivebus_rtu::*;

const WRITE: Request<'_> = Request::write(0x2001, 1000);

fn patient() -> Asker {
    let mut asker = Asker::new();
    let (pause, usual) = (Duration::from_millis(10), Duration::ZERO);
    asker.master.be_patient(Some(Patience::new(pause, usual)));
    asker
}

/// Bytes that come while the answer is waited for, and are not the answer.
fn comes(asker: &mut Asker, now: u64, bytes: &[u8]) {
    assert_eq!(asker.master.receive(ms(now), bytes), bytes.len());
    assert_eq!(asker.master.poll(ms(now)), None);
}

/// What is counted where only this was.
fn tally(of: impl FnOnce(&mut Tally)) -> Tally {
    let mut tally = Tally::default();
    of(&mut tally);
    tally
}

fn noise(count: usize) -> Tally {
    tally(|tally| tally.noise = count.try_into().unwrap())
}

/// A read of one word for which `before` comes, and then the answer, or nothing.
fn counted(request: &Request<'_>, before: &[&[u8]], is_answered: bool) -> Tally {
    let mut asker = patient();
    asker.sends(0, unit(1), request, TIMEOUT);
    for bytes in before {
        comes(&mut asker, 1, bytes);
    }
    if is_answered {
        let answer = if *request == WRITE { confirms(unit(1), &WRITE) } else { words(unit(1), 1, 0x5555) };
        assert_eq!(asker.hears(2, &answer), Came::Answer);
    } else {
        assert!(asker.master.poll(ms(50)).is_some());
    }
    asker.master.take_tally()
}

#[test]
fn what_came_in_the_place_of_the_answer_is_noise_where_the_answer_came() {
    let wrong = words(unit(1), 2, 0x5555);
    let mut damaged = words(unit(1), 1, 0x5555).as_bytes().to_vec();
    damaged[3] ^= 0x10;
    for spoilt in [wrong.as_bytes(), &damaged] {
        let before = [&[0x55; 3], spoilt, &[0x55; 2]];
        assert_eq!(counted(&read(1), &before, true), noise(5 + spoilt.len()), "{spoilt:02X?}");
        assert_eq!(counted(&read(1), &before, false), noise(3), "the event holds the rest: {spoilt:02X?}");
    }
    assert_eq!(counted(&read(1), &[&[0x55; 3]], false), noise(3));
}

/// All that came from the first wrong answer on; of more than a framer holds, the rest is noise.
#[test]
fn the_event_of_a_wrong_answer_holds_what_came_behind_it_too() {
    let wrong = words(unit(1), 125, 0x5555);
    let len = wrong.as_bytes().len();
    for count in 1..=4 {
        let mut asker = patient();
        asker.sends(0, unit(1), &read(1), TIMEOUT);
        (0..count).for_each(|_| comes(&mut asker, 1, wrong.as_bytes()));
        let all = wrong.as_bytes().repeat(count);
        let kept = all.len().min(512);
        match asker.master.poll(ms(11)) {
            Some(Event::Wrong { error: AnswerError::Count { asked: 1, came: 125 }, frame }) => {
                assert_eq!(frame, &all[..kept], "{count} answers");
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(asker.master.take_tally(), noise(all.len() - kept));
        let mut asker = patient();
        asker.sends(0, unit(1), &read(1), TIMEOUT);
        (0..count).for_each(|_| comes(&mut asker, 1, wrong.as_bytes()));
        assert_eq!(asker.hears(2, &words(unit(1), 1, 7)), Came::Answer);
        assert_eq!(asker.master.take_tally(), noise(count * len));
    }
}

/// Noise gives way to it where there is no room for both.
#[test]
fn a_damaged_answer_is_told_behind_any_noise() {
    let mut damaged = words(unit(1), 1, 0x5555).as_bytes().to_vec();
    damaged[3] ^= 0x10;
    for before in [0, 500, 505, 506, 511, 512, 513, 2_000] {
        let mut asker = patient();
        asker.sends(0, unit(1), &read(1), TIMEOUT);
        vec![0x55; before].chunks(100).for_each(|bytes| comes(&mut asker, 1, bytes));
        comes(&mut asker, 1, &damaged);
        match asker.master.poll(ms(11)) {
            Some(Event::Corrupt { error: FrameError::Crc { .. }, bytes }) => assert_eq!(bytes, damaged, "{before}"),
            other => panic!("{other:?}"),
        }
        assert_eq!(asker.master.take_tally(), noise(before));
    }
}

/// An adapter that sends back what it is given may lose bytes of it. What came whole is no such thing.
#[test]
fn what_may_be_left_of_the_request_is_told() {
    let own = Adu::request(unit(1).into(), &WRITE);
    let own = own.as_bytes();
    let is_told = |before: &[&[u8]]| [true, false].map(|answered| counted(&WRITE, before, answered).own_remnant);
    assert_eq!(is_told(&[&[0x55; 8]]), [0, 0]);
    assert_eq!(is_told(&[&own[1..]]), [1, 1], "its end");
    assert_eq!(is_told(&[&own[..7]]), [1, 1], "as its answer begins, damaged");
    let other = confirms(unit(1), &Request::write(0x2001, 1001));
    assert_eq!(is_told(&[other.as_bytes()]), [0, 0], "a whole frame, and wrong");
    assert_eq!(is_told(&[&own[2..6], other.as_bytes()]), [1, 1], "before a whole frame");
    let write = Request::write(0x2202, 0x1234);
    let own = Adu::request(unit(1).into(), &write);
    let mut damaged = own.as_bytes().to_vec();
    damaged[5] ^= 0x10;
    let counted = counted(&write, &[&own.as_bytes()[2..6], &damaged], false);
    assert_eq!(
        counted,
        tally(|tally| (tally.own_remnant, tally.noise) = (1, 4)),
        "before it and in its place: of one request"
    );
}

/// Answers and refusals without their first byte, or the second.
#[test]
fn an_answer_that_lost_its_head_is_damaged_and_not_noise() {
    let cases = [(words(unit(1), 1, 7), 1), (refuses(unit(1), &read(1)), 2)];
    for ((frame, first), lost) in cases.into_iter().flat_map(|case| [(case, 0), (case, 1)]) {
        let mut bytes = frame.as_bytes().to_vec();
        bytes.remove(lost);
        let mut asker = patient();
        asker.sends(0, unit(1), &read(1), TIMEOUT);
        comes(&mut asker, 1, &bytes);
        match asker.master.poll(ms(11)) {
            Some(Event::Corrupt { bytes: came, .. }) => assert_eq!(came, bytes, "case {first} without {lost}"),
            other => panic!("case {first} without {lost}: {other:?}"),
        }
        assert_eq!(asker.master.take_tally(), Tally::default());
    }
}

/// What stands before the beginning of an answer was not the answer, whatever it looked like.
#[test]
fn an_answer_that_begins_behind_one_without_its_head_is_waited_for() {
    let answer = words(unit(1), 1, 7);
    let mut asker = Asker::new();
    asker.sends(0, unit(1), &read(1), TIMEOUT);
    comes(&mut asker, 1, &[&answer.as_bytes()[1..], &answer.as_bytes()[..3]].concat());
    assert_eq!(asker.master.receive(ms(2), &answer.as_bytes()[3..]), 4);
    assert!(matches!(asker.master.poll(ms(2)), Some(Event::Answer(_))));
    // Alone it is told at once by who has no patience.
    asker.sends(10, unit(1), &read(1), TIMEOUT);
    asker.master.receive(ms(11), &answer.as_bytes()[1..]);
    assert!(matches!(asker.master.poll(ms(11)), Some(Event::Corrupt { .. })));
}

/// Who searches the states of a master tells them apart by what it prints.
#[test]
fn a_master_prints_what_came_beside_the_answer_until_the_next_request() {
    let mut came = [0x55, 0x66].map(|byte| {
        let mut asker = patient();
        asker.sends(0, unit(1), &read(1), TIMEOUT);
        comes(&mut asker, 1, &[byte; 3]);
        asker
    });
    let prints = |came: &[Asker; 2]| came.each_ref().map(|asker| format!("{:?}", asker.master));
    let [one, other] = prints(&came);
    assert_ne!(one, other);
    for asker in &mut came {
        asker.master.abort(ms(49));
        asker.leaves_open(50, unit(1), &read(1));
    }
    let [one, other] = prints(&came);
    assert_eq!(one, other);
}

/// While the units act on a broadcast, the adapter's echo of it is that, and all else is late.
#[test]
fn only_the_broadcast_itself_is_the_adapters_echo() {
    let mut master = Master::with_silence(Duration::ZERO);
    let own = Adu::request(Destination::Broadcast, &WRITE);
    let comes = |master: &mut Master, now, frame: &Adu| {
        master.receive(ms(now), frame.as_bytes());
        assert_eq!(master.poll(ms(now)), None);
        master.take_tally()
    };
    master.begin(ms(0), Destination::Broadcast, &WRITE, TURNAROUND).unwrap();
    assert!(matches!(master.poll(ms(0)), Some(Event::Transmit(_))));
    master.sent(ms(0));
    let late = tally(|tally| tally.late = 1);
    assert_eq!(comes(&mut master, 1, &own), tally(|tally| tally.own_echo = 1));
    assert_eq!(comes(&mut master, 2, &words(unit(1), 1, 7)), late);
    assert_eq!(master.poll(ms(100)), Some(Event::BroadcastDone));
    assert_eq!(comes(&mut master, 101, &own), late, "nothing is in flight");
}

/// What does not fit is late while something else is owed that it cannot be told from, and wrong where nothing is.
#[test]
fn what_does_not_fit_is_late_only_where_something_is_owed() {
    let late = |asker: &mut Asker| asker.master.take_tally().late;
    let ask_four = |asker: &mut Asker, now, came| asker.asks(now, unit(1), &read(4), &words(unit(1), came, 7));
    let wrong = |came| Came::Wrong(AnswerError::Count { asked: 4, came });
    let mut asker = Asker::new();
    assert_eq!(ask_four(&mut asker, 0, 1), wrong(1));
    // Fewer words are open: in quarantine, settled but not past, and past.
    for (settled_at, now, expected) in [(None, 2_999, true), (Some(500), 2_999, true), (Some(500), 3_000, false)] {
        let mut asker = Asker::new();
        asker.leaves_open(0, unit(1), &read(2));
        if let Some(at) = settled_at {
            asker.echoes(at, unit(1));
        }
        assert_eq!(ask_four(&mut asker, now, 1), if expected { Came::Nothing } else { wrong(1) }, "at {now} ms");
        assert_eq!(late(&mut asker), u32::from(expected));
    }
    // Quarantine that time ended leaves nothing owed, an echo of another word included.
    let mut asker = Asker::new();
    asker.leaves_open(0, unit(1), &read(2));
    assert_eq!(ask_four(&mut asker, 3_000, 1), wrong(1));
    // More words are open than are asked for: those are late, others may be what some units answer.
    let mut asker = Asker::new();
    asker.leaves_open(0, unit(1), &read(5));
    assert_eq!(ask_four(&mut asker, 0, 5), Came::Nothing);
    assert_eq!(late(&mut asker), 1);
    let mut asker = Asker::new();
    asker.leaves_open(0, unit(1), &read(5));
    assert_eq!(ask_four(&mut asker, 0, 3), wrong(3));
}

#[test]
fn another_word_than_the_fresh_one_is_late_only_where_an_echo_may_be_owed() {
    let (fresh, other) = (Request::echo(0xBEEF), confirms(unit(1), &Request::echo(0xDEAD)));
    let wrong = Came::Wrong(AnswerError::Echo { asked: [0, 0xBEEF], came: [0, 0xDEAD] });
    assert_eq!(Asker::new().asks(0, unit(1), &fresh, &other), wrong, "nobody asked for it");
    let mut asker = Asker::new();
    asker.master.opened(ms(0));
    assert_eq!(asker.asks(999, unit(1), &fresh, &other), Came::Nothing, "another program may have");
    let mut asker = Asker::new();
    asker.master.opened(ms(0));
    assert_eq!(asker.asks(1_000, unit(1), &fresh, &other), wrong);
    for echoes in [false, true] {
        let mut asker = if echoes { Asker::of_a_unit_that_echoes() } else { Asker::new() };
        asker.leaves_echo_open(0, unit(1));
        assert_eq!(asker.asks(9_000, unit(1), &fresh, &other), Came::Nothing, "an echo is open");
    }
}

/// A unit that returns echoes owes one, and nothing else: a read is told apart from that, but what does not fit is late.
#[test]
fn beside_an_open_echo_what_does_not_fit_is_late() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_echo_open(0, unit(1));
    assert_eq!(asker.asks(0, unit(1), &read(4), &words(unit(1), 1, 7)), Came::Nothing);
}

#[test]
fn a_write_is_refused_where_no_other_of_its_function_can_be_meant() {
    let other = Request::write(0x2001, 1001);
    let refused = |asker: &mut Asker, now| asker.asks(now, unit(1), &WRITE, &refuses(unit(1), &WRITE));
    for (open, expected) in [(WRITE, Came::Refusal), (other, Came::Nothing), (read(1), Came::Refusal)] {
        let mut asker = Asker::new();
        asker.leaves_open(0, unit(1), &open);
        assert_eq!(refused(&mut asker, 100), expected, "{open:?} is open");
        let mut asker = Asker::new();
        asker.leaves_open(0, unit(2), &open);
        assert_eq!(refused(&mut asker, 100), Came::Refusal, "of another unit");
    }
    for (now, expected) in [(999, Came::Nothing), (1_000, Came::Refusal)] {
        let mut asker = Asker::new();
        asker.master.opened(ms(0));
        assert_eq!(refused(&mut asker, now), expected, "{now} ms after the line was opened");
    }
}
