//! How often an answer has to come before it is believed.

use crate::asker::unit;
use drivebus_rtu::*;

/// Repetitions from 1 on of words and of refusals, and how often the caller wants the words at least.
fn cases() -> impl Iterator<Item = (u8, u8, u8)> {
    (1..=4).flat_map(|words| (1..=4).flat_map(move |refusal| (1..=3).map(move |least| (words, refusal, least))))
}

fn agreement(words: u8, refusal: u8, least: u8) -> Agreement {
    Agreement::new(Attribution::Repeat { words, refusal }, least)
}

const REFUSAL: Answer<'_> = Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS);

/// How often `answer` has to come in a row after `before`, if ten times are enough.
fn times(mut agreement: Agreement, before: &[Answer<'_>], answer: &Answer<'_>) -> usize {
    for other in before {
        agreement.hear(unit(1), other);
    }
    (1..=10).find(|_| agreement.hear(unit(1), answer)).unwrap()
}

#[test]
fn words_and_refusals_have_to_come_as_often_as_each_of_them_needs() {
    let seven = Answer::read(&[7]).unwrap();
    for (words, refusal, least) in cases() {
        let fresh = || agreement(words, refusal, least);
        assert_eq!(times(fresh(), &[], &seven), usize::from(words.max(least)));
        assert_eq!(times(fresh(), &[], &REFUSAL), usize::from(refusal), "a refusal is not verified");
        let other = Answer::read(&[8]).unwrap();
        assert_eq!(times(fresh(), &[seven, other], &seven), usize::from(words.max(least)), "in a row");
    }
}

#[test]
fn one_answer_is_enough_where_neither_words_nor_a_refusal_have_to_come_twice() {
    for (words, refusal, least) in cases() {
        assert_eq!(agreement(words, refusal, least).is_immediate(), (words.max(least), refusal) == (1, 1));
    }
    for attribution in [Attribution::Certain, Attribution::Wait(Instant::ZERO)] {
        assert!(Agreement::new(attribution, 1).is_immediate());
        assert!(!Agreement::new(attribution, 2).is_immediate(), "asked twice to be sure");
    }
}

/// A late answer that comes just before the last one that was needed makes the longest sequence.
#[test]
fn the_longest_sequence_is_one_that_another_answer_interrupts_as_late_as_can_be() {
    let other = Answer::read(&[8]).unwrap();
    for (words, refusal, least) in cases() {
        let longest = [(words.max(least), Answer::read(&[7]).unwrap()), (refusal, REFUSAL)].map(|(needed, answer)| {
            let mut before = vec![answer; usize::from(needed) - 1];
            before.push(other);
            before.len() + times(agreement(words, refusal, least), &before, &answer)
        });
        assert_eq!(usize::from(agreement(words, refusal, least).longest()), longest[0].max(longest[1]));
    }
}
