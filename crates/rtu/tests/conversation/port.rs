//! What becomes of a call whose port fails, or which nobody waits for.

use drivebus_rtu::*;

use crate::misuse::handed_out;
use crate::rig::Does::{Nothing, Right};
use crate::rig::*;

#[test]
fn a_lost_port_costs_no_retry_of_a_read_and_is_tried_again() {
    let mut rig = Rig::settled();
    rig.passes = [Cut::Lost].into();
    let told = rig.run(ask(7, 1));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![7]), 1));
}

#[test]
fn a_port_that_stays_lost_is_told_and_how_it_was_lost_first() {
    let mut rig = Rig::settled();
    rig.passes = [Cut::Lost; 20].into();
    let told = rig.run(ask(7, 1));
    assert_eq!(told.end, End::Failed(Unanswered::CutShort(Cut::Lost)));
    assert!(told.before, "that tells more than that it is still not there");
    assert_eq!(rig.passes.len(), 15, "five attempts");
    let mut rig = Rig::settled();
    rig.passes = [Cut::Lost, Cut::Unusable].into();
    let told = rig.run(ask(7, 1));
    assert_eq!((told.end, told.before), (End::Failed(Unanswered::CutShort(Cut::Lost)), true));
}

#[test]
fn a_port_that_cannot_be_used_ends_the_call() {
    let mut rig = Rig::settled();
    rig.passes = [Cut::Unusable].into();
    let told = rig.run(ask(7, 1).retries(3));
    assert_eq!((told.end, told.before), (End::Failed(Unanswered::CutShort(Cut::Unusable)), false));
    assert!(told.sent.is_empty());
}

#[test]
fn a_call_that_is_cut_short_before_it_began_is_over() {
    for cut in [Cut::Lost, Cut::Unusable, Cut::GivenUp] {
        let mut rig = Rig::settled();
        let fresh = FreshWords::beginning_at(1);
        let mut call = Conversation::new(set(7, 1).retries(3), &fresh);
        call.cut_short(rig.now, &mut rig.known, cut);
        let told = rig.carry_out(&mut call);
        assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(cut)), 0));
    }
}

/// Asks until the request is on the wire, and loses the port there.
fn lost_in_flight(rig: &mut Rig, call: &mut Conversation<'_>) {
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(_) => {
                call.sent(&mut rig.known, rig.now).unwrap();
                assert!(call.is_in_flight());
                break call.cut_short(rig.now, &mut rig.known, Cut::Lost);
            }
            Step::Listen(until) => {
                rig.now = rig.now.max(until);
                call.heard(rig.now, &mut rig.known, &[]).unwrap();
            }
            _ => {}
        }
    }
    assert!(!call.is_in_flight());
}

#[test]
fn a_write_that_was_under_way_when_the_port_was_lost_is_not_sent_again() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(set(7, 1).retries(2), &fresh);
    lost_in_flight(&mut rig, &mut call);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::Lost)), 0));
    assert!(told.last_sent.is_some(), "it may have been done");
}

#[test]
fn a_read_that_was_under_way_costs_a_retry() {
    for (retries, end) in [(0, End::Failed(Unanswered::CutShort(Cut::Lost))), (1, End::Words(vec![7]))] {
        let mut rig = Rig::settled();
        let fresh = FreshWords::beginning_at(1);
        let mut call = Conversation::new(ask(7, 1).retries(retries), &fresh);
        lost_in_flight(&mut rig, &mut call);
        assert_eq!(rig.carry_out(&mut call).end, end);
    }
}

#[test]
fn where_the_port_was_lost_once_more_before_anything_went_out_the_first_time_is_told() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1).retries(1), &fresh);
    lost_in_flight(&mut rig, &mut call);
    rig.passes = [Cut::Unusable].into();
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.before), (End::Failed(Unanswered::CutShort(Cut::Lost)), true));
    assert!(told.last_sent.is_some(), "then it had gone out");
}

#[test]
fn where_it_went_out_only_the_second_time_that_is_told() {
    let mut rig = Rig::settled();
    rig.passes = [Cut::Lost].into();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(set(7, 1), &fresh);
    // The first attempt is cut short before anything goes out.
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    call.cut_short(rig.now, &mut rig.known, Cut::Lost);
    lost_in_flight(&mut rig, &mut call);
    rig.passes.clear();
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.before), (End::Failed(Unanswered::CutShort(Cut::Lost)), false));
    assert!(told.last_sent.is_some());
}

#[test]
fn who_gives_up_is_told_so_and_nothing_more_is_sent() {
    let mut rig = Rig::settled();
    rig.passes = [Cut::GivenUp].into();
    let told = rig.run(ask(7, 1).retries(3));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::GivenUp)), 0));
}

#[test]
fn who_gives_up_when_the_answer_is_there_still_gets_it() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    let mut answer = words(&[7]);
    let mut is_out = false;
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(_) => is_out = call.sent(&mut rig.known, rig.now).is_ok(),
            Step::Listen(until) => {
                let bytes = if is_out { std::mem::take(&mut answer) } else { Vec::new() };
                rig.now = if bytes.is_empty() { rig.now.max(until) } else { rig.now };
                call.heard(rig.now, &mut rig.known, &bytes).unwrap();
            }
            Step::Heard(exchange) => {
                assert_eq!(exchange.failure, None);
                break;
            }
            _ => {}
        }
    }
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![7]));
}

#[test]
fn a_failure_that_is_given_up_when_it_is_told_ends_the_call() {
    let mut rig = Rig::settled().does([Nothing, Right]);
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1).retries(3), &fresh);
    rig.meets_silence(&mut call);
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::GivenUp)), 0));
    assert!(told.last_sent.is_some());
}

#[test]
fn a_unit_that_is_quiet_while_a_stop_waits_is_waited_for_no_longer() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    call.give_way(rig.now, &mut rig.known, ms(20)); // nothing is in flight, and nothing changes
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(_) => {
                call.sent(&mut rig.known, rig.now).unwrap();
                break call.give_way(rig.now + ms(20), &mut rig.known, ms(20));
            }
            Step::Listen(until) => {
                rig.now = rig.now.max(until);
                call.heard(rig.now, &mut rig.known, &[]).unwrap();
            }
            _ => {}
        }
    }
    rig.now = rig.now + ms(20);
    let told = rig.carry_out(&mut call);
    assert_eq!(told.end, End::Failed(Unanswered::NoAnswer { timeout: ms(20), attempts: 1 }));
    assert!(rig.known.master().in_quarantine(rig.now, UNIT), "it may still answer");
}

#[test]
fn a_call_goes_only_over_the_connection_that_it_was_meant_for() {
    let mut rig = Rig::settled();
    rig.known.is_connection(3);
    assert_eq!(rig.run(ask(7, 1).connection(Some(3))).end, End::Words(vec![7]));
    let told = rig.run(ask(7, 1).connection(Some(2)).retries(3));
    assert_eq!((told.end, told.sent.len(), told.last_sent), (End::Failed(Unanswered::Reopened), 0, None));
}

#[test]
fn a_call_that_is_given_up_while_its_unit_or_the_adapter_is_looked_at_sends_nothing_more() {
    for echo in [OwnEcho::Unknown, OwnEcho::Absent] {
        let mut rig = Rig::opened(Opened::new(), echo);
        let fresh = FreshWords::beginning_at(1);
        let mut call = handed_out(&mut rig, set(9, 1).retries(3), &fresh);
        call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
        let told = rig.carry_out(&mut call);
        assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::GivenUp)), 0), "{echo:?}");
        assert_eq!(told.last_sent, None, "the write was not sent");
    }
}
