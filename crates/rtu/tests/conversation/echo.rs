//! Adapters that send our own bytes back, as a call finds out.

use drivebus_rtu::*;

use crate::rig::Does::{Nothing, Refuses, Right, Says};
use crate::rig::*;

/// A line in use of whose adapter nothing is known.
fn unknown(echoes: bool) -> Rig {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    rig.echoes = echoes;
    rig.now = at(5_000);
    rig
}

#[test]
fn before_a_write_one_word_is_read_to_see_whether_the_adapter_echoes() {
    for (echoes, found) in [(false, OwnEcho::Absent), (true, OwnEcho::Present)] {
        let mut rig = unknown(echoes);
        let told = rig.run(set(9, 1));
        assert_eq!((told.end, told.sent), (End::Confirmed, vec![read(0, 1), write(9, 1)]));
        assert_eq!(rig.known.echo(), found);
        let told = rig.run(set(9, 2));
        assert_eq!(told.sent, [write(9, 2)], "once is enough");
    }
}

#[test]
fn a_read_shows_it_by_itself() {
    for (echoes, found) in [(false, OwnEcho::Absent), (true, OwnEcho::Present)] {
        let mut rig = unknown(echoes);
        let told = rig.run(ask(9, 1));
        assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1)]));
        assert_eq!(rig.known.echo(), found);
    }
}

#[test]
fn an_echo_of_the_adapter_is_never_the_confirmation_of_a_unit() {
    let mut rig = unknown(true);
    rig.then = Nothing;
    let told = rig.run(set(9, 1));
    assert_eq!(told.end, silence(1));
    assert_eq!(rig.known.echo(), OwnEcho::Present);
}

#[test]
fn a_look_that_met_silence_is_a_look() {
    let mut rig = unknown(false).does([Nothing, Right]);
    let told = rig.run(set(9, 1));
    assert_eq!(rig.known.echo(), OwnEcho::Absent);
    assert_eq!(told.sent.iter().filter(|sent| **sent == read(0, 1)).count(), 1, "one is enough");
}

#[test]
fn where_noise_hides_it_three_looks_are_taken() {
    let mut rig = unknown(false).always(3, Says(vec![0x55; 12]));
    let told = rig.run(set(9, 1));
    assert_eq!(told.sent, vec![read(0, 1); 3], "and the write is not sent: {:?}", told.end);
    assert_ne!(told.end, End::Failed(Unanswered::Doubtful), "what the last look met is told");
    assert_eq!((told.last_sent, rig.known.echo()), (None, OwnEcho::Unknown));
}

#[test]
fn what_cannot_wait_is_looked_at_behind() {
    let mut rig = unknown(false);
    let told = rig.run(set(9, 1).in_doubt(true));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 1), read(0, 1)]));
    let mut rig = unknown(true);
    let told = rig.run(set(9, 1).in_doubt(true));
    assert_eq!(told.end, silence(1), "what came was the adapter's, as far as anybody knows");
    assert_eq!(told.sent, [write(9, 1), read(0, 1)]);
    assert!(told.last_sent.is_some(), "it may have been done");
    let told = rig.run(set(9, 2));
    assert_eq!(told.sent[0], echo(), "and its own confirmation is still to come");
}

#[test]
fn what_the_user_knows_of_the_adapter_is_not_looked_for() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Present);
    (rig.echoes, rig.now) = (true, at(5_000));
    let told = rig.run(set(9, 1));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 1)]));
    let mut rig = Rig::opened(Opened::new().may_echo(false), OwnEcho::Unknown);
    rig.now = at(5_000);
    let told = rig.run(set(9, 1));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 1)]));
    assert_eq!(rig.known.echo(), OwnEcho::Absent);
}

#[test]
fn an_adapter_that_echoes_no_more_is_looked_at_again() {
    let mut rig = unknown(true);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    rig.echoes = false;
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    assert_eq!(rig.known.echo(), OwnEcho::Unknown);
    let told = rig.run(set(9, 1));
    assert_eq!(told.sent, [read(0, 1), write(9, 1)]);
}

#[test]
fn a_refusal_shows_it_as_words_do() {
    let mut rig = unknown(false).does([Refuses(2), Right]);
    let told = rig.run(set(9, 1));
    assert_eq!((told.end, rig.known.echo()), (End::Confirmed, OwnEcho::Absent));
}

#[test]
fn the_line_is_looked_at_anew_when_it_is_opened_again() {
    let mut rig = unknown(true);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    rig.known.closed();
    rig.known.opened(rig.now, &Opened::new());
    assert_eq!(rig.known.echo(), OwnEcho::Unknown, "another adapter may be plugged in");
}

#[test]
fn before_an_echo_to_a_unit_in_doubt_the_adapter_is_looked_at_too() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [read(9, 1), echo(), read(9, 1)]);
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    let told = rig.run(ask(9, 1).urgency(Urgency::Stop));
    assert_eq!(told.sent[0], read(9, 2), "before a stop in a length that the question has not");
}

#[test]
fn a_look_behind_what_went_out_in_doubt_is_in_doubt_too() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    let told = rig.run(set(9, 1).in_doubt(true));
    assert_eq!((told.end, told.sent), (End::Confirmed, vec![write(9, 1), read(0, 1)]));
}

#[test]
fn what_is_known_to_echo_is_never_a_confirmation() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Present);
    (rig.echoes, rig.now, rig.then) = (true, at(5_000), Nothing);
    assert_eq!(rig.run(set(9, 1)).end, silence(1));
}

#[test]
fn no_look_asks_for_more_words_than_every_unit_gives() {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    let told = rig.run(ask(9, 16).urgency(Urgency::Stop));
    assert_eq!(told.sent[0], read(9, 1));
}

/// `value` to address 9 of every unit.
fn to_all(value: u16) -> Question<'static> {
    Question::new(Destination::Broadcast, Request::write(9, value), TIMEOUT)
}

#[test]
fn a_broadcast_shows_an_adapter_that_echoes_and_none_that_does_not() {
    for (echoes, found) in [(true, OwnEcho::Present), (false, OwnEcho::Unknown)] {
        let mut rig = unknown(echoes);
        assert_eq!(rig.run(to_all(1)).end, End::Done);
        assert_eq!(rig.known.echo(), found, "nobody answers a broadcast: that nothing came says nothing");
        let many = Request::write_many(9, &[1, 2]).unwrap();
        assert_eq!(rig.run(Question::new(Destination::Broadcast, many, TIMEOUT)).end, End::Done);
        assert_eq!(rig.known.echo(), found, "whatever is sent");
    }
}

#[test]
fn an_adapter_that_begins_to_echo_is_found_by_a_read_and_by_no_broadcast() {
    let mut rig = unknown(false);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    assert_eq!(rig.known.echo(), OwnEcho::Absent);
    rig.echoes = true;
    rig.run(to_all(1));
    assert_eq!(rig.known.echo(), OwnEcho::Absent, "a unit may have returned it that should be silent");
    rig.run(ask(9, 1));
    assert_eq!(rig.known.echo(), OwnEcho::Present);
}

#[test]
fn silence_does_not_show_that_an_adapter_echoes_no_more() {
    let mut rig = unknown(true);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    (rig.echoes, rig.then) = (false, Nothing);
    assert_eq!(rig.run(ask(9, 1)).end, silence(1));
    assert_eq!(rig.known.echo(), OwnEcho::Present, "its cable may be out");
}

#[test]
fn a_write_that_comes_back_as_it_went_out_is_the_adapters_unless_that_is_known_not_to_echo() {
    let many = Request::write_many(9, &[1, 2]).unwrap();
    let question = Question::new(UNIT.into(), many, TIMEOUT).in_doubt(true);
    let back = sealed(&[UNIT.get(), 16, 0, 9, 0, 2, 4, 0, 1, 0, 2]);
    for (known, is_units) in [(OwnEcho::Absent, true), (OwnEcho::Unknown, false), (OwnEcho::Present, false)] {
        let mut rig = Rig::opened(Opened::new(), known);
        rig.now = at(5_000);
        rig.next([Says(back.clone())]);
        let end = rig.run(question).end;
        assert_eq!(matches!(end, End::Failed(Unanswered::Wrong(_))), is_units, "{known:?}: {end:?}");
    }
}
