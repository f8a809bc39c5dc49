//! Reads that are put more than once: until their answers agree, in a longer form, and once more as they were.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use drivebus_line::{CallError, CallOptions, Failure};
use drivebus_rtu::{Adu, Answer, ExceptionCode, OVERTAKING, Request};

use crate::scripted::{Pieces, Rig, at_once, millis, right, unit};

/// What reads of these addresses are left open by: nobody ever answers them.
const LOST: u16 = 0x1000;
/// The unit is known to give no more, so that a longer form helps nobody, and there are no two parts of it.
const MOST: u16 = 2;

fn words_of(request: &[u8]) -> (u16, u16) {
    let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
    (word(2), word(4))
}

fn refusal(function: u8) -> Vec<u8> {
    let refusal = Answer::exception(function, ExceptionCode::ILLEGAL_ADDRESS);
    Adu::answer(unit(1), &refusal).as_bytes().to_vec()
}

/// As the right answer, but of registers that all hold `word`.
fn all(word: u16, count: u16) -> Vec<u8> {
    let words = vec![word; usize::from(count)];
    Adu::answer(unit(1), &Answer::read(&words).unwrap()).as_bytes().to_vec()
}

/// A unit that returns echoes, and does what `script` says with the read of register 200 of this number, counted from 0.
fn rig(mut script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static) -> Rig {
    let mut reads = 0..;
    let is_known = Arc::new(AtomicBool::new(false));
    let is_scripted = Arc::clone(&is_known);
    let rig = Rig::new(move |_, request| match (request[1], words_of(request)) {
        (3, (LOST.., _)) => Vec::new(),
        (3, (200, 3..)) => at_once(&refusal(3)),
        (3, (200, _)) if is_scripted.load(Relaxed) => script(reads.next().unwrap(), request),
        _ => at_once(&right(request)),
    });
    leave_open(&rig, 1);
    rig.ask(&read_200()).unwrap();
    pass_long(&rig);
    rig.forget_sent();
    is_known.store(true, Relaxed);
    rig
}

/// So many reads of two words are left open.
fn leave_open(rig: &Rig, rivals: u16) {
    (0..rivals).for_each(|rival| lose(rig, &Request::read(LOST + rival, MOST).unwrap()));
}

/// A read that is put as it is, and not answered.
fn lose(rig: &Rig, read: &Request<'_>) {
    let in_doubt = CallOptions::new().in_doubt(true);
    rig.call(unit(1).into(), read, in_doubt, &mut || false, &mut |_| ()).unwrap_err();
}

fn read_200() -> Request<'static> {
    Request::read(200, MOST).unwrap()
}

fn retried(rig: &Rig, request: &Request<'_>, retries: u32) -> Result<Vec<u16>, Box<CallError>> {
    let (options, mut came) = (CallOptions::new().retries(retries), Vec::new());
    rig.call(unit(1).into(), request, options, &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            came = words.iter().collect();
        }
    })?;
    Ok(came)
}

/// One answer more than there are open ones of others, so that one of them is the answer.
#[test]
fn the_same_words_come_once_more_often_than_others_may() {
    for rivals in 0..=3 {
        let rig = rig(|_, request| at_once(&right(request)));
        let before = rig.bus.stats().total.verified;
        leave_open(&rig, rivals);
        assert_eq!(rig.ask(&read_200()).unwrap(), (200..202).collect::<Vec<_>>());
        assert_eq!(rig.sent(&read_200()), 1 + usize::from(rivals), "{rivals} open");
        assert_eq!(rig.bus.stats().total.verified - before, u64::from(rivals > 0), "{rivals} open");
    }
}

/// Each answer that is needed on top may fail once, and is no more than that.
#[test]
fn silence_ends_a_question_that_is_repeated() {
    for rivals in 0..=3 {
        for retries in 0..=1 {
            let rig = rig(|_, _| Vec::new());
            let before = rig.bus.stats().total.retries;
            leave_open(&rig, rivals);
            let asked = 1 + u32::from(rivals) + retries;
            let error = retried(&rig, &read_200(), retries).unwrap_err();
            let timeout = millis(500);
            assert_eq!(error.failure, Failure::NoAnswer { timeout, attempts: asked }, "{rivals} open: {error}");
            assert_eq!(rig.sent(&read_200()), usize::try_from(asked).unwrap(), "{rivals} open");
            assert_eq!(rig.bus.stats().total.retries - before, u64::from(asked - 1));
        }
    }
}

/// What this call has left open itself is no rival: it goes on with the question, and with what it heard.
#[test]
fn an_answer_that_is_lost_on_the_way_costs_one_question_more() {
    for lost in 0..=1 {
        let rig = rig(move |number, request| if number == lost { Vec::new() } else { at_once(&right(request)) });
        leave_open(&rig, 1);
        let before = rig.bus.stats().total.resyncs;
        assert_eq!(rig.ask(&read_200()).unwrap(), (200..202).collect::<Vec<_>>());
        assert_eq!(rig.sent(&read_200()), 3, "two agree, and number {lost} is lost");
        assert_eq!(rig.bus.stats().total.resyncs - before, 1, "one echo before all of them");
    }
}

#[test]
fn a_refusal_is_believed_when_it_came_often_enough() {
    for rivals in 0..=2 {
        let rig = rig(|_, request| at_once(&refusal(request[1])));
        leave_open(&rig, rivals);
        let error = rig.ask(&read_200()).unwrap_err();
        assert!(matches!(error.failure, Failure::Refused { function: 3, .. }), "{error}");
        assert_eq!(rig.sent(&read_200()), 1 + usize::from(rivals), "{rivals} open");
    }
}

/// A refusal may be a late one too: what is read when nothing can be late any more decides, and not that this was refused.
#[test]
fn a_refusal_among_words_that_change_is_not_believed() {
    let rig = rig(|number, request| match number {
        3 => at_once(&refusal(request[1])),
        _ => at_once(&all(u16::try_from(number).unwrap(), MOST)),
    });
    leave_open(&rig, 1);
    assert_eq!(rig.ask(&read_200()).unwrap(), [4; 2]);
}

#[test]
fn a_refusal_between_the_same_words_is_none_of_them() {
    let rig = rig(|number, request| if number == 1 { at_once(&refusal(3)) } else { at_once(&right(request)) });
    leave_open(&rig, 1);
    assert_eq!(rig.ask(&read_200()).unwrap(), (200..202).collect::<Vec<_>>());
    assert_eq!(rig.sent(&read_200()), 3);
}

/// Nothing outvotes what is another one each time: after twice as many answers as would have to agree it is read when nothing can
/// be late any more.
#[test]
fn words_that_change_are_read_when_nothing_can_be_late() {
    for rivals in 1..=3 {
        let rig = rig(|number, _| at_once(&all(u16::try_from(number).unwrap(), MOST)));
        leave_open(&rig, rivals);
        let began = rig.now();
        let differ = 2 * (1 + rivals);
        assert_eq!(rig.ask(&read_200()).unwrap(), [differ; 2], "{rivals} open");
        assert_eq!(rig.sent(&read_200()), usize::from(differ) + 1);
        assert!(rig.since(began) > OVERTAKING);
    }
}

/// A unit that is silent on 08H, and does what `script` says with reads of more words than one from register 200, counted from
/// 0. A read of one word was left open.
fn without_echo(mut script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static) -> Rig {
    let mut longer = 0..;
    let rig = Rig::new(move |_, request| match (request[1], words_of(request)) {
        (8, _) | (3, (LOST.., _)) => Vec::new(),
        (3, (200, 2..)) => script(longer.next().unwrap(), request),
        _ => at_once(&right(request)),
    });
    assert_eq!(rig.read(7, 1).unwrap(), [7]);
    lose_one(&rig);
    // That it knows no echo is learned by this.
    assert_eq!(rig.read(150, 1).unwrap(), [150]);
    pass_long(&rig);
    lose_one(&rig);
    rig
}

fn lose_one(rig: &Rig) {
    lose(rig, &Request::read(LOST, 1).unwrap());
}

/// Whatever is still open comes no more.
fn pass_long(rig: &Rig) {
    rig.pass(millis(20_000));
    assert_eq!(rig.read(7, 1).unwrap(), [7]);
}

/// How many reads of register 200 went out for so many words.
fn longer(rig: &Rig, count: u16) -> usize {
    rig.sent(&Request::read(200, count).unwrap())
}

#[test]
fn a_longer_read_that_is_lost_is_asked_again_as_it_was() {
    let rig = without_echo(|number, request| if number == 0 { Vec::new() } else { at_once(&right(request)) });
    let before = rig.wire.lock().unwrap().sent.len();
    assert_eq!(retried(&rig, &Request::read(200, 1).unwrap(), 1).unwrap(), [200]);
    assert_eq!(longer(&rig, 2), 2);
    assert_eq!(rig.wire.lock().unwrap().sent.len() - before, 2, "nothing had to come before it");
}

#[test]
fn a_longer_read_that_was_refused_is_not_asked_for_again() {
    let rig = without_echo(|_, request| at_once(&refusal(request[1])));
    for _ in 0..3 {
        assert_eq!(rig.read(200, 1).unwrap(), [200]);
        // The register that was read last is the one for reads that settle a doubt.
        assert_eq!(rig.read(7, 1).unwrap(), [7]);
        lose_one(&rig);
    }
    assert_eq!((longer(&rig, 2), longer(&rig, 3)), (1, 0));
}

#[test]
fn longer_reads_that_met_with_silence_twice_in_a_row_are_not_asked_for_again() {
    let rig = without_echo(|_, _| Vec::new());
    rig.read(200, 1).unwrap_err();
    rig.read(200, 1).unwrap_err();
    assert_eq!((longer(&rig, 2), longer(&rig, 3)), (1, 1), "each of a length that nothing open has");
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(longer(&rig, 4), 0);
}

/// A unit that gives them is not at fault.
#[test]
fn longer_reads_that_came_damaged_are_asked_for_again() {
    let rig = without_echo(|number, request| {
        let mut answer = right(request);
        answer[4] ^= u8::from(number < 2);
        at_once(&answer)
    });
    rig.read(200, 1).unwrap_err();
    rig.read(200, 1).unwrap_err();
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!((longer(&rig, 2), longer(&rig, 3), longer(&rig, 4)), (1, 1, 1));
}

/// What was refused as its caller put it says nothing of longer forms: a unit may be busy for a moment.
#[test]
fn a_read_that_can_be_told_apart_as_it_is_may_be_refused_and_put_so_again() {
    let rig = without_echo(|number, request| if number < 3 { at_once(&refusal(3)) } else { at_once(&right(request)) });
    let error = rig.read(200, 2).unwrap_err();
    assert!(matches!(error.failure, Failure::Refused { .. }), "{error}");
    pass_long(&rig);
    lose_one(&rig);
    let before = rig.wire.lock().unwrap().sent.len();
    assert_eq!(rig.read(200, 2).unwrap(), [200, 201]);
    assert_eq!(rig.wire.lock().unwrap().sent.len() - before, 1, "nothing had to come before it");
}
