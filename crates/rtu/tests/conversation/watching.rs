//! Answers that are soon to come if they come at all: it is seen off the line whether they do, and nothing is sent meanwhile.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Late, Nothing, Right};
use crate::rig::words as words_of;
use crate::rig::*;

/// So much too late the answers of the unit come.
const LATE: Duration = ms(40);
/// So long after it was given up another one is waited for.
const WORTH: Duration = ms(80);

/// A unit that was late once, as was seen.
fn late() -> Rig {
    let mut rig = Rig::settled().does([Late(TIMEOUT + ms(5) + LATE)]);
    assert_eq!(rig.run(ask(7, 1)).end, silence(1));
    rig.now = rig.now + LATE;
    rig.known.stray(rig.now, &words(&[7]));
    rig.now = rig.now + ms(300);
    rig
}

/// The same, and it owes the answer to a read of one word since now.
fn owes() -> Rig {
    let mut rig = late();
    rig.is_silent_on(ask(7, 1));
    rig
}

#[test]
fn an_answer_that_comes_while_the_call_stands_by_leaves_nothing_in_doubt() {
    let mut rig = late();
    rig.next([Late(TIMEOUT + ms(5) + LATE)]);
    assert_eq!(rig.run(ask(7, 1)).end, silence(1));
    let began = rig.now;
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1)]), "nobody had to be echoed");
    assert!(told.sent_at[0] >= began + LATE);
}

#[test]
fn one_that_does_not_come_is_waited_for_so_long_and_then_the_unit_is_made_sure_of() {
    let mut rig = owes();
    let began = rig.now;
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent[0].clone()), (End::Words(vec![9]), echo()));
    assert_eq!(told.stood_by.last(), Some(&(began + WORTH)));
}

#[test]
fn one_that_takes_most_of_a_time_out_is_waited_for_where_nothing_else_tells_it_apart() {
    for (late, words) in [(ms(60), 1), (ms(60), 16), (TIMEOUT + ms(20), 16)] {
        let mut rig = Rig::settled().does([Nothing]);
        assert_eq!(rig.run(ask(7, words)).end, silence(1));
        rig.now = rig.now + late;
        let whole: Vec<_> = (7..7 + words).collect();
        rig.known.stray(rig.now, &words_of(&whole));
        rig.now = rig.now + ms(300);
        rig.is_silent_on(ask(7, words));
        let began = rig.now;
        let told = rig.run(ask(9, words));
        assert_eq!(told.end, End::Words((9..9 + words).collect()));
        let is_waited_for = told.stood_by.contains(&(began + TIMEOUT));
        assert_eq!(is_waited_for, words == 16 && late < TIMEOUT, "{late:?}, {words} words");
    }
}

#[test]
fn one_that_came_damaged_is_waited_for_where_no_longer_read_tells_it_apart() {
    for (words, waits) in [(1, Duration::ZERO), (16, TIMEOUT)] {
        let mut rig = Rig::settled().does([Damaged]);
        rig.known.be_patient(Some(Patience::new(ms(20), ms(50))));
        assert!(matches!(rig.run(ask(7, words)).end, End::Failed(Unanswered::Corrupt(_))));
        let began = rig.now;
        let told = rig.run(ask(9, words));
        assert_eq!(told.end, End::Words((9..9 + words).collect()));
        assert_eq!(told.sent_at[0], began + waits, "{words} words");
    }
}

#[test]
fn a_stop_and_what_goes_out_in_doubt_wait_for_none() {
    for question in [ask(9, 1).urgency(Urgency::Stop), ask(9, 1).in_doubt(true)] {
        let told = owes().run(question);
        assert_eq!((told.end, told.stood_by.len()), (End::Words(vec![9]), 0));
    }
}

#[test]
fn it_is_waited_for_no_longer_than_the_call_may_take_whatever_else_is_left_open_meanwhile() {
    let mut rig = owes();
    rig.script = vec![Nothing; 3].into();
    rig.always.insert(8, Right);
    // Three times another call leaves an answer open, each the first time that this one has stood by.
    for pass in 0..60 {
        rig.meanwhile.push_back((pass % 20 == 15).then(|| ask(7, 1).in_doubt(true)));
    }
    let began = rig.now;
    let told = rig.run(ask(9, 1));
    assert_eq!(told.sent[0], echo(), "{told:?}");
    let others = told.stood_by.windows(2).map(|two| two[1].saturating_duration_since(two[0]));
    let others: Duration = others.filter(|apart| *apart > TIMEOUT).map(|_| TIMEOUT + ms(5)).sum();
    let waited = told.sent_at[0].saturating_duration_since(began);
    assert!(waited <= TIMEOUT + others + ms(20), "{waited:?} and {others:?} of them others had the line");
}

#[test]
fn the_same_is_asked_again_as_it_was_when_its_answer_was_waited_for() {
    let mut rig = late();
    // No longer read than this tells its answer apart.
    rig.next([Nothing, Right]);
    let told = rig.run(ask(9, 16).retries(1));
    assert_eq!(told.end, End::Words((9..25).collect()));
    assert_eq!(told.sent, [read(9, 16), read(9, 16)]);
    assert!(!told.stood_by.is_empty());
}

#[test]
fn an_answer_that_may_overtake_is_waited_for_though_the_unit_is_sure() {
    let mut rig = owes();
    assert_eq!(rig.run(set(9, 1)).sent, [echo(), write(9, 1)]);
    let told = rig.run(ask(9, 1).verify(true));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![1]), 2));
    assert!(!told.stood_by.is_empty());
}

#[test]
fn what_another_call_leaves_open_between_two_attempts_is_not_what_this_one_did() {
    for other in [None, Some(ask(8, 1).in_doubt(true))] {
        let mut rig = Rig::settled().does([Nothing, Nothing]);
        let is_undisturbed = other.is_none();
        rig.meanwhile = [None, other].into();
        if is_undisturbed {
            rig.next([Nothing]);
        }
        let told = rig.run(ask(7, 1).retries(1));
        assert_eq!(told.end, End::Words(vec![7]));
        let then = if is_undisturbed { read(7, 1) } else { echo() };
        assert_eq!(told.sent[..2], [read(7, 1), then]);
    }
}

#[test]
fn who_is_patient_hears_the_right_answer_behind_a_damaged_one() {
    for patience in [None, Some(Patience::new(ms(20), ms(50)))] {
        let mut rig = Rig::settled().does([Damaged]);
        rig.known.be_patient(patience);
        rig.comes(ms(15), words(&[7]));
        let end = rig.run(ask(7, 1)).end;
        assert_eq!(end == End::Words(vec![7]), patience.is_some(), "{end:?}");
    }
}
