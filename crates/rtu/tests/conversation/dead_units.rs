//! Units that do not answer, and the others that share their line.

use drivebus_rtu::*;

use crate::misuse::handed_out;
use crate::rig::Does::{Damaged, Nothing, Right};
use crate::rig::*;

const OTHER: u8 = 2;

/// A question to the unit that lives.
fn ask_other() -> Question<'static> {
    Question::new(UnitAddress::new(OTHER).unwrap().into(), Request::read(7, 1).unwrap(), TIMEOUT)
}

/// A line with one unit that was silent for two calls and one that answers.
fn rig() -> Rig {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask_other()).end, End::Words(vec![7]));
    rig.then = Nothing;
    for _ in 0..2 {
        assert!(matches!(rig.run(ask(7, 1)).end, End::Failed(Unanswered::NoAnswer { .. })));
    }
    rig
}

#[test]
fn a_dead_unit_is_not_asked_while_others_use_the_line() {
    let mut rig = rig();
    let began = rig.now;
    let told = rig.run(ask(7, 1).retries(2));
    let left = ms(700);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::NotAsked { left }), 0));
    assert_eq!(told.stood_by, [began + 3 * TIMEOUT], "off the line, for as long as it would have been silent");
}

#[test]
fn who_polls_is_told_at_once() {
    let mut rig = rig();
    let began = rig.now;
    let told = rig.run(ask(7, 1).retries(2).urgency(Urgency::Poll));
    assert_eq!(told.end, End::Failed(Unanswered::NotAsked { left: Duration::from_secs(1) }));
    assert_eq!((told.stood_by.len(), rig.now), (0, began));
}

#[test]
fn a_stop_waits_for_nobody() {
    let mut rig = rig();
    let told = rig.run(set(7, 0).in_doubt(true).urgency(Urgency::Stop));
    assert_eq!((told.end, told.sent.len(), told.stood_by.len()), (silence(1), 1, 0));
}

#[test]
fn when_its_time_has_come_it_is_asked_once_and_without_retries() {
    let mut rig = rig();
    rig.now = rig.now + Duration::from_secs(1);
    let told = rig.run(ask(7, 1).retries(3));
    assert_eq!(told.counts.retries, 0, "{told:?}");
    assert!(matches!(told.end, End::Failed(Unanswered::NoAnswer { .. })));
    let told = rig.run(ask(7, 1).urgency(Urgency::Poll));
    assert_eq!(told.end, End::Failed(Unanswered::NotAsked { left: Duration::from_secs(2) }), "twice as long");
}

#[test]
fn who_waits_until_then_still_gets_it_asked() {
    let mut rig = rig();
    rig.now = rig.now + ms(950);
    rig.then = Right;
    let told = rig.run(ask(7, 1));
    assert_eq!((told.end, told.stood_by.len()), (End::Words(vec![7]), 1));
}

#[test]
fn damage_shows_that_a_unit_is_there() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask_other()).end, End::Words(vec![7]));
    rig.then = Nothing;
    assert_eq!(rig.run(ask(7, 1)).end, silence(1));
    rig.then = Damaged;
    assert!(matches!(rig.run(ask(7, 1).in_doubt(true)).end, End::Failed(Unanswered::Corrupt(_))));
    rig.then = Nothing;
    assert_eq!(rig.run(ask(7, 1).in_doubt(true)).end, silence(1));
    rig.then = Right;
    assert_eq!(rig.run(ask(7, 1)).end, End::Words(vec![7]), "one silence in a row is none");
}

#[test]
fn a_call_that_was_cut_short_shows_no_unit() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask_other()).end, End::Words(vec![7]));
    rig.then = Nothing;
    assert_eq!(rig.run(ask(7, 1)).end, silence(1));
    let fresh = FreshWords::beginning_at(1);
    let mut call = handed_out(&mut rig, ask(7, 1).in_doubt(true), &fresh);
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    assert!(rig.carry_out(&mut call).last_sent.is_some());
    assert_eq!(rig.run(ask(7, 1).in_doubt(true)).end, silence(1));
    let told = rig.run(ask(7, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::NotAsked { .. })), "two silences in a row: {told:?}");
}

#[test]
fn a_line_that_is_closed_holds_nobody_back() {
    let mut rig = rig();
    rig.known.closed();
    rig.then = Right;
    let told = rig.run(ask(7, 1));
    assert_eq!((told.end, told.stood_by.len()), (End::Words(vec![7]), 0), "it has to be opened, which shows more");
}

#[test]
fn nobody_is_kept_off_a_line_that_nobody_else_uses() {
    let mut rig = Rig::settled();
    rig.then = Nothing;
    for _ in 0..5 {
        let told = rig.run(ask(7, 1));
        assert!(matches!(told.end, End::Failed(Unanswered::NoAnswer { .. })), "{told:?}");
    }
}

#[test]
fn patience_is_the_time_out_for_each_time_that_it_may_ask() {
    let fresh = FreshWords::beginning_at(1);
    assert_eq!(Conversation::new(ask(7, 1).retries(2), &fresh).patience(), 3 * TIMEOUT);
    assert_eq!(Conversation::new(ask(7, 1).urgency(Urgency::Poll), &fresh).patience(), Duration::ZERO);
}
