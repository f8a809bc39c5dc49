//! How a unit that may still answer something else is made sure of.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Nothing, Refuses, Right};
use crate::rig::*;

/// A line on which the unit owes the answer to a read of one word.
fn owes() -> Rig {
    let mut rig = Rig::settled().does([Nothing]);
    assert_eq!(rig.run(ask(7, 1)).end, silence(1));
    rig
}

#[test]
fn an_echo_comes_first_and_then_a_read_that_tells_its_answer_apart() {
    let told = owes().run(ask(9, 1));
    assert_eq!(told.sent, [echo(), read(9, 2)]);
    assert_eq!(told.end, End::Words(vec![9]), "with as many words as were asked for");
    assert_eq!(told.counts.resyncs, 1);
}

#[test]
fn a_write_waits_for_the_echo_and_is_sent_as_it_is() {
    let told = owes().run(set(9, 1));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![echo(), write(9, 1)]));
}

#[test]
fn what_goes_out_in_doubt_waits_for_nothing() {
    let told = owes().run(set(9, 1).in_doubt(true));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 1)]));
}

#[test]
fn a_word_of_the_callers_own_is_behind_an_echo_unless_it_is_the_latest() {
    let mut rig = owes();
    rig.always.insert(8, Nothing);
    assert_eq!(rig.run(set(9, 1)).last_sent, None, "an echo is open");
    rig.always.insert(8, Right);
    let stale = Request::echo(1);
    let told = rig.run(Question::new(UNIT.into(), stale, TIMEOUT));
    assert_eq!((told.end, told.sent.len()), (End::Confirmed, 2));
    let mut rig = owes();
    let fresh = Request::echo(rig.fresh.next());
    let told = rig.run(Question::new(UNIT.into(), fresh, TIMEOUT));
    assert_eq!((told.end, told.sent.len()), (End::Confirmed, 1));
}

#[test]
fn an_echo_that_is_refused_ends_the_doubt_as_one_that_is_returned() {
    let told = owes().always(8, Refuses(1)).run(set(9, 1));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![echo(), write(9, 1)]));
}

#[test]
fn a_unit_that_knows_no_echo_is_asked_a_read_of_another_length() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask(7, 1)).end, End::Words(vec![7]), "it lives, and 7 can be read");
    rig.always.insert(8, Nothing);
    rig.is_silent_on(ask(7, 1));
    let told = rig.run(set(9, 1));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![echo(), read(7, 2), write(9, 1)]));
}

#[test]
fn a_read_of_such_a_unit_is_put_apart_without_a_probe() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask(7, 1)).end, End::Words(vec![7]));
    rig.always.insert(8, Nothing);
    rig.is_silent_on(ask(7, 1));
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![echo(), read(9, 2)]));
    assert_eq!(told.counts.resyncs, 2, "the echo, and the read that ends the quarantine");
}

#[test]
fn who_polls_lets_others_go_first_after_each_probe_that_met_silence() {
    // One that waits echoes twice in an attempt.
    for (urgency, attempts) in [(Urgency::Call, 2), (Urgency::Poll, 4)] {
        let mut rig = owes();
        assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]), "it returns echoes");
        rig.is_silent_on(ask(7, 1));
        rig.always.insert(8, Nothing);
        rig.then = Nothing;
        let told = rig.run(ask(9, 1).urgency(urgency).retries(3));
        assert_eq!((told.end, told.last_sent), (silence(1), None), "what was asked never went out");
        assert_eq!(told.sent, vec![echo(); 4]);
        assert_eq!(told.counts.retries, attempts - 1, "{urgency:?}");
    }
}

#[test]
fn who_waits_goes_on_after_a_silent_probe() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask(7, 1)).end, End::Words(vec![7]));
    rig.is_silent_on(ask(7, 1));
    rig.always.insert(8, Nothing);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.exchanges[0], Some(Unanswered::NoAnswer { timeout: TIMEOUT, attempts: 1 }));
}

#[test]
fn what_became_of_the_latest_probe_is_told_where_nothing_settled_the_doubt() {
    let mut rig = owes().always(8, Damaged);
    rig.then = Nothing;
    let told = rig.run(set(9, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{:?}", told.end);
    assert_eq!((told.last_sent, told.raw.len()), (None, 8), "the bytes are those of the probe");
}

#[test]
fn a_call_that_meets_only_damage_sends_eight_requests_at_most_for_each_time_it_may_ask() {
    for retries in 0..3 {
        let mut rig = owes().always(8, Damaged);
        rig.then = Damaged;
        let told = rig.run(ask(9, 1).retries(retries));
        assert!(told.sent.len() < 8 * (retries as usize + 1), "{} for {retries}", told.sent.len());
    }
}

#[test]
fn at_first_contact_each_unit_is_echoed_before_it_is_asked() {
    let told = Rig::opened(Opened::new(), OwnEcho::Absent).run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![echo(), read(9, 1)]));
}

#[test]
fn at_first_contact_with_a_unit_that_knows_no_echo_its_time_is_waited_for_off_the_line() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Absent).always(8, Refuses(1));
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]), "{told:?}");
    assert_eq!(told.stood_by.last(), Some(&(Instant::ZERO + FIRST_CONTACT)));
}

#[test]
fn a_line_that_carries_nobody_elses_answers_knows_no_first_contact() {
    let told = Rig::opened(Opened::new().gapless(true), OwnEcho::Absent).run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1)]));
    assert_eq!(told.last_sent, Some(Instant::ZERO), "nor a silence between frames");
}

#[test]
fn an_answer_that_is_seen_late_by_other_means_ends_the_doubt() {
    let mut rig = owes();
    rig.known.saw_late(rig.now, &words(&[7]));
    assert_eq!(rig.run(ask(9, 1)).sent, [read(9, 1)]);
}

#[test]
fn what_comes_while_nothing_is_asked_is_counted_once() {
    let mut rig = owes();
    rig.known.stray(rig.now, &words(&[7]));
    rig.known.stray(rig.now + ms(50), &[]);
    assert_eq!(rig.known.take_strays().late, 1);
    assert_eq!(rig.known.take_strays(), Tally::default());
}

#[test]
fn fresh_words_begin_where_they_are_told_to() {
    let words = FreshWords::beginning_at(0x1234);
    assert_eq!(words.next(), 0x1234);
    words.begin_at(0x4321);
    assert_eq!(words.next(), 0x4321);
}

#[test]
fn probes_take_their_words_from_where_they_are_told_last() {
    let (own, theirs) = (FreshWords::beginning_at(7), FreshWords::beginning_at(9));
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Absent);
    let mut call = Conversation::new(ask(9, 1), &own);
    call.take_words_from(&theirs);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent[0].clone()), (End::Words(vec![9]), echo()));
    assert_eq!(own.next(), 7, "none was taken here");
    assert_ne!(theirs.next(), 9);
}
