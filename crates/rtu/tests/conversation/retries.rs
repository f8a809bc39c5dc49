//! How often a call asks, after what, and what it is told when it asks no more.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Late, Nothing, Refuses, Right, Says};
use crate::rig::*;

#[test]
fn a_unit_that_owes_nothing_is_asked_once_and_as_the_caller_asks() {
    let told = Rig::settled().run(ask(0x2100, 2));
    assert_eq!(told.end, End::Words(vec![0x2100, 0x2101]));
    assert_eq!(told.sent, [read(0x2100, 2)]);
    assert_eq!(told.counts, Counts::default());
    assert!(told.stood_by.is_empty());
}

#[test]
fn silence_costs_a_retry_and_the_same_is_asked_as_it_was() {
    let told = Rig::settled().does([Nothing, Nothing, Right]).run(ask(7, 1).retries(2));
    assert_eq!(told.end, End::Words(vec![7]));
    assert_eq!(told.sent, [read(7, 1), read(7, 1), read(7, 1)], "all that is owed is this very answer");
    assert_eq!(told.counts.retries, 2);
    let told = Rig::settled().does([Nothing, Nothing, Nothing]).run(ask(7, 1).retries(2));
    assert_eq!((told.end, told.sent.len()), (silence(3), 3));
}

#[test]
fn a_damaged_answer_costs_half_a_retry() {
    let told = Rig::settled().does(vec![Damaged; 9]).run(ask(7, 1).retries(1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(FrameError::Crc { .. }))), "{:?}", told.end);
    assert_eq!(told.sent.len(), 3, "the one, and two halves of the retry");
    assert_eq!(told.raw.len(), 7, "what came instead");
}

#[test]
fn a_unit_that_is_busy_is_asked_again_and_that_costs_half() {
    let told = Rig::settled().does([Refuses(6), Refuses(6), Right]).run(ask(7, 1).retries(1));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 3));
    let told = Rig::settled().does(vec![Refuses(6); 9]).run(ask(7, 1).retries(1));
    let busy = Unanswered::Refused { function: 3, code: ExceptionCode(6) };
    assert_eq!((told.end, told.sent.len()), (End::Failed(busy), 3));
}

#[test]
fn a_decision_of_the_unit_is_told_at_once() {
    let told = Rig::settled().does([Refuses(2)]).run(ask(7, 1).retries(3));
    assert_eq!(told.end, End::Failed(Unanswered::Refused { function: 3, code: ExceptionCode(2) }));
    assert_eq!((told.sent.len(), told.raw), (1, sealed(&[1, 0x83, 2])));
}

#[test]
fn what_an_exception_means_its_caller_says() {
    let meanings = Meanings::STANDARD.with(ExceptionCode(2), Meaning::AskAgain);
    let told = Rig::settled().does([Refuses(2)]).run(ask(7, 1).retries(1).meanings(meanings));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 2));
}

#[test]
fn a_gateway_that_did_not_reach_its_unit_is_silence_that_cost_no_time() {
    let told = Rig::settled().does([Refuses(0x0B)]).run(ask(7, 1));
    assert_eq!(told.end, End::Failed(Unanswered::Unreached));
    let told = Rig::settled().does([Refuses(0x0B), Right]).run(ask(7, 1).retries(1));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 2));
}

#[test]
fn a_write_that_nobody_can_read_back_is_never_sent_twice() {
    let told = Rig::settled().does([Nothing]).run(set(7, 1).retries(3));
    assert_eq!((told.end, told.sent), (silence(1), vec![write(7, 1)]));
}

#[test]
fn a_broadcast_is_over_with_its_time_and_nobody_is_asked_before_it() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    let told = rig.run(Question::new(Destination::Broadcast, Request::write(7, 1), TIMEOUT));
    assert_eq!((told.end, told.sent.len()), (End::Done, 1), "whether the adapter echoes does not matter");
    assert_eq!(rig.now.saturating_duration_since(told.last_sent.unwrap()), TIMEOUT + ms(5));
}

#[test]
fn a_broadcast_that_reads_is_not_begun() {
    let read = Request::read(7, 1).unwrap();
    let told = Rig::settled().run(Question::new(Destination::Broadcast, read, TIMEOUT));
    let end = End::Failed(Unanswered::NotBegun(BeginError::BroadcastRead));
    assert_eq!((told.end, told.sent.len(), told.last_sent), (end, 0, None));
}

#[test]
fn no_attempt_begins_when_the_time_of_all_of_them_is_over() {
    // The line is never silent for as long as the caller wants, so each attempt waits for its time-out.
    let mut rig = Rig::settled();
    for millis in 0..2_000 {
        rig.comes(ms(millis), vec![0xFF]);
    }
    let told = rig.run(ask(7, 1).gap(ms(50)).retries(1));
    assert_eq!(told.end, End::Failed(Unanswered::Busy { timeout: TIMEOUT }));
    assert_eq!((told.sent.len(), told.last_sent, told.before), (0, None, false));
    assert_eq!(rig.now, at(5_300), "two attempts, each for the time-out and the silence that is asked for");
}

#[test]
fn nobody_is_asked_once_more_for_whom_nobody_waits() {
    let mut rig = Rig::settled().does([Nothing, Right]);
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1).retries(3), &fresh);
    call.is_wanted(false);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (silence(1), 1));
}

#[test]
fn what_the_units_answers_have_taught_shortens_the_wait_and_never_lengthens_it() {
    for (longest, waited) in [(ms(20), ms(20) + SerialFormat::DEFAULT.chars(7)), (ms(900), TIMEOUT)] {
        let mut rig = Rig::settled().does([Nothing]);
        let fresh = FreshWords::beginning_at(1);
        let mut call = Conversation::new(ask(7, 1), &fresh);
        call.expect_within(Some(longest));
        let told = rig.carry_out(&mut call);
        assert_eq!(told.end, End::Failed(Unanswered::NoAnswer { timeout: waited, attempts: 1 }));
        assert_eq!(rig.now, told.last_sent.unwrap() + ms(5) + waited);
    }
    // A write takes as long as it takes.
    let mut rig = Rig::settled().does([Nothing]);
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(set(7, 1), &fresh);
    call.expect_within(Some(ms(20)));
    assert_eq!(rig.carry_out(&mut call).end, silence(1));
}

#[test]
fn an_answer_that_comes_too_late_is_never_taken_for_the_next() {
    let mut rig = Rig::settled().does([Late(ms(150))]);
    assert_eq!(rig.run(ask(0x100, 1)).end, silence(1));
    let told = rig.run(ask(0x200, 1));
    assert_eq!(told.end, End::Words(vec![0x200]));
    assert_eq!(told.sent[0], echo(), "first it is seen that the unit has caught up: {:02X?}", told.sent);
}

#[test]
fn words_that_nobody_asked_for_are_told_as_wrong_and_asked_again() {
    let told = Rig::settled().does([Says(words(&[1, 2, 3])), Right]).run(ask(7, 1).retries(1));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 2));
    let told = Rig::settled().does([Says(words(&[1, 2, 3]))]).run(ask(7, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::Wrong(_))), "{:?}", told.end);
    assert_eq!(told.raw, words(&[1, 2, 3]));
}

#[test]
fn each_request_is_told_when_it_is_over_and_before_the_call_goes_on() {
    let told = Rig::settled().does([Nothing, Damaged, Right]).run(ask(7, 1).retries(2));
    let kinds: Vec<_> = told.exchanges.iter().map(|why| why.map(|why| std::mem::discriminant(&why))).collect();
    let silence = Unanswered::NoAnswer { timeout: TIMEOUT, attempts: 1 };
    let damage = Unanswered::Corrupt(FrameError::TooShort { len: 1 });
    assert_eq!(kinds, [Some(std::mem::discriminant(&silence)), Some(std::mem::discriminant(&damage)), None]);
}

#[test]
fn who_prints_a_call_sees_the_bytes_of_its_answer() {
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    assert_eq!(Rig::settled().carry_out(&mut call).end, End::Words(vec![7]));
    assert!(format!("{call:?}").contains("Kept([03, 02, 00, 07])"), "{call:?}");
}
