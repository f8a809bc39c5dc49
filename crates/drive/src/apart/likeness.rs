//! What an answer, or the answers so far, say of one family; and what a question would say of two.

use drivebus_drives::Place;

use super::Apart;
use crate::answer::{Answer, Said};
use crate::family::Family;

/// The exceptions that a family may answer without its manual listing them.
///
/// Source: *Modbus Application Protocol* V1.1b3, §7.
const SPECIFIED: [u8; 9] = [0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x0A, 0x0B];

/// What one answer says of one family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Says {
    /// Nothing against it.
    Nothing,
    /// That the unit is none of it.
    Against,
    /// The same, unless the unit gave a code of the family.
    AgainstUnlessReported,
}

impl Apart {
    /// Whether nothing that was heard speaks against `family`.
    pub(super) fn is_live(&self, family: &Family) -> bool {
        self.answers.iter().all(|&answer| match says(family, answer) {
            Says::Nothing => true,
            Says::Against => false,
            Says::AgainstUnlessReported => self.is_reported(family),
        })
    }

    /// Whether its code came, or its whole signature, or where it has neither, one of its states.
    pub(super) fn is_shown(&self, family: &Family) -> bool {
        if family.is_listed() || family.signature().is_some() {
            return self.is_told(family);
        }
        // A state alone may be any word: what else was answered must fit, too.
        let state = family.state_place().and_then(|place| self.answer(place)).and_then(Answer::word);
        state.is_some_and(|word| family.knows_state(word)) && self.explains_by_rule(family)
    }

    /// Whether its code came, or its whole signature.
    pub(super) fn is_told(&self, family: &Family) -> bool {
        if family.is_listed() && family.code_place().is_some() {
            return self.is_reported(family);
        }
        family.is_signed_by(&self.answers)
    }

    /// Whether a unit of `family` would have answered what was answered.
    pub(super) fn explains(&self, family: &Family) -> bool {
        self.answered().all(|place| family.would_answer(place))
    }

    /// The same, or its addresses may hold a parameter there that has no row.
    pub(super) fn explains_by_rule(&self, family: &Family) -> bool {
        self.answered().all(|place| family.would_answer(place) || family.may_have_parameter(place))
    }

    /// Whether the unit answered any question, and did not refuse them all.
    pub(super) fn has_words(&self) -> bool {
        self.answered().next().is_some()
    }

    /// Whether it refused any.
    pub(super) fn has_refused(&self) -> bool {
        self.answers.iter().any(|answer| answer.word().is_none())
    }

    /// What was answered to the question for `place`; `None` where it was not asked.
    pub(super) fn answer(&self, place: Place) -> Option<Answer> {
        self.answers.iter().copied().find(|answer| answer.place == place)
    }

    /// Whether the unit gave a code that is listed for `family`.
    fn is_reported(&self, family: &Family) -> bool {
        let answer = family.code_place().and_then(|place| self.answer(place));
        answer.is_some_and(|answer| answer.word().is_some_and(|word| family.is_own(answer.place, word)))
    }

    /// The places that were answered by a word.
    pub(super) fn answered(&self) -> impl Iterator<Item = Place> {
        self.answers.iter().filter(|answer| answer.word().is_some()).map(|answer| answer.place)
    }
}

/// What `answer` alone says of `family`.
fn says(family: &Family, answer: Answer) -> Says {
    let place = answer.place;
    let word = match answer.said {
        Said::Word(word) => word,
        Said::Refused(code) => {
            // In the words of another maker.
            let is_foreign = family.never_says(code) && !SPECIFIED.contains(&code.0);
            let lacks = family.answers(place) && family.lacks_place(place, code);
            return if is_foreign || lacks { Says::Against } else { Says::Nothing };
        }
    };
    if family.refuses(place) {
        return Says::Against;
    }
    if family.state_place() == Some(place) && !family.knows_state(word) {
        let is_printed = family.profile().state_reason().is_none();
        return if is_printed { Says::Against } else { Says::AgainstUnlessReported };
    }
    let is_code = family.rows(place, word).next().is_some();
    let has_code_there = family.code_place() == Some(place) || !family.has(place);
    if is_code && has_code_there && !family.is_own(place, word) { Says::Against } else { Says::Nothing }
}

/// How well the word at `place` tells `one` from `other`, either of which may be the unit; 0 not at all.
///
/// | the one | the other is printed to refuse it | the other has nothing there |
/// | --- | --- | --- |
/// | is printed to answer | 4 | 2 |
/// | has something there | 3 | 1 |
pub(super) fn told_apart(one: &Family, other: &Family, place: Place) -> u8 {
    let by = |has: &Family, lacks: &Family| {
        let (is_refused, is_missing) = (lacks.refuses(place), !lacks.has(place));
        match (has.answers(place), has.has(place)) {
            (true, _) if is_refused => 4,
            (false, true) if is_refused => 3,
            (true, _) if is_missing => 2,
            (false, true) if is_missing => 1,
            _ => 0,
        }
    };
    by(one, other).max(by(other, one))
}

/// Whether what a unit of `named` most likely says to the question for `place` speaks against `other`.
pub(super) fn rules_out(named: &Family, other: &Family, place: Place) -> bool {
    if named.answers(place) {
        return other.refuses(place);
    }
    other.answers(place) && (named.refuses(place) || !named.has(place))
}
