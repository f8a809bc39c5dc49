//! How often an answer has to come before it is believed.

use crate::asker::unit;
use drivebus_rtu::*;
use proptest::prelude::*;

/// Repetitions from 1 on of words and of refusals, and how often the caller wants the words at least.
fn cases() -> impl Iterator<Item = (u8, u8, u8)> {
    (1..=4).flat_map(|words| (1..=4).flat_map(move |refusal| (1..=3).map(move |least| (words, refusal, least))))
}

fn agreement(words: u8, refusal: u8, least: u8) -> Agreement {
    Agreement::new(Attribution::Repeat { words, refusal }, least)
}

const REFUSAL: Answer<'_> = Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS);

/// How often `answer` has to come after `before`, if ten times are enough.
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
        let left = words.max(least).max(2) - 1;
        assert_eq!(
            times(fresh(), &[seven, other], &seven),
            usize::from(left.max(least)),
            "what came before other words counts"
        );
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

/// Late answers that are alike make the longest sequence where one less came than is believed, after as many right ones.
#[test]
fn the_longest_sequence_is_one_that_has_as_many_late_answers_as_can_be() {
    let other = Answer::read(&[8]).unwrap();
    for (words, refusal, least) in cases() {
        for (needed, answer) in [(words.max(least), Answer::read(&[7]).unwrap()), (refusal, REFUSAL)] {
            let late = usize::from(needed) - 1;
            for first in 0..=late {
                let before = [vec![answer; first], vec![other; late], vec![answer; late - first]].concat();
                let heard = before.len() + times(agreement(words, refusal, least), &before, &answer);
                assert!(heard <= usize::from(agreement(words, refusal, least).longest()), "{first} before {late}");
            }
        }
    }
}

proptest! {
    /// What is believed came so often that one of them was no late one, and the words as often in a row as the caller wants.
    #[test]
    fn what_is_believed_came_often_enough(
        words in 1..=10_u8,
        least in 1..=3_u8,
        came in prop::collection::vec(0..5_u16, 1..60),
    ) {
        let mut agreement = agreement(words, words, least);
        for (index, word) in came.iter().enumerate() {
            if agreement.hear(unit(1), &Answer::read(&[*word]).unwrap()) {
                let heard = &came[..=index];
                prop_assert!(heard.iter().filter(|other| *other == word).count() >= usize::from(words));
                prop_assert!(heard.iter().rev().take_while(|other| *other == word).count() >= usize::from(least));
            }
        }
    }

    /// However late answers of two kinds come between them, words that do not change are believed in the end.
    #[test]
    fn late_answers_of_two_kinds_hinder_nothing_for_long(
        words in 1..=10_u8,
        places in prop::collection::vec((0..30_usize, 0..2_u16), 0..9),
    ) {
        let late = &places[..places.len().min(usize::from(words) - 1)];
        let mut came = vec![7; 30];
        for &(place, word) in late {
            came.insert(place.min(came.len()), word);
        }
        let mut agreement = agreement(words, words, 1);
        let after = came.iter().position(|word| agreement.hear(unit(1), &Answer::read(&[*word]).unwrap())).unwrap();
        prop_assert_eq!(came[after], 7);
        prop_assert!(after < usize::from(words) * 3);
    }
}
