//! Reads in two parts, where no longer one is told apart.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Nothing, Refuses, Right, Says};
use crate::rig::*;

/// A unit that returns echoes, owes the answers to reads of these lengths, and gives its own addresses as words.
fn owes(lengths: &[u16]) -> Rig {
    let mut rig = Rig::settled().always(8, Right);
    for &count in lengths {
        rig.is_silent_on(ask(0x100, count).in_doubt(true));
    }
    rig
}

fn addresses(from: u16, count: u16) -> End {
    End::Words((from..from + count).collect())
}

#[test]
fn the_longest_read_is_asked_in_two_parts_that_have_a_word_in_common() {
    let mut rig = owes(&[16]);
    let told = rig.run(ask(9, 16));
    assert_eq!(told.end, addresses(9, 16));
    assert_eq!(told.sent, [echo(), read(9, 15), read(23, 2)]);
    assert_eq!(told.last_sent, Some(told.sent_at[1]), "no word is older than that");
    assert_eq!(rig.run(ask(9, 15)).sent, [read(9, 15)], "nothing of it is open");
}

#[test]
fn neither_part_has_a_length_that_is_owed() {
    assert_eq!(owes(&[16, 15]).run(ask(9, 16)).sent[1..], [read(9, 14), read(22, 3)]);
    assert_eq!(owes(&[16, 15, 14, 2]).run(ask(9, 16)).sent[1..], [read(9, 13), read(21, 4)]);
}

#[test]
fn more_words_than_a_longer_read_may_have_are_asked_in_two_parts_too() {
    let told = owes(&[40]).run(ask(9, 40));
    assert_eq!((told.end, &told.sent[1..]), (addresses(9, 40), &[read(9, 39), read(47, 2)][..]));
}

#[test]
fn where_the_word_in_common_has_changed_both_are_asked_again() {
    let old: Vec<u16> = (9..23).chain([1000]).collect();
    let told = owes(&[16]).does([Says(words(&old)), Right, Right, Right]).run(ask(9, 16));
    assert_eq!(told.end, addresses(9, 16));
    assert_eq!(told.sent[1..], [read(9, 15), read(23, 2), read(9, 15), read(23, 2)]);
}

#[test]
fn a_word_that_changes_from_part_to_part_is_asked_for_as_it_is() {
    let mut rig = owes(&[16]);
    let changes = (1000..1003).flat_map(|word| [Says(words(&(9..23).chain([word]).collect::<Vec<_>>())), Right]);
    rig.next(changes);
    let told = rig.run(ask(9, 16));
    assert_eq!(told.end, addresses(9, 16));
    assert_eq!(told.sent[7..], [read(9, 16), read(9, 16)], "{:02X?}", told.sent);
}

#[test]
fn a_part_that_is_refused_refuses_nothing_that_was_asked() {
    for script in [vec![Refuses(2)], vec![Right, Refuses(2)]] {
        let parts = script.len();
        let mut rig = owes(&[16]);
        rig.next(script);
        let told = rig.run(ask(9, 16));
        assert_eq!(told.end, addresses(9, 16));
        assert_eq!(told.sent[1 + parts..], [read(9, 16), read(9, 16)]);
    }
}

#[test]
fn a_part_that_did_not_come_whole_is_asked_for_in_another_length() {
    for does in [Nothing, Damaged] {
        let mut rig = owes(&[16]);
        rig.next([Right, does]);
        let told = rig.run(ask(9, 16).retries(1));
        assert_eq!(told.end, addresses(9, 16));
        let echo_or_part = &told.sent[3..];
        assert!(echo_or_part.ends_with(&[read(9, 14), read(22, 3)]), "{:02X?}", told.sent);
    }
}

#[test]
fn what_is_verified_and_what_is_bits_is_asked_as_it_is() {
    assert_eq!(owes(&[16]).run(ask(9, 16).verify(true)).sent[1..], vec![read(9, 16); 2]);
    let bits = Question::new(UNIT.into(), Request::read_of(Table::Coil, 9, 16).unwrap(), TIMEOUT);
    let mut rig = Rig::settled().always(8, Right);
    rig.is_silent_on(bits);
    rig.run(bits).sent.iter().for_each(|frame| assert!(frame[1] == 8 || frame[2..4] == [0, 9], "{frame:02X?}"));
}

#[test]
fn what_another_call_left_open_between_the_parts_changes_the_lengths() {
    let mut rig = owes(&[16]);
    rig.next([Right, Nothing]);
    rig.meanwhile = [None, None, None, Some(ask(0x200, 2).in_doubt(true))].into();
    let told = rig.run(ask(9, 16));
    assert_eq!(told.end, addresses(9, 16));
    assert!(!told.sent.contains(&read(23, 2)), "two words are owed by now: {:02X?}", told.sent);
}
