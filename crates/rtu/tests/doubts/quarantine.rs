//! Which units are in quarantine, what may be asked there, and what ends it.

use crate::asker::*;
use drivebus_rtu::*;

const WRITE: Request<'_> = Request::write(0x2000, 1);
const ECHO: Request<'_> = Request::echo(0xBEEF);

/// Whether unit 1 is in quarantine, may owe an echo, and when first contact with it ends, at `now`.
fn doubts(asker: &Asker, now: Instant) -> (bool, bool, Option<Instant>) {
    let master = &asker.master;
    (master.in_quarantine(now, unit(1)), master.may_owe_an_echo(now, unit(1)), master.first_contact_ends(now, unit(1)))
}

#[test]
fn at_first_contact_every_unit_is_in_quarantine_for_a_second() {
    let mut asker = Asker::new();
    assert_eq!(doubts(&asker, ms(0)), (false, false, None), "nobody else asked");
    asker.master.opened(ms(5_000));
    let over = ms(5_000) + FIRST_CONTACT;
    for raw in [1, 247] {
        assert!(asker.master.in_quarantine(before(over), unit(raw)) && !asker.master.in_quarantine(over, unit(raw)));
    }
    assert_eq!(doubts(&asker, before(over)), (true, true, Some(over)));
    assert_eq!(doubts(&asker, over), (false, false, None));
    for request in [read(1), read(125), WRITE] {
        assert!(!asker.tells_apart(before(over), &request), "{request:?}: anything may have been asked");
    }
    assert!(asker.tells_apart(before(over), &ECHO) && asker.tells_apart(over, &read(1)));
    asker.echoes(5_000, unit(1));
    assert_eq!(doubts(&asker, ms(5_000)), (false, false, None));
    assert!(asker.master.in_quarantine(ms(5_000), unit(2)), "an echo speaks for its unit");
}

#[test]
fn what_begins_in_quarantine_is_only_what_can_be_told_apart() {
    for open in [1, 2, 5] {
        let mut asker = Asker::new();
        asker.leaves_open(1_000, unit(1), &read(open));
        let mut begins = |request: &Request<'_>| {
            let told = asker.tells_apart(ms(1_000), request);
            let begun = asker.master.begin(ms(1_000), unit(1).into(), request, TIMEOUT);
            asker.master.abort(ms(1_000));
            assert_eq!(begun, if told { Ok(()) } else { Err(BeginError::Quarantine { unit: unit(1) }) });
            told
        };
        // Some units answer with fewer words than they were asked for.
        for count in 1..=6 {
            assert_eq!(begins(&read(count)), count > open, "{count} words, and {open} are open");
        }
        assert!(begins(&ECHO));
        for refused in [WRITE, Request::custom(&[0x04, 0, 0, 0, 1], AnswerLength::Bytes(4)).unwrap()] {
            assert!(!begins(&refused), "{refused:?}");
        }
    }
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &Request::custom(&[0x03, 0, 0, 0, 9], AnswerLength::BySilence).unwrap());
    assert!(!asker.tells_apart(ms(1_000), &read(1)), "an answer of any length is open");
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &WRITE);
    assert!(asker.tells_apart(ms(1_000), &read(1)), "a confirmation is no word read");
}

/// Three seconds after the last request that it left open, and never while a unit may still return an echo.
#[test]
fn time_ends_a_quarantine_only_of_a_unit_that_never_returned_an_echo() {
    for echoes in [false, true] {
        let mut asker = if echoes { Asker::of_a_unit_that_echoes() } else { Asker::new() };
        let long = Duration::from_secs(2);
        asker.leaves_open_for(1_000, unit(1), &read(2), long);
        asker.leaves_open(1_500, unit(1), &read(1));
        asker.leaves_echo_open(2_000, unit(1));
        let over = ms(1_500) + PATIENCE;
        assert_eq!(doubts(&asker, before(over)), (true, true, None));
        assert_eq!(doubts(&asker, over), (echoes, true, None), "an echo is no word read, and may still be owed");
        // What is open may still overtake, in quarantine or not.
        let overtaken = ms(1_000) + Duration::from_secs(8);
        assert!(!asker.tells_apart(before(overtaken), &read(2)));
        assert_eq!(asker.tells_apart(overtaken, &read(2)), !echoes);
        asker.echoes(10_000, unit(1));
        assert_eq!(doubts(&asker, ms(10_000)), (false, false, None));
        assert!(asker.tells_apart(ms(10_000), &read(1)));
    }
}

/// Four echoes that stay open leave the unit one that returns them; the fifth does not. Nor do others count.
#[test]
fn a_unit_that_leaves_five_echoes_open_is_one_that_returns_none() {
    for (echoes, reads, mute) in [(4, 1, false), (5, 1, true), (0, 6, false), (4, 6, false)] {
        let mut asker = Asker::of_a_unit_that_echoes();
        for _ in 0..reads {
            asker.leaves_open(1_000, unit(1), &read(1));
        }
        for _ in 0..echoes {
            asker.leaves_echo_open(1_000, unit(1));
        }
        let over = ms(1_000) + PATIENCE;
        assert!(asker.in_quarantine(before(over)));
        assert_eq!(asker.in_quarantine(over), !mute, "{echoes} echoes, {reads} reads");
    }
}

#[test]
fn echoes_that_stay_open_are_counted_until_one_comes_back() {
    let mut asker = Asker::of_a_unit_that_echoes();
    let four = |asker: &mut Asker, now| (0..4).for_each(|_| asker.leaves_echo_open(now, unit(1)));
    four(&mut asker, 1_000);
    asker.echoes(1_000, unit(1));
    four(&mut asker, 1_000);
    asker.leaves_open(1_000, unit(1), &read(1));
    assert!(asker.in_quarantine(ms(9_000)), "one came back between them");
    // Another answer that is seen is none, however late the fifth is.
    assert_eq!(asker.hears(9_000, &words(unit(1), 1, 7)), Came::Nothing);
    assert!(!asker.in_quarantine(ms(9_000)));
    asker.leaves_echo_open(9_000, unit(1));
    asker.leaves_open(9_000, unit(1), &read(1));
    assert!(!asker.in_quarantine(ms(9_000) + PATIENCE), "five stayed open");
}

/// The words of another length, of a unit that answers in order, are proof as an echo is; but they may be overtaken.
#[test]
fn the_answer_to_a_read_of_another_length_ends_a_quarantine() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.leaves_open(1_000, unit(2), &read(1));
    asker.reads(2_000, unit(1), 2);
    assert_eq!(doubts(&asker, ms(2_000)), (false, false, None));
    assert!(!asker.tells_apart(ms(2_000), &read(1)), "it may still overtake");
    assert!(asker.master.in_quarantine(ms(2_000), unit(2)));
    assert_eq!(asker.master.attribution(ms(2_000), unit(2), &read(1)), Attribution::Repeat { words: 2, refusal: 2 });
    // A later quarantine is about what was left open later.
    asker.leaves_open(4_000, unit(1), &read(1));
    asker.reads(4_500, unit(1), 2);
    asker.leaves_open(9_000, unit(1), &read(2));
    assert!(asker.tells_apart(ms(9_000), &read(3)) && !asker.tells_apart(ms(9_000), &read(1)));
    asker.reads(9_500, unit(1), 3);
    asker.leaves_open(20_000, unit(1), &read(1));
    assert!(asker.tells_apart(ms(20_000), &read(2)), "what was settled long ago is forgotten");
}

#[test]
fn a_refused_echo_settles_what_was_asked_before_it() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    assert_eq!(asker.asks(1_500, unit(1), &ECHO, &refuses(unit(1), &ECHO)), Came::Refusal);
    assert_eq!(doubts(&asker, ms(1_500)), (false, false, None));
}

/// The refusal may be that of another program's echo; then this one's is still owed.
#[test]
fn at_first_contact_a_refused_echo_proves_nothing() {
    let mut asker = Asker::new();
    asker.master.opened(ms(1_000));
    assert_eq!(asker.asks(1_500, unit(1), &ECHO, &refuses(unit(1), &ECHO)), Came::Refusal);
    assert_eq!(doubts(&asker, before(ms(2_000))), (true, true, Some(ms(2_000))));
    assert_eq!(doubts(&asker, ms(2_000)), (false, true, None));
}

/// A unit that a refused echo settled is not one that returns echoes.
#[test]
fn only_an_echo_that_came_back_shows_that_a_unit_returns_them() {
    for proof in [ECHO, read(2)] {
        let mut asker = Asker::new();
        asker.leaves_open(1_000, unit(1), &read(1));
        let answer = if proof == ECHO { refuses(unit(1), &ECHO) } else { words(unit(1), 2, 7) };
        asker.asks(1_000, unit(1), &proof, &answer);
        asker.leaves_open(1_000, unit(1), &read(1));
        assert!(!asker.in_quarantine(ms(1_000) + PATIENCE));
    }
}

#[test]
fn an_open_answer_that_is_seen_is_owed_no_more_whoever_owes_more() {
    for mut asker in [Asker::new(), Asker::of_a_unit_that_echoes()] {
        asker.leaves_open(1_000, unit(1), &read(1));
        asker.leaves_open(1_000, unit(2), &read(1));
        asker.leaves_open(1_000, unit(1), &read(2));
        asker.leaves_echo_open(1_000, unit(1));
        assert_eq!(asker.hears(1_500, &words(unit(1), 1, 7)), Came::Nothing);
        assert_eq!(asker.attribution(ms(1_500), &read(1)), Attribution::Repeat { words: 1, refusal: 2 });
        assert!(asker.in_quarantine(ms(1_500)), "two words are still open");
        assert_eq!(asker.hears(1_500, &words(unit(1), 2, 7)), Came::Nothing);
        assert_eq!(doubts(&asker, ms(1_500)), (false, false, None), "echoes can be mistaken for nothing else");
        assert!(asker.master.in_quarantine(ms(1_500), unit(2)), "another unit");
    }
}

/// What two open ones could be, a refusal, and what a stranger may have asked for, is nobody's.
#[test]
fn what_is_seen_and_could_be_of_several_settles_none() {
    let any = Request::custom(&[0x03, 0, 0, 0, 1], AnswerLength::BySilence).unwrap();
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.hears(1_500, &refuses(unit(1), &read(1)));
    assert_eq!(asker.attribution(ms(1_500), &read(1)), Attribution::Repeat { words: 2, refusal: 2 });
    asker.leaves_open(1_500, unit(1), &any);
    asker.hears(2_000, &words(unit(1), 1, 7));
    assert_eq!(asker.attribution(ms(2_000), &read(1)), Attribution::Repeat { words: 3, refusal: 3 });

    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.master.opened(ms(1_000));
    asker.hears(1_999, &words(unit(1), 1, 7));
    assert_eq!(asker.attribution(ms(1_999), &read(1)), Attribution::Repeat { words: 2, refusal: 2 });
    asker.hears(2_000, &words(unit(1), 1, 8));
    assert_eq!(asker.attribution(ms(2_000), &read(1)), Attribution::Certain);
}

/// Words that give the frame of unit 2 the CRC of unit 1's frame.
fn another_with_the_same_crc() -> (Adu, Adu) {
    let one = words(unit(1), 1, 7);
    let crc = |frame: &Adu| frame.as_bytes()[5..].to_vec();
    let other = (0..=u16::MAX).map(|value| words(unit(2), 1, value)).find(|other| crc(other) == crc(&one));
    (one, other.unwrap())
}

/// Each frame but the same again is another answer; and the same again too, once a request went out between.
#[test]
fn only_the_very_same_frame_can_be_one_that_the_line_brought_twice() {
    let twice = |second: &dyn Fn(&mut Asker)| {
        let mut asker = Asker::new();
        for open in [1, 1, 2, 2] {
            asker.leaves_open(1_000, unit(open), &read(1));
        }
        asker.hears(1_500, &words(unit(1), 1, 7));
        second(&mut asker);
        let rest = |raw| asker.master.attribution(ms(1_500), unit(raw), &read(1));
        [rest(1), rest(2)].map(|left| match left {
            Attribution::Repeat { words, .. } => words - 1,
            _ => 0,
        })
    };
    assert_eq!(twice(&|_| ()), [1, 2]);
    assert_eq!(twice(&|asker| assert_eq!(asker.hears(1_500, &words(unit(1), 1, 7)), Came::Nothing)), [1, 2]);
    assert_eq!(twice(&|asker| assert_eq!(asker.hears(1_500, &words(unit(1), 1, 8)), Came::Nothing)), [0, 2]);
    let (one, other) = another_with_the_same_crc();
    assert_eq!(one, words(unit(1), 1, 7));
    assert_eq!(twice(&|asker| assert_eq!(asker.hears(1_500, &other), Came::Nothing)), [1, 1]);
    let after_a_request = twice(&|asker| {
        asker.leaves_open(1_500, unit(3), &read(1));
        assert_eq!(asker.hears(1_500, &words(unit(1), 1, 7)), Came::Nothing);
    });
    assert_eq!(after_a_request, [0, 2]);
}

/// The answer itself may come twice at once, too. Its second coming is not what is open.
#[test]
fn an_answer_that_the_line_brought_twice_is_not_the_open_one() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.echoes(1_000, unit(1));
    asker.reads(1_500, unit(1), 1);
    assert_eq!(asker.hears(1_500, &words(unit(1), 1, 7)), Came::Nothing);
    assert_eq!(asker.attribution(ms(1_500), &read(1)), Attribution::Repeat { words: 2, refusal: 2 });
}
