//! Writes of words that can be read back.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, DoneUnsaid, Nothing, Refuses, Right, Says};
use crate::rig::*;

/// `value` to 9, which can be read there.
fn put(value: u16) -> Question<'static> {
    set(9, value).read_back(Some(9))
}

#[test]
fn a_confirmed_write_is_not_looked_at() {
    let told = Rig::settled().run(put(5).retries(2));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 5)]));
}

#[test]
fn a_write_that_was_done_and_not_confirmed_is_read_back_and_never_repeated() {
    let told = Rig::settled().does([DoneUnsaid]).run(put(5).retries(2));
    assert_eq!((told.end, told.sent), (End::Done, vec![write(9, 5), echo(), read(9, 1)]));
    assert_eq!(told.last_sent, Some(at(5_000)), "when the write went out");
}

#[test]
fn it_is_sent_again_only_where_the_unit_shows_other_words() {
    let told = Rig::settled().does([Nothing, Right, Right, Right]).run(put(5).retries(1));
    // What confirms the second may be meant for the first: it is looked up.
    let sent = vec![write(9, 5), echo(), read(9, 1), write(9, 5), read(9, 1)];
    assert_eq!((told.end, told.sent), (End::Done, sent));
}

#[test]
fn a_busy_unit_costs_half_a_retry_and_what_may_have_been_done_a_whole_one() {
    for (does, times) in [(Nothing, 2), (Damaged, 2), (Refuses(6), 3)] {
        let mut rig = Rig::settled().always(6, does);
        rig.registers.insert(9, 1);
        // What is damaged on its way back was done, so the unit is made to forget it.
        rig.always.insert(3, Says(words(&[1])));
        let told = rig.run(put(5).retries(1));
        let writes = told.sent.iter().filter(|frame| frame[1] == 6).count();
        assert_eq!(writes, times, "{told:?}");
        assert!(told.last_sent.is_some());
    }
}

#[test]
fn a_write_that_is_not_taken_is_told_with_what_the_unit_shows() {
    let mut rig = Rig::settled().always(6, Nothing);
    rig.registers.insert(9, 1);
    let told = rig.run(put(5).retries(1));
    assert_eq!(told.end, End::Failed(Unanswered::NotTaken { times: 2 }));
    assert_eq!((told.shows, told.raw.len()), (vec![1], 0));
}

#[test]
fn a_unit_that_stays_busy_is_told_as_busy() {
    let mut rig = Rig::settled().always(6, Refuses(6));
    rig.registers.insert(9, 1);
    let told = rig.run(put(5).retries(1));
    assert_eq!(told.end, End::Failed(Unanswered::Refused { function: 6, code: ExceptionCode(6) }));
    assert_eq!((told.raw, told.shows), (sealed(&[1, 0x86, 6]), vec![]));
}

#[test]
fn a_decision_is_told_at_once() {
    let told = Rig::settled().always(6, Refuses(3)).run(put(5).retries(1));
    assert_eq!(told.end, End::Failed(Unanswered::Refused { function: 6, code: ExceptionCode(3) }));
    assert_eq!(told.sent.len(), 1);
}

/// The second time it goes out although the answer to the first may still come: that may have been its refusal.
#[test]
fn a_refusal_that_may_be_meant_for_the_write_before_is_looked_up() {
    let refusal = sealed(&[1, 0x86, 4]);
    let not_taken = End::Failed(Unanswered::NotTaken { times: 2 });
    for (shows, end, raw) in [(5, End::Done, vec![]), (1, not_taken, refusal.clone())] {
        let script = [Nothing, Right, Right, Says(refusal.clone()), Says(words(&[shows]))];
        let told = Rig::settled().does(script).run(put(5).retries(3));
        let sent = vec![write(9, 5), echo(), read(9, 1), write(9, 5), read(9, 1)];
        assert_eq!((told.end, told.sent, told.raw), (end, sent, raw), "it shows {shows}");
    }
}

#[test]
fn that_it_cannot_be_read_back_is_no_refusal_of_the_write() {
    let script = [Nothing, Right, Right, Right, Refuses(2)];
    let told = Rig::settled().does(script).run(put(5).retries(3));
    assert_eq!(told.sent, vec![write(9, 5), echo(), read(9, 1), write(9, 5), read(9, 1)]);
    assert_eq!(told.end, End::Failed(Unanswered::NoAnswer { timeout: TIMEOUT, attempts: 1 }));
    assert!(told.last_sent.is_some() && told.raw.is_empty());
}

#[test]
fn an_acknowledged_write_is_looked_at_until_its_words_show() {
    let told = Rig::settled()
        .does([Refuses(5), Says(words(&[1])), Says(words(&[1])), Says(words(&[5]))])
        .run(put(5).retries(1));
    assert_eq!((told.end, told.sent.len()), (End::Done, 4));
    assert_eq!(told.stood_by.len(), 2);
    let pauses: Vec<_> = told.stood_by.windows(2).map(|two| two[1].saturating_duration_since(two[0])).collect();
    let eighth = 2 * TIMEOUT / 8;
    assert!((eighth..eighth + ms(50)).contains(&pauses[0]), "of the time that the call may take: {pauses:?}");
}

#[test]
fn an_acknowledged_write_is_never_sent_again() {
    let mut rig = Rig::settled().always(6, Refuses(5));
    rig.registers.insert(9, 1);
    let told = rig.run(put(5).retries(3));
    assert_eq!(told.end, End::Failed(Unanswered::Acknowledged { code: ExceptionCode(5) }));
    assert_eq!((told.sent.len(), told.shows), (1 + 8, vec![1]));
}

#[test]
fn a_value_that_the_unit_limits_is_read_back_once_and_told() {
    let mut rig = Rig::settled().always(6, Says(write(9, 4)));
    rig.registers.insert(9, 4);
    let told = rig.run(put(5).retries(3));
    assert_eq!(told.end, End::Failed(Unanswered::Limited { took: 4 }));
    assert_eq!((told.sent, told.shows), (vec![write(9, 5), echo(), read(9, 1)], vec![4]));
    // Where it shows what was written, all is well, whatever it said.
    let mut rig = Rig::settled().always(6, Says(write(9, 4)));
    rig.registers.insert(9, 5);
    assert_eq!(rig.run(put(5)).end, End::Done);
}

#[test]
fn a_confirmation_of_another_address_is_no_limit() {
    let mut rig = Rig::settled().always(6, Says(write(8, 5)));
    rig.registers.insert(9, 1);
    let told = rig.run(put(5));
    assert_eq!(told.end, End::Failed(Unanswered::NotTaken { times: 1 }));
}

#[test]
fn where_it_cannot_be_read_back_what_became_of_the_write_is_told() {
    let told = Rig::settled().always(6, Damaged).always(3, Refuses(2)).run(put(5));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{:?}", told.end);
    assert_eq!((told.raw.len(), told.last_sent), (8, Some(at(5_000))));
}

#[test]
fn many_words_and_coils_are_read_back_as_they_were_written() {
    let many = Request::write_many(9, &[5, 6]).unwrap();
    let question = Question::new(UNIT.into(), many, TIMEOUT).read_back(Some(9));
    let told = Rig::settled().does([DoneUnsaid]).run(question);
    assert_eq!((told.end, told.sent[2].clone()), (End::Done, read(9, 2)));
    let told = Rig::settled().always(16, DoneUnsaid).always(3, Says(words(&[5, 7]))).run(question);
    assert_eq!(told.end, End::Failed(Unanswered::NotTaken { times: 1 }));
    for (on, shown, end) in
        [(true, 1, End::Done), (false, 0, End::Done), (true, 0, End::Failed(Unanswered::NotTaken { times: 1 }))]
    {
        let question = Question::new(UNIT.into(), Request::write_coil(9, on), TIMEOUT).read_back(Some(9));
        let mut rig = Rig::settled().always(5, Nothing);
        rig.registers.insert(9, shown);
        let told = rig.run(question);
        assert_eq!((told.end, told.sent[2].clone()), (end, request(1, 9, 1)));
    }
}

#[test]
fn what_nobody_can_read_back_is_not_looked_at() {
    let echo = Request::echo(1);
    let told = Rig::settled().does([Nothing]).run(Question::new(UNIT.into(), echo, TIMEOUT).read_back(Some(9)));
    assert_eq!((told.end, told.sent.len()), (silence(1), 1));
}

#[test]
fn a_write_that_may_be_confirmed_by_another_is_looked_up() {
    let mut rig = Rig::settled().always(8, Right);
    rig.next([Nothing]);
    assert_eq!(rig.run(set(9, 5)).end, silence(1), "its confirmation is still to come");
    let told = rig.run(put(5));
    assert_eq!((told.end, told.sent), (End::Done, vec![echo(), write(9, 5), read(9, 1)]));
    // Without a place to look at, it is waited for.
    let mut rig = Rig::settled();
    rig.is_silent_on(set(9, 5));
    let told = rig.run(set(9, 5));
    assert_eq!((told.end, told.stood_by.len()), (End::Confirmed, 1));
}

#[test]
fn a_write_that_is_not_proven_and_cannot_be_looked_up_is_not_known_to_be_done() {
    let mut rig = Rig::settled();
    rig.is_silent_on(set(9, 5));
    rig.always.insert(3, Nothing);
    let told = rig.run(put(5));
    assert_eq!(told.end, silence(1));
    assert!(told.last_sent.is_some());
}

#[test]
fn all_of_it_happens_over_one_connection() {
    let mut rig = Rig::settled().always(6, Nothing);
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(put(5).retries(1), &fresh);
    // Step by step: the line is another one when the words are to be read back.
    rig.meets_silence(&mut call);
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    rig.known.is_connection(2);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (silence(1), 0), "behind it another unit may answer");
}

#[test]
fn where_the_words_only_come_damaged_that_is_told_and_when_the_write_went_out() {
    let mut rig = Rig::settled();
    rig.next([Nothing]);
    assert_eq!(rig.run(set(9, 5)).end, silence(1), "its confirmation is still to come");
    rig.always.insert(3, Damaged);
    let told = rig.run(put(5));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{told:?}");
    assert_eq!(told.sent[..3], [echo(), write(9, 5), read(9, 1)]);
    assert_eq!((told.last_sent, told.raw.len()), (Some(told.sent_at[1]), 7));
}

#[test]
fn a_write_that_is_given_up_before_it_goes_out_once_more_went_out_before() {
    let mut rig = Rig::settled().does([Nothing, Right, Right]);
    (rig.undisturbed, rig.passes) = (3, [Cut::GivenUp].into());
    let told = rig.run(put(5).retries(1));
    assert_eq!(told.sent, [write(9, 5), echo(), read(9, 1)]);
    assert_eq!((told.end, told.last_sent), (End::Failed(Unanswered::CutShort(Cut::GivenUp)), Some(at(5_000))));
}
