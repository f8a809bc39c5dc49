//! Reads that are asked until the answers agree.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Late, Nothing, Refuses, Right, Says};
use crate::rig::*;

#[test]
fn a_read_that_is_verified_is_asked_until_two_in_a_row_agree() {
    let told = Rig::settled().run(ask(7, 1).verify(true));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 2));
    assert_eq!(told.counts.verified, 1);
    let told = Rig::settled().does([Says(words(&[8])), Right, Right]).run(ask(7, 1).verify(true));
    assert_eq!((told.end, told.sent.len(), told.counts.verified), (End::Words(vec![7]), 3, 1));
}

#[test]
fn answers_that_never_agree_are_told_as_that() {
    let changes = (0..9).map(|word| Says(words(&[word])));
    let told = Rig::settled().does(changes).run(ask(7, 1).verify(true));
    assert_eq!(told.end, End::Failed(Unanswered::Disagreeing { asked: 4 }));
    assert_eq!(told.sent.len(), 4, "twice as many as have to agree");
    let changes = (0..20).map(|word| Says(words(&[word])));
    let told = Rig::settled().does(changes).run(ask(7, 1).verify(true).retries(1));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::Disagreeing { asked: 4 }), 8));
}

#[test]
fn a_refusal_of_what_is_verified_is_believed_at_once_where_nothing_is_open() {
    let told = Rig::settled().does([Refuses(2)]).run(ask(7, 1).verify(true));
    let refused = Unanswered::Refused { function: 3, code: ExceptionCode(2) };
    assert_eq!((told.end, told.sent.len()), (End::Failed(refused), 1));
}

#[test]
fn what_was_heard_before_a_silence_of_this_call_still_counts() {
    let told = Rig::settled().does([Right, Nothing, Right]).run(ask(7, 1).verify(true).retries(1));
    assert_eq!((told.end, told.sent), (End::Words(vec![7]), vec![read(7, 1); 3]));
}

#[test]
fn a_write_is_sent_once_though_it_is_to_be_verified() {
    let told = Rig::settled().run(set(7, 1).verify(true));
    assert_eq!((told.end, told.sent.len()), (End::Confirmed, 1));
}

/// A unit that gives no more words than were asked for, and owes one answer of the same length.
fn owes_one() -> Rig {
    let mut rig = Rig::settled();
    rig.most = 1;
    rig.is_silent_on(ask(7, 1));
    rig
}

#[test]
fn where_a_longer_read_is_refused_the_answers_have_to_agree() {
    let mut rig = owes_one();
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [echo(), read(9, 2), read(9, 1), read(9, 1)]);
    assert_eq!((told.counts.resyncs, told.counts.verified), (1, 1));
    let told = rig.run(ask(9, 1));
    assert_eq!(told.sent, [read(9, 1), read(9, 1)], "that it gives no more is remembered");
}

#[test]
fn an_answer_that_overtook_another_is_outvoted() {
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    rig.next([Refuses(3), Says(words(&[7])), Right, Right]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]), "the first was the one that was owed");
}

#[test]
fn a_refusal_has_to_come_as_often_where_one_is_owed() {
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    // The longer read was refused, too. That refusal may have been meant for the one that is owed: one of the two may come.
    rig.next([Refuses(3), Refuses(2), Refuses(2), Right]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Failed(Unanswered::Refused { function: 3, code: ExceptionCode(2) }));
    assert_eq!(told.sent, [echo(), read(9, 2), read(9, 1), read(9, 1)]);
    // That a unit is busy decides nothing, and nobody waits for that to come twice.
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    rig.next([Refuses(3), Refuses(6), Right, Right]);
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.counts.retries), (End::Words(vec![9]), 1), "it is asked once more, as anywhere");
}

#[test]
fn so_many_rivals_that_nothing_outvotes_them_are_waited_for_off_the_line() {
    let mut rig = Rig::settled();
    rig.most = 1;
    for _ in 0..10 {
        rig.is_silent_on(ask(7, 1).in_doubt(true));
    }
    let told = rig.run(ask(9, 1));
    assert_eq!((&told.end, told.stood_by.len()), (&End::Words(vec![9]), 1), "{told:?}");
    assert_eq!(told.sent.last(), Some(&read(9, 1)));
}

/// What changes from read to read is never outvoted, and is read all the same.
#[test]
fn where_the_words_change_it_is_waited_until_nothing_can_be_late() {
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    rig.next([Refuses(3)].into_iter().chain((20..40).map(|word| Says(words(&[word])))));
    let told = rig.run(ask(9, 1));
    let (before, last) = (told.sent_at[told.sent.len() - 2], told.sent_at[told.sent.len() - 1]);
    assert!(last > before + OVERTAKING, "each of those before may have been the one that was owed: {told:?}");
    let heard = u16::try_from(told.sent.len()).unwrap() - 2;
    assert_eq!(told.end, End::Words(vec![20 + heard - 1]), "the last of them is sure");
    assert_eq!(heard, 5, "twice as many as have to agree, and one");
}

#[test]
fn what_may_be_late_is_granted_the_time_to_be_outvoted() {
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    // Two questions are needed, and one of them may fail although the caller grants no retry.
    rig.next([Refuses(3), Right, Damaged, Right, Right]);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    let mut rig = owes_one();
    rig.always.insert(8, Right);
    rig.next([Refuses(3), Right, Late(ms(110)), Right, Right]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]), "{told:?}");
}
