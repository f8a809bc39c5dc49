//! A unit that has given another number of words than it was asked for: its lengths prove nothing from then on.

use crate::asker::*;
use drivebus_rtu::*;

const WRITE: Request<'_> = Request::write(0x2000, 1);

fn repeat(words: u8, refusal: u8) -> Attribution {
    Attribution::Repeat { words, refusal }
}

/// Whether the lengths of unit 1 prove something, at `now`, at which nothing is open.
fn prove(asker: &Asker, now: u64) -> bool {
    let mut asker = asker.clone();
    asker.leaves_open(now, unit(1), &read(1));
    asker.attribution(ms(now), &read(2)) == repeat(1, 2)
}

/// An asker of a unit that answered a read of one word with `count`, and no other answer of which is open.
fn lied(count: u16) -> Asker {
    let mut asker = Asker::of_a_unit_that_echoes();
    let came = asker.asks(1_000, unit(1), &read(1), &words(unit(1), count, 7));
    assert_eq!(came, Came::Wrong(AnswerError::Count { asked: 1, came: count.into() }));
    asker.echoes(5_000, unit(1));
    asker
}

/// Two words of unit 1, while unit 2 is asked.
fn comes_beside(asker: &mut Asker, now: u64) {
    assert_eq!(asker.asks(now, unit(2), &WRITE, &words(unit(1), 2, 7)), Came::Nothing);
    asker.master.abort(ms(now));
}

#[test]
fn one_answer_of_another_length_is_enough() {
    let mut asker = Asker::of_a_unit_that_echoes();
    assert!(prove(&asker, 1_000));
    asker = lied(2);
    assert!(!prove(&asker, 5_000) && !prove(&asker, 3_600_000), "for good");
    let over = ms(10_000) + OVERTAKING;
    asker.leaves_open(10_000, unit(1), &read(1));
    for (now, at) in [(ms(10_000), repeat(2, 2)), (before(over), repeat(2, 2)), (over, Attribution::Certain)] {
        assert_eq!(asker.attribution(now, &read(16)), at);
    }
    assert!(!asker.tells_apart(ms(10_000), &read(16)), "it is no probe");
    assert_eq!(asker.attribution(ms(10_000), &WRITE), Attribution::Certain);
    assert_eq!(asker.attribution(ms(10_000), &Request::read_of(Table::Input, 0, 2).unwrap()), Attribution::Certain);
    assert_eq!(asker.master.attribution(ms(10_000), unit(2), &read(2)), Attribution::Certain);
}

#[test]
fn what_it_sends_back_proves_as_before() {
    let mut asker = lied(2);
    asker.leaves_open(10_000, unit(1), &read(1));
    assert!(asker.in_quarantine(ms(10_000)));
    asker.echoes(10_100, unit(1));
    assert!(!asker.in_quarantine(ms(10_100)));
    assert_eq!(asker.attribution(ms(10_100), &read(2)), repeat(2, 2), "it may still overtake");
}

/// Fewer words are as good a proof as more.
#[test]
fn an_answer_that_was_cut_is_one_of_another_length() {
    let mut asker = Asker::of_a_unit_that_echoes();
    let came = asker.asks(1_000, unit(1), &read(4), &words(unit(1), 2, 7));
    assert_eq!(came, Came::Wrong(AnswerError::Count { asked: 4, came: 2 }));
    asker.echoes(5_000, unit(1));
    assert!(!prove(&asker, 5_000));
}

#[test]
fn so_is_one_that_comes_while_another_unit_is_asked() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    comes_beside(&mut asker, 1_100);
    asker.echoes(6_000, unit(1));
    assert!(!prove(&asker, 6_000));
}

/// One frame in 65 536 that is damaged has a right CRC.
#[test]
fn a_frame_whose_bytes_are_not_as_many_as_it_says_teaches_nothing() {
    for cut in [&[3, 6, 0, 7, 0, 8, 0][..], &[3, 4, 0, 7, 0, 8, 0, 9], &[3, 0], &[3]] {
        let frame = Adu::answer(unit(1), &Answer::custom(cut).unwrap());
        let mut asker = Asker::of_a_unit_that_echoes();
        asker.leaves_open(1_000, unit(1), &read(3));
        assert_eq!(asker.asks(1_100, unit(2), &WRITE, &frame), Came::Nothing);
        asker.master.abort(ms(1_200));
        let came = asker.asks(1_300, unit(1), &read(3), &frame);
        assert!(came != Came::Answer, "{cut:?}: {came:?}");
        asker.master.abort(ms(1_400));
        asker.echoes(6_000, unit(1));
        assert!(prove(&asker, 6_000), "{cut:?}");
    }
}

/// The first closed what it answers; the second is the line's doing.
#[test]
fn an_answer_that_comes_twice_at_once_teaches_nothing() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.sends(1_100, unit(1), &read(2), TIMEOUT);
    let late = words(unit(1), 1, 7);
    assert_eq!(asker.hears(1_110, &late), Came::Nothing);
    assert_ne!(asker.hears(1_110, &late), Came::Answer);
    asker.master.abort(ms(1_200));
    asker.echoes(6_000, unit(1));
    assert!(prove(&asker, 6_000));
    // While another unit is asked.
    asker.leaves_open(11_000, unit(1), &read(1));
    asker.leaves_open(11_000, unit(1), &read(3));
    asker.sends(11_100, unit(2), &WRITE, TIMEOUT);
    assert_eq!((asker.hears(11_110, &late), asker.hears(11_110, &late)), (Came::Nothing, Came::Nothing));
    asker.master.abort(ms(11_200));
    asker.echoes(16_000, unit(1));
    assert!(prove(&asker, 16_000));
}

/// Which of those that are open it is, nothing tells.
#[test]
fn none_that_is_seen_ends_a_doubt_about_it() {
    let mut asker = lied(2);
    asker.leaves_open(10_000, unit(1), &read(1));
    asker.leaves_open(10_000, unit(1), &read(2));
    comes_beside(&mut asker, 10_100);
    assert_eq!(asker.attribution(ms(10_200), &read(2)), repeat(3, 3));
}

#[test]
fn a_length_that_is_owed_is_late_and_no_other() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(2));
    assert_eq!(asker.asks(1_100, unit(1), &read(1), &words(unit(1), 2, 7)), Came::Nothing);
    asker.master.abort(ms(1_200));
    asker.echoes(6_000, unit(1));
    assert!(prove(&asker, 6_000));
}

/// It may be what another program asked for.
#[test]
fn what_may_be_anothers_teaches_nothing() {
    for asker in [
        {
            let mut asker = Asker::new();
            asker.master.opened(ms(500));
            asker
        },
        {
            let mut asker = Asker::of_a_unit_that_echoes();
            asker.master.expect_others(true);
            asker
        },
    ] {
        let mut asker = asker;
        asker.sends(1_000, unit(1), &read(1), TIMEOUT);
        asker.hears(1_000, &words(unit(1), 2, 7));
        asker.master.abort(ms(1_100));
        asker.master.expect_others(false);
        asker.echoes(6_000, unit(1));
        assert!(prove(&asker, 6_000));
    }
}
