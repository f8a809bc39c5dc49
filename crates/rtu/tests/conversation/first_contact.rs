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
    assert_eq!(told.sent.len(), 1, "it ends the attempt");
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

#[test]
fn a_length_that_was_asked_for_in_doubt_tells_nothing() {
    let mut rig = rig();
    for count in [1, 2] {
        assert_eq!(rig.run(stop(count).in_doubt(true)).sent, [read(9, count)]);
    }
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [read(9, 3)], "two were answered before, and this one has a length of its own");
}

#[test]
fn an_input_register_that_was_asked_for_in_doubt_tells_nothing() {
    let input = Request::read_of(Table::Input, 9, 1).unwrap();
    for refused in [false, true] {
        let mut rig = rig();
        rig.most = 1;
        if refused {
            rig.always.insert(4, Refuses(1));
        }
        rig.run(Question::new(UNIT.into(), input, TIMEOUT).urgency(Urgency::Stop).in_doubt(true));
        let told = rig.run(stop(1));
        assert!(told.sent.iter().all(|frame| frame[1] != 4), "{:02X?}", told.sent);
    }
}

#[test]
fn where_something_was_asked_whose_answer_may_have_any_shape_only_time_tells() {
    let mut rig = rig();
    let end = rig.now + FIRST_CONTACT;
    let custom = Request::custom(&[0x41, 7], AnswerLength::Bytes(2)).unwrap();
    rig.run(Question::new(UNIT.into(), custom, TIMEOUT).urgency(Urgency::Stop).in_doubt(true));
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert!(rig.now >= end, "{told:?}");
}

#[test]
fn where_too_few_questions_can_be_told_apart_nothing_is_believed() {
    // No unit is asked for more words than these, and of two answers both may be another program's.
    let told = rig().run(stop(16));
    assert_eq!(told.end, End::Failed(Unanswered::Doubtful), "{:02X?}", told.sent);
}

#[test]
fn silence_is_no_answer_of_another_program() {
    let mut rig = rig();
    for count in 1..=2 {
        let told = rig.next([Nothing]).run(stop(1));
        assert_eq!(told.sent, [read(9, count)]);
    }
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [read(9, 3), read(9, 4), read(9, 5)], "two are still to come before the own one");
}

#[test]
fn a_unit_that_was_silent_on_longer_reads_twice_is_not_asked_for_them_again() {
    let mut rig = rig();
    let told = rig.next([Right, Nothing]).run(stop(1));
    assert_eq!(told.sent, [read(9, 1), read(9, 2)]);
    let told = rig.next([Nothing]).run(stop(1));
    assert_eq!(told.sent, [read(9, 3)]);
    let told = rig.run(stop(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent[0][1], 4, "an input register");
}

#[test]
fn what_only_shows_whose_answer_it_is_is_never_the_answer() {
    let mut rig = rig();
    rig.next([Says(words(&[0x111])), Says(words(&[0x222, 0x222])), Says(words(&[5, 6, 7]))]);
    assert_eq!(rig.run(stop(1)).end, End::Words(vec![5]));
}

#[test]
fn that_a_read_was_refused_as_it_was_asked_says_only_that_no_more_is_given_there() {
    let mut rig = rig();
    rig.next([Refuses(2)]);
    assert_eq!(rig.run(stop(2)).sent[0], read(9, 2));
    rig.now = rig.now + ms(10_000);
    rig.is_silent_on(ask(0x100, 1).in_doubt(true));
    let told = rig.run(ask(9, 2));
    assert_eq!((told.end, told.sent), (End::Words(vec![9, 10]), vec![read(9, 2)]), "one word is not taken for two");
}

#[test]
fn a_port_that_cannot_be_used_behind_an_input_register_ends_the_call() {
    let (mut rig, fresh) = (rig(), FreshWords::beginning_at(1));
    rig.most = 1;
    assert_eq!(rig.run(stop(1).in_doubt(true)).sent, [read(9, 1)]);
    let mut call = Conversation::new(stop(1), &fresh);
    let mut refusal = Vec::new();
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(frame) if frame[1] == 4 => break,
            Step::Send(frame) => {
                refusal = sealed(&[UNIT.get(), frame[1] | 0x80, 3]);
                call.sent(&mut rig.known, rig.now).unwrap();
            }
            Step::Listen(until) => {
                let bytes = std::mem::take(&mut refusal);
                rig.now = if bytes.is_empty() { rig.now.max(until) } else { rig.now };
                call.heard(rig.now, &mut rig.known, &bytes).unwrap();
            }
            Step::Done(outcome) => panic!("{outcome:?}"),
            _ => {}
        }
    }
    call.cut_short(rig.now, &mut rig.known, Cut::Unusable);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::Unusable)), 0));
}

#[test]
fn one_echo_that_was_refused_is_one_answer() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Absent).always(8, Refuses(1));
    let stale = Question::new(UNIT.into(), Request::echo(1), TIMEOUT);
    let told = rig.run(stale);
    assert!(matches!(told.end, End::Failed(Unanswered::Refused { .. })), "{told:?}");
    assert_eq!(told.sent.len(), 2, "what made sure of the unit, and the question");
    let told = rig.run(stop(1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1), read(9, 2)]));
}
