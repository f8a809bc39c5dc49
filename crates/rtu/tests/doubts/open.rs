//! What is left open, and how sure the answer to the next request can be, until no open answer can overtake any more.

use crate::asker::*;
use drivebus_rtu::*;

const SECOND: Duration = Duration::from_secs(1);
const WRITE: Request<'_> = Request::write(0x2000, 1);

fn repeat(words: u8, refusal: u8) -> Attribution {
    Attribution::Repeat { words, refusal }
}

/// Requests of each kind, by a name that says which answers look alike: those with the same letter, unless their lengths in
/// bytes, which follow, are known to differ. `?` is not known.
fn kinds() -> Vec<(&'static str, Request<'static>)> {
    let custom = |pdu: &'static [u8], answer| Request::custom(pdu, answer).unwrap();
    vec![
        ("r4", read(1)),
        ("r4", Request::read(0x2200, 1).unwrap()),
        ("r6", read(2)),
        ("r4", custom(&[0x03, 0, 0, 0, 1], AnswerLength::Bytes(4))),
        ("r?", custom(&[0x03, 0, 0, 0, 1], AnswerLength::BySilence)),
        ("a5", WRITE),
        ("b5", Request::write(0x2000, 2)),
        ("c5", Request::write(0x2001, 1)),
        ("d5", Request::write_many(0x2000, &[1]).unwrap()),
        ("d5", Request::write_many(0x2000, &[2]).unwrap()),
        ("e5", Request::write_many(0x2000, &[1, 2]).unwrap()),
        ("i4", custom(&[0x04, 0, 0, 0, 1], AnswerLength::Bytes(4))),
        ("i4", custom(&[0x04, 0, 9, 0, 1], AnswerLength::Bytes(4))),
        ("i6", custom(&[0x04, 0, 0, 0, 2], AnswerLength::Bytes(6))),
        ("i?", custom(&[0x04, 0, 0, 0, 2], AnswerLength::BySilence)),
        ("x5", Request::echo(7)),
    ]
}

fn look_alike(one: &str, other: &str) -> bool {
    one[..1] == other[..1] && (one[1..] == other[1..] || one.ends_with('?') || other.ends_with('?'))
}

#[test]
fn what_an_open_answer_could_pass_for_is_repeated_or_waits() {
    for (open_name, open) in kinds() {
        for (name, asked) in kinds() {
            let mut asker = Asker::new();
            asker.leaves_open(10_000, unit(1), &open);
            let over = ms(10_000) + OVERTAKING;
            let alike = look_alike(open_name, name);
            let expected = match asked {
                Request::Echo { .. } => Attribution::Certain,
                _ if open.function() != asked.function() => Attribution::Certain,
                // Refusals of one function look alike; the words only if there are as many.
                Request::Read { table: Table::Holding, .. } => repeat(if alike { 2 } else { 1 }, 2),
                _ if alike => Attribution::Wait(over),
                _ => Attribution::Certain,
            };
            let case = format!("{open:?} is open, {asked:?} is asked");
            assert_eq!(asker.attribution(ms(10_000), &asked), expected, "{case}");
            assert_eq!(asker.attribution(before(over), &asked), expected, "{case}");
            assert_eq!(asker.attribution(over, &asked), Attribution::Certain, "{case}");
            assert_eq!(asker.master.attribution(ms(10_000), unit(2), &asked), Attribution::Certain, "{case}");
        }
    }
}

#[test]
fn only_words_that_have_to_come_again_may_be_mistaken() {
    assert!(!Attribution::Certain.may_be_mistaken());
    assert!(!repeat(1, 2).may_be_mistaken() && repeat(2, 2).may_be_mistaken());
    assert!(Attribution::Wait(Instant::ZERO).may_be_mistaken());
}

/// One more than are open; where the answers would have more than 400 bytes in all, or come more than ten times, the wait is
/// shorter. Four times are never too many.
#[test]
fn a_read_is_repeated_once_for_each_open_answer_and_waits_where_these_are_too_many() {
    for (words, most) in [(1, 9), (16, 9), (17, 9), (18, 8), (19, 8), (20, 7), (31, 4), (37, 4), (38, 3), (125, 3)] {
        let mut asker = Asker::new();
        for open in 1..=12_u8 {
            let now = u64::from(open) * 100;
            asker.leaves_open(now, unit(1), &read(words));
            let sure = repeat(open + 1, open + 1);
            let expected = if open <= most { sure } else { Attribution::Wait(ms(now) + OVERTAKING) };
            assert_eq!(asker.attribution(ms(now), &read(words)), expected, "{open} of {words} words are open");
            let apart = repeat(1, open + 1);
            assert_eq!(asker.attribution(ms(now), &read(words - 1 + 2 * u16::from(words == 1))), apart);
        }
    }
}

/// Each is open for its own time, of one kind or of several; who waits, waits for all whose refusals look alike.
#[test]
fn each_is_open_from_when_it_was_given_up() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &WRITE);
    asker.leaves_open(1_500, unit(1), &read(1));
    asker.leaves_open(2_000, unit(1), &read(2));
    asker.leaves_open(2_500, unit(1), &read(1));
    assert_eq!(asker.attribution(ms(2_500), &WRITE), Attribution::Wait(ms(4_000)), "reads do not look like it");
    assert_eq!(asker.attribution(before(ms(4_500)), &read(1)), repeat(3, 4));
    assert_eq!(asker.attribution(ms(4_500), &read(1)), repeat(2, 3));
    assert_eq!(asker.attribution(before(ms(5_000)), &read(2)), repeat(2, 3));
    assert_eq!(asker.attribution(ms(5_000), &read(2)), repeat(1, 2));
    assert_eq!(asker.attribution(ms(5_500), &read(1)), Attribution::Certain);
}

#[test]
fn a_long_time_out_makes_it_four_of_those_and_the_longest_counts() {
    let long = Duration::from_millis(800);
    let cases = [
        (Duration::from_millis(750), None, 3_000),
        (Duration::from_millis(751), None, 3_004),
        (long, None, 3_200),
        (long, Some(TIMEOUT), 3_200),
        (TIMEOUT, Some(long), 3_200),
    ];
    for (first, second, millis) in cases {
        let mut asker = Asker::new();
        asker.leaves_open_for(1_000, unit(1), &read(1), first);
        if let Some(timeout) = second {
            asker.leaves_open_for(1_000, unit(1), &read(1), timeout);
        }
        let over = ms(1_000 + millis);
        assert!(asker.attribution(before(over), &read(1)).may_be_mistaken());
        assert_eq!(asker.attribution(over, &read(1)), Attribution::Certain);
    }
}

/// What was settled in order may still overtake. Once it can do that no more, the next is counted afresh.
#[test]
fn what_is_past_and_settled_is_not_counted_with_what_is_left_open_later() {
    let mut asker = Asker::of_a_unit_that_echoes();
    let long = Duration::from_secs(2);
    asker.leaves_open_for(1_000, unit(1), &read(1), long);
    asker.echoes(1_500, unit(1));
    assert_eq!(asker.attribution(ms(1_500), &read(1)), repeat(2, 2), "it may overtake the echo");
    let over = 1_000 + 8_000;
    let mut early = asker.clone();
    early.leaves_open(over - 1, unit(1), &read(1));
    assert_eq!(early.attribution(ms(over - 1), &read(1)), repeat(3, 3), "both may come");
    asker.leaves_open(over, unit(1), &read(1));
    assert_eq!(asker.attribution(ms(over), &read(1)), repeat(2, 2), "the first cannot come any more");
    assert_eq!(asker.attribution(ms(over) + OVERTAKING, &read(1)), Attribution::Certain, "nor has it its time");
}

/// In quarantine nothing is past, as the unit may answer in order, however late; nothing that looks like it is asked then. What
/// may overtake the end of it is what was given up within its time.
#[test]
fn what_may_overtake_is_counted_and_what_is_in_order_is_not_asked() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.leaves_open(9_000, unit(1), &read(1));
    assert_eq!(asker.attribution(ms(9_000), &read(1)), repeat(2, 2));
    assert!(!asker.master.tells_apart(ms(9_000), unit(1), &read(1)));
}

/// Each answer taken may have been the open one, and its own is open instead. That is believed three times over at most.
#[test]
fn an_answer_taken_where_another_could_come_leaves_one_open() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.echoes(1_000, unit(1));
    for (taken, over) in [(3_000, 6_000), (5_000, 8_000), (7_000, 10_000), (9_000, 10_000)] {
        asker.reads(taken, unit(1), 1);
        assert_eq!(asker.attribution(before(ms(over)), &read(1)), repeat(2, 2), "taken at {taken} ms");
        assert_eq!(asker.attribution(ms(over), &read(1)), Attribution::Certain, "taken at {taken} ms");
    }
    asker.reads(10_000, unit(1), 1);
    assert_eq!(asker.attribution(ms(10_000), &read(1)), Attribution::Certain, "it is past");
}

/// It may be as late as the one that was asked for longer.
#[test]
fn the_longer_time_out_of_both_tells_how_long_the_one_that_is_left_may_come() {
    let long = Duration::from_secs(2);
    for (first, second) in [(TIMEOUT, long), (long, TIMEOUT)] {
        let mut asker = Asker::new();
        asker.leaves_open_for(1_000, unit(1), &read(1), first);
        asker.echoes(1_000, unit(1));
        asker.sends(3_000, unit(1), &read(1), second);
        assert_eq!(asker.hears(3_000, &words(unit(1), 1, 7)), Came::Answer);
        let over = ms(3_000 + 8_000);
        assert_eq!(asker.attribution(before(over), &read(1)), repeat(2, 2), "{first:?}, {second:?}");
        assert_eq!(asker.attribution(over, &read(1)), Attribution::Certain, "{first:?}, {second:?}");
    }
}

#[test]
fn an_answer_taken_for_which_no_open_one_could_pass_changes_nothing() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(2));
    asker.leaves_open(1_000, unit(2), &read(1));
    asker.leaves_open(1_000, unit(1), &WRITE);
    asker.echoes(1_000, unit(1));
    asker.reads(2_000, unit(1), 1);
    assert_eq!(asker.asks(2_000, unit(1), &read(3), &refuses(unit(1), &read(3))), Came::Refusal);
    asker.reads(2_000, unit(3), 1);
    let over = ms(4_000);
    assert_eq!(asker.attribution(before(over), &WRITE), Attribution::Wait(over), "only reads were answered");
    assert_eq!(asker.attribution(over, &WRITE), Attribution::Certain);
    assert_eq!(asker.master.attribution(over, unit(2), &read(1)), Attribution::Certain, "another unit");
}

/// Refusals of reads look alike: the one taken may be that of the open read, and this one's comes later, in its place.
#[test]
fn a_refusal_taken_where_another_could_come_leaves_one_of_both_open() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(2));
    asker.echoes(1_000, unit(1));
    asker.reads(2_000, unit(1), 1);
    assert_eq!(asker.attribution(ms(2_000), &read(1)), repeat(1, 2), "words tell whose they are");
    assert_eq!(asker.asks(3_000, unit(1), &read(1), &refuses(unit(1), &read(1))), Came::Refusal);
    assert_eq!(asker.attribution(before(ms(6_000)), &read(1)), repeat(2, 2));
    assert_eq!(asker.attribution(ms(6_000), &read(1)), Attribution::Certain);
}

/// However often one refusal is taken for another's: it is one answer that is late.
#[test]
fn refusals_taken_for_each_other_are_believed_three_times_over_at_most() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(2));
    asker.echoes(1_000, unit(1));
    for (taken, over, count) in [(3_000, 6_000, 1), (5_000, 8_000, 2), (7_000, 10_000, 1), (9_000, 10_000, 2)] {
        assert_eq!(asker.asks(taken, unit(1), &read(count), &refuses(unit(1), &read(count))), Came::Refusal);
        assert_ne!(asker.attribution(before(ms(over)), &read(2)), Attribution::Certain, "taken at {taken} ms");
        assert_eq!(asker.attribution(ms(over), &read(2)), Attribution::Certain, "taken at {taken} ms");
    }
}

/// 04H of a known length and of an unknown one: either may be the answer of the other.
#[test]
fn an_answer_that_displaced_another_kind_leaves_its_own_kind_open() {
    let any = Request::custom(&[0x04, 0, 0, 0, 2], AnswerLength::BySilence).unwrap();
    let known = Request::custom(&[0x04, 0, 0, 0, 2], AnswerLength::Bytes(6)).unwrap();
    let shorter = Request::custom(&[0x04, 0, 0, 0, 1], AnswerLength::Bytes(4)).unwrap();
    let answer = Adu::answer(unit(1), &Answer::custom(&[0x04, 4, 0, 1, 0, 2]).unwrap());
    let mut asker = Asker::new();
    asker.leaves_open_for(1_000, unit(1), &any, SECOND);
    asker.echoes(1_000, unit(1));
    assert_eq!(asker.asks(3_000, unit(1), &known, &answer), Came::Answer);
    let over = ms(3_000 + 4_000);
    assert_eq!(asker.attribution(before(over), &known), Attribution::Wait(over));
    assert_eq!(asker.attribution(over, &known), Attribution::Certain);
    // And that of the known length only, once the other was seen.
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &known);
    asker.echoes(1_000, unit(1));
    assert_eq!(asker.asks(2_000, unit(1), &any, &answer), Came::Answer);
    assert_eq!(asker.attribution(ms(2_000), &shorter), Attribution::Wait(ms(5_000)), "the answer of unknown length");
}

/// Who finds out that an answer was none says so.
#[test]
fn an_answer_that_turns_out_to_be_none_is_still_owed() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.reads(1_000, unit(1), 1);
    assert!(!asker.in_quarantine(ms(1_000)));
    asker.master.still_owed(ms(1_500), unit(1), &read(1), SECOND);
    assert!(asker.in_quarantine(ms(1_500)) && !asker.master.in_quarantine(ms(1_500), unit(2)));
    assert_eq!(asker.attribution(before(ms(5_500)), &read(1)), repeat(2, 2));
    assert_eq!(asker.attribution(ms(5_500), &read(1)), Attribution::Certain);
}

/// Over Modbus TCP a number tells what is late.
#[test]
fn what_is_known_to_be_late_is_owed_no_more() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.leaves_open(1_010, unit(1), &read(1));
    let after = |asker: &Asker| asker.attribution(ms(1_020), &read(1));
    for (frame, words) in [(words(unit(1), 2, 7), 3), (words(unit(1), 1, 7), 2), (words(unit(1), 1, 7), 1)] {
        asker.master.saw_late(ms(1_020), frame.as_bytes());
        match after(&asker) {
            Attribution::Certain => assert_eq!(words, 1),
            other => assert_eq!(other, Attribution::Repeat { words, refusal: words }),
        }
    }
    assert!(!asker.in_quarantine(ms(1_020)));
    asker.master.saw_late(ms(1_020), &[1, 3]);
    assert_eq!(after(&asker), Attribution::Certain);
}
