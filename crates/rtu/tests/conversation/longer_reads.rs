//! Reads in a longer form, and what is learned of units that do not give it.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Nothing, Refuses, Right};
use crate::rig::*;

/// A unit that returns echoes and owes the answers to reads of these lengths.
fn owes(lengths: &[u16]) -> Rig {
    let mut rig = Rig::settled().always(8, Right);
    for &count in lengths {
        rig.is_silent_on(ask(0x100, count).in_doubt(true));
    }
    rig
}

#[test]
fn a_read_takes_the_shortest_length_that_nothing_owed_has() {
    let told = owes(&[1, 2, 4]).run(ask(9, 1));
    assert_eq!(told.sent, [echo(), read(9, 5)], "four words cut short could be three");
    assert_eq!(told.end, End::Words(vec![9]));
    let told = owes(&[3]).run(ask(9, 1));
    assert_eq!(told.sent, [echo(), read(9, 1)], "as it is where nothing could pass for it");
}

#[test]
fn what_is_verified_is_asked_as_it_is() {
    let told = owes(&[1]).run(ask(9, 1).verify(true));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent, [echo(), read(9, 1), read(9, 1)]);
}

#[test]
fn silence_on_a_longer_read_counts_the_second_time() {
    let mut rig = owes(&[1]);
    rig.is_silent_on(ask(9, 1));
    rig.next([Nothing]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.sent[1], read(9, 3), "it may have been a single bad moment: {:02X?}", told.sent);
    let told = rig.run(ask(9, 1));
    assert!(told.sent.contains(&read(9, 1)) || told.sent.contains(&read(9, 2)), "{:02X?}", told.sent);
}

#[test]
fn a_busy_unit_was_not_heard_to_refuse_a_longer_read() {
    let mut rig = owes(&[1]);
    rig.next([Refuses(6), Right]);
    let told = rig.run(ask(9, 1).retries(1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent.last().map(|frame| frame[5]), Some(3), "two words are owed now, too: {:02X?}", told.sent);
}

#[test]
fn what_was_refused_is_not_asked_for_again_from_there() {
    let mut rig = owes(&[1]);
    rig.next([Refuses(3)]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.sent, [echo(), read(9, 2), read(9, 1), read(9, 1)]);
    assert_eq!(rig.run(ask(9, 1)).sent, [read(9, 1), read(9, 1)]);
    let told = rig.run(ask(10, 1));
    assert_eq!(told.sent[0], read(10, 3), "elsewhere it may: {:02X?}", told.sent);
}

#[test]
fn a_longer_read_that_came_to_nothing_is_asked_again_as_it_was() {
    for does in [Nothing, Damaged] {
        let mut rig = owes(&[1]);
        rig.next([does, Right]);
        let told = rig.run(ask(9, 1).retries(1));
        assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![echo(), read(9, 2), read(9, 2)]));
        assert_eq!(told.counts.resyncs, 1);
    }
}

#[test]
fn a_read_of_bits_is_put_in_another_length_where_that_has_another_size() {
    let bits = Request::read_of(Table::Coil, 9, 1).unwrap();
    let question = Question::new(UNIT.into(), bits, TIMEOUT);
    let mut rig = Rig::settled().always(8, Right);
    rig.is_silent_on(question);
    let told = rig.run(question);
    assert_eq!(told.sent[1], request(1, 9, 9), "nine bits take two bytes: {:02X?}", told.sent);
}

#[test]
fn once_nothing_can_come_any_more_it_is_asked_as_it_is() {
    let mut rig = owes(&[1]);
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    rig.now = rig.now + OVERTAKING;
    assert_eq!(rig.run(ask(9, 1)).sent, [read(9, 1)]);
}
