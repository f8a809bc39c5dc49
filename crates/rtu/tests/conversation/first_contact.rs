//! A stop's reads on a line that was just opened, where no echo comes back.

use drivebus_rtu::*;

use crate::rig::Does::{Nothing, Refuses, Right, Says};
use crate::rig::*;

/// A line that was just opened, with a unit that refuses echoes, as it has shown.
fn rig() -> Rig {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Absent);
    rig.now = at(5_000);
    rig.always.insert(8, Refuses(1));
    let echo = Request::echo(1);
    assert!(matches!(rig.run(Question::new(UNIT.into(), echo, TIMEOUT)).end, End::Failed(Unanswered::Refused { .. })));
    rig.known.opened(rig.now, &Opened::new());
    rig
}

fn stop(count: u16) -> Question<'static> {
    ask(9, count).urgency(Urgency::Stop)
}

#[test]
fn a_stop_does_not_wait_for_the_second_that_others_wait() {
    let mut rig = rig();
    let began = rig.now;
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [read(9, 1), read(9, 2), read(9, 3)], "each in a length of its own");
    assert!(told.stood_by.is_empty() && rig.now < began + ms(200));
    assert_eq!(told.counts.resyncs, 3);
    let told = rig.run(stop(1));
    assert_eq!(told.sent, [read(9, 1)], "the unit has caught up");
}

#[test]
fn two_answers_of_another_program_are_never_taken_for_the_own_one() {
    let mut rig = rig();
    // What another program asked for came first: two answers in the very lengths that are asked for.
    rig.next([Says(words(&[0x111])), Says(words(&[0x222, 0x222]))]);
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
}

#[test]
fn a_verified_stop_or_a_call_waits_for_the_second() {
    for question in [stop(1).verify(true), ask(9, 1)] {
        let mut rig = rig();
        let end = rig.now + FIRST_CONTACT;
        let told = rig.run(question);
        assert_eq!(told.end, End::Words(vec![9]));
        assert!(rig.now >= end, "{told:?}");
    }
}

#[test]
fn where_no_longer_read_is_given_an_input_register_comes_first() {
    let mut rig = rig();
    rig.most = 1;
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    let functions: Vec<_> = told.sent.iter().map(|frame| frame[1]).collect();
    assert!(functions.contains(&4), "{functions:?}");
    assert_eq!(told.sent.last(), Some(&read(9, 1)));
}

#[test]
fn a_refused_input_register_proves_as_much() {
    let mut rig = rig().always(4, Refuses(1));
    rig.most = 1;
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]), "{told:?}");
}

#[test]
fn silence_is_told_as_anywhere() {
    let mut rig = rig();
    rig.then = Nothing;
    let told = rig.run(stop(1));
    assert!(matches!(told.end, End::Failed(Unanswered::NoAnswer { .. })), "{told:?}");
}

#[test]
fn what_prepares_the_question_takes_none_of_its_requests() {
    let mut rig = rig();
    rig.next([Right, Right, Nothing, Nothing, Right]);
    let told = rig.run(stop(1).retries(2));
    assert_eq!(told.end, End::Words(vec![9]), "{told:?}");
}

#[test]
fn a_write_and_a_stop_in_doubt_are_put_as_they_are() {
    let mut rig = rig();
    let told = rig.run(set(9, 1).urgency(Urgency::Stop).in_doubt(true));
    assert_eq!(told.sent, [write(9, 1)]);
    let told = rig.run(stop(1).in_doubt(true));
    assert_eq!(told.sent, [read(9, 1)]);
}
