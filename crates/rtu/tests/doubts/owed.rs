//! As many answers can come as the unit owes: where one was taken that may have been another's, one of the two is open.

use drivebus_rtu::*;

use crate::asker::{Asker, Came, ms, read, refuses, unit, words};

fn repeat(words: u8, refusal: u8) -> Attribution {
    Attribution::Repeat { words, refusal }
}

/// A read of `count` words is refused at `now`.
fn refused(asker: &mut Asker, now: u64, count: u16) {
    assert_eq!(asker.asks(now, unit(1), &read(count), &refuses(unit(1), &read(count))), Came::Refusal);
}

/// A unit that owes the answers to so many reads of two words, and answers again.
fn owing(times: u64) -> Asker {
    let mut asker = Asker::of_a_unit_that_echoes();
    for time in 0..times {
        asker.leaves_open(1_000 + time, unit(1), &read(2));
    }
    asker.echoes(1_500, unit(1));
    asker
}

/// A drive that was silent twice, and refuses what it is asked then: that tells which family it is.
#[test]
fn however_many_refusals_are_taken_no_more_can_come() {
    let mut asker = owing(2);
    for (time, count) in (2_000..).zip([1, 3, 4, 5, 1, 1, 1, 3, 3, 4]) {
        refused(&mut asker, time, count);
        assert_eq!(asker.attribution(ms(time), &read(6)), repeat(1, 3), "after {time}");
    }
    assert_eq!(asker.attribution(ms(2_100), &read(1)), repeat(3, 3));
}

/// Of what is told apart one less can come, and of what took its place: once more is asked in any case.
#[test]
fn what_was_seen_can_not_come_in_the_place_of_another() {
    let mut asker = owing(2);
    refused(&mut asker, 2_000, 1);
    refused(&mut asker, 2_001, 1);
    assert_eq!(asker.attribution(ms(2_002), &read(1)), repeat(3, 3));
    for time in [2_010, 2_020] {
        assert_eq!(asker.hears(time, &words(unit(1), 2, 7)), Came::Nothing);
        assert_eq!(asker.attribution(ms(time), &read(1)), repeat(2, 2));
    }
}

/// What was asked for first is forgotten before what took its place: that counts on.
#[test]
fn what_took_the_place_of_another_is_owed_when_that_is_forgotten() {
    let mut asker = owing(2);
    refused(&mut asker, 2_000, 1);
    refused(&mut asker, 2_001, 1);
    asker.reads(4_000, unit(1), 1);
    // By now the reads of two words are past, and an echo forgets them; those of one word are not.
    asker.echoes(5_500, unit(1));
    assert_eq!(asker.attribution(ms(5_500), &read(2)), repeat(1, 3));
    assert_eq!(asker.attribution(ms(5_500), &read(1)), repeat(3, 3));
}

/// In quarantine a refusal counts as no answer, and was one.
#[test]
fn what_was_refused_in_quarantine_came_all_the_same() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(2));
    for (time, count) in [(1_100, 3), (1_200, 4)] {
        let came = asker.asks(time, unit(1), &read(count), &refuses(unit(1), &read(count)));
        assert_eq!(came, Came::Wrong(AnswerError::Refusal { code: ExceptionCode::ILLEGAL_ADDRESS }));
        assert!(asker.in_quarantine(ms(time)));
    }
    asker.echoes(1_300, unit(1));
    assert_eq!(asker.attribution(ms(1_300), &read(1)), repeat(1, 2));
}

/// Where another master asks, an answer may be its, and then nothing of ours has come.
#[test]
fn where_others_ask_nothing_is_told_by_what_came() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.master.expect_others(true);
    asker.leaves_open(1_000, unit(1), &read(2));
    asker.echoes(1_500, unit(1));
    refused(&mut asker, 2_000, 1);
    assert_eq!(asker.attribution(ms(2_000), &read(3)), repeat(1, 3));
}
