use std::collections::HashSet;

use drivebus_drives::{Identification, Profile};
use proptest::prelude::*;

use super::*;
use crate::aim::QUESTIONS;
use crate::answer::Said;
use crate::family::HALTS;
use drivebus_rtu::huanyang::Protocol;

const STOP: What = What::Command(Command::Stop);

fn shipped(name: &str) -> Arc<Family> {
    Families::shipped().iter().find(|family| family.name() == name).cloned().unwrap()
}

/// Asks `unit` until there is a verdict; where it puts that off, `None`.
fn asked(apart: &mut Apart, what: What, mut unit: impl FnMut(Place) -> Said) -> Option<Verdict> {
    for _ in 0..=QUESTIONS {
        match apart.verdict(what) {
            Verdict::Ask(place) => {
                assert_eq!(apart.answer(place), None, "{place} was asked before");
                if !apart.heard(Answer { place, said: unit(place) }) {
                    return None;
                }
            }
            verdict => return Some(verdict),
        }
    }
    panic!("more than {QUESTIONS} questions")
}

#[test]
fn no_unit_is_given_up_while_a_question_is_left() {
    let words: HashSet<Place> =
        Families::shipped().iter().flat_map(|family| family.telling().iter().copied()).collect();
    assert!(words.len() < QUESTIONS, "{} words tell the shipped families", words.len());
}

/// A unit that has `words`, besides them what the profile of `family` prints, and of all else says that it has no such
/// address.
fn like(family: &Arc<Family>, words: &[(u16, u16)]) -> impl FnMut(Place) -> Said {
    move |place| match words.iter().find(|(address, _)| Place::from(*address) == place) {
        Some(&(_, word)) => Said::Word(word),
        None if family.has(place) && !family.refuses(place) => Said::Word(0),
        None => Answer::refusal_of(place, 0x02).said,
    }
}

/// What a unit named as a `named` is taken for, before a stop, or what it may be.
fn taken(named: &str, unit: impl FnMut(Place) -> Said) -> Result<String, Vec<String>> {
    let mut apart = Apart::new(&shipped(named), Families::shipped(), false);
    match asked(&mut apart, STOP, unit).unwrap() {
        Verdict::Take(family) => Ok(family.name().to_owned()),
        Verdict::Undecided(families) => Err(families.iter().map(|family| family.name().to_owned()).collect()),
        Verdict::Ask(_) => unreachable!(),
    }
}

/// GD350 manual, section 9.4.5: 2103H has 01A0H, and 2100H is 3 where it is stopped. GD35 manual: 0108H.
#[test]
fn a_code_says_what_a_unit_is() {
    let (gd350, gd35) = (shipped("gd350"), shipped("gd35"));
    for named in ["gd350", "gd35", "ms300", "v20"] {
        assert_eq!(taken(named, like(&gd350, &[(0x2103, 0x01A0), (0x2100, 3)])), Ok("gd350".to_owned()));
        assert_eq!(taken(named, like(&gd35, &[(0x2103, 0x0108), (0x2100, 3)])), Ok("gd35".to_owned()));
    }
}

/// ATV312 communication variables: 3201 (ETA) is 0231H where it is ready, and there is nothing at 2103H, 1900H and 3000H.
#[test]
fn a_unit_without_a_code_is_told_by_what_it_answers_and_refuses() {
    let atv312 = shipped("atv312");
    for named in ["atv312", "gd350", "ms300"] {
        assert_eq!(taken(named, like(&atv312, &[(0x0C81, 0x0231)])), Ok("atv312".to_owned()));
    }
}

/// E510 communication addendum, pp. 1-13 to 1-18: 05-00 to 05-48 are there, of which its profile has the first. A Nowforever has its
/// state and its output frequency among them.
#[test]
fn a_unit_with_more_words_than_its_profile_lists_is_told_all_the_same() {
    let e510 = shipped("e510");
    for (named, is_trusted) in [("gd350", false), ("gd350", true), ("nowforever", false), ("acs355", false)] {
        let mut apart = Apart::new(&shipped(named), Families::shipped(), is_trusted);
        let verdict = asked(&mut apart, STOP, like(&e510, &[(0x0500, 0), (0x0502, 0), (0x2520, 4)]));
        assert!(matches!(&verdict, Some(Verdict::Take(family)) if family.name() == "e510"), "{named}: {verdict:?}");
    }
}

/// A unit that refuses all says nothing; who says that its name is meant, is believed.
#[test]
fn trust_decides_where_nothing_is_shown() {
    let silent = |place| Answer::refusal_of(place, 0x02).said;
    assert!(taken("vfd500", silent).is_err());
    let mut apart = Apart::new(&shipped("vfd500"), Families::shipped(), true);
    let verdict = asked(&mut apart, STOP, silent);
    assert!(matches!(verdict, Some(Verdict::Take(family)) if family.name() == "vfd500"));
}

/// GD35 manual: 0108H. A GD350 has 01A0H there, and others have no code at all.
#[test]
fn a_code_of_another_family_speaks_against_the_name() {
    let mut apart = Apart::new(&shipped("gd350"), Families::shipped(), false);
    apart.heard(Answer::word_at(0x2103, 0x0108));
    assert!(apart.is_live(&shipped("gd35")));
    assert!(!apart.is_live(&shipped("gd350")));
    assert!(!apart.is_live(&shipped("gd300")));
}

/// MS300 manual: its output frequency is at 2103H, and may be just that word. 0005H at 2000H is none of its halts.
#[test]
fn a_code_that_a_rival_may_have_as_a_value_is_not_enough() {
    let mut apart = Apart::new(&shipped("gd350"), Families::shipped(), false);
    apart.heard(Answer::word_at(0x2103, 0x01A0));
    assert!(apart.shows_named());
    let Verdict::Ask(place) = apart.verdict(STOP) else { panic!("a rival was not asked for") };
    apart.heard(Answer::refusal_of(place, 0x02));
    assert!(!matches!(apart.verdict(STOP), Verdict::Take(family) if family.name() == "gd350"));
}

/// A VFD500 has no word that ends a jog: that such a word harms nobody is no reason to take a unit for one.
#[test]
fn a_command_that_there_is_no_word_of_proves_nothing() {
    let mut apart = Apart::new(&shipped("vfd500"), Families::shipped(), false);
    apart.heard(Answer::refusal_of(0x1234, 0x02));
    assert!(matches!(apart.verdict(What::Command(Command::JogStop)), Verdict::Ask(_)));
}

#[test]
fn a_unit_that_is_busy_says_nothing_of_what_it_is() {
    let mut apart = Apart::new(&shipped("gd350"), Families::shipped(), false);
    for code in [0x06, 0x0A, 0x0B] {
        assert!(!apart.heard(Answer::refusal_of(0x2103, code)));
    }
    assert!(!apart.is_asked());
    // INVT's drives say by 09H that a password locks them.
    assert!(apart.heard(Answer::refusal_of(0x2103, 0x09)));
    assert!(apart.is_asked());
}

/// A profile of somebody's own that has the name of a shipped one is the one that is meant.
#[test]
fn a_name_is_that_of_the_profile_that_was_given() {
    let own = Arc::new(Profile::clone(shipped("gd350").profile()));
    let mut apart = Apart::new(&Families::shipped().family(&own), Families::shipped(), false);
    assert_eq!(apart.families.len(), Families::shipped().speaking(Protocol::Modbus).count());
    let verdict = asked(&mut apart, STOP, like(&shipped("gd350"), &[(0x2103, 0x01A0), (0x2100, 3)]));
    assert!(matches!(verdict, Some(Verdict::Take(family)) if Arc::ptr_eq(family.profile(), &own)));
}

fn any_family() -> impl Strategy<Value = Arc<Family>> {
    let families: Vec<_> = Families::shipped().iter().cloned().collect();
    proptest::sample::select(families)
}

fn any_place() -> impl Strategy<Value = Place> {
    let telling = Families::shipped().iter().flat_map(|family| family.telling().to_vec()).collect::<Vec<_>>();
    prop_oneof![proptest::sample::select(telling), any::<u16>().prop_map(Place::from)]
}

fn any_code() -> impl Strategy<Value = u16> {
    proptest::sample::select(Families::shipped().codes().all().collect::<Vec<_>>())
}

fn anything() -> impl Strategy<Value = Said> {
    let code = prop_oneof![Just(0x02), proptest::sample::select(vec![1, 2, 3, 4, 9]), any::<u8>()];
    let word = prop_oneof![any_code(), 0_u16..40, any::<u16>()];
    prop_oneof![code.prop_map(|code| Answer::refusal_of(0, code).said), word.prop_map(Said::Word)]
}

fn any_what() -> impl Strategy<Value = What> {
    let command = proptest::sample::select(Command::ALL.to_vec()).prop_map(What::Command);
    prop_oneof![3 => command, 1 => any_place().prop_map(What::Word)]
}

/// Whether documents rule out that a unit of `family` said this: it refuses the place, or the word is a code of others
/// where it has its own.
fn is_ruled_out(family: &Family, answer: Answer) -> bool {
    let Some(word) = answer.word() else { return false };
    let refuses = family.signature().is_some_and(|signature| signature.refuses.contains(&answer.place));
    let reports = |row: &Identification| {
        let names = family.profile().reports_as();
        names.contains(&row.family) || row.shared.iter().any(|name| names.contains(name))
    };
    let rows: Vec<_> = family.rows(answer.place, word).collect();
    let is_foreign = family.code_place() == Some(answer.place) && !rows.is_empty() && !rows.into_iter().any(reports);
    refuses || is_foreign
}

proptest! {
    #[test]
    fn asking_ends_whatever_is_answered(
        family in any_family(),
        is_trusted: bool,
        what in any_what(),
        said in proptest::collection::vec(anything(), QUESTIONS + 1),
    ) {
        let mut said = said.into_iter();
        let mut apart = Apart::new(&family, Families::shipped(), is_trusted);
        // More than that many questions panic there.
        asked(&mut apart, what, |_| said.next().unwrap());
    }

    #[test]
    fn nothing_is_taken_that_an_answer_rules_out(
        family in any_family(),
        what in any_what(),
        before in proptest::collection::vec((any_place(), anything()), 0..6),
        said in proptest::collection::vec(anything(), QUESTIONS + 1),
    ) {
        let mut apart = Apart::new(&family, Families::shipped(), false);
        for (place, said) in before {
            apart.heard(Answer { place, said });
        }
        let mut said = said.into_iter();
        if let Some(Verdict::Take(taken)) = asked(&mut apart, what, |_| said.next().unwrap()) {
            prop_assert!(!apart.answers.iter().any(|&answer| is_ruled_out(&taken, answer)), "{}", taken.name());
        }
    }

    /// A refusal says what a unit is not, or where a signature lists it what it may be.
    #[test]
    fn an_unlisted_refusal_shows_no_family(
        family in any_family(),
        heard in proptest::collection::vec((any_place(), anything()), 0..8),
        place in any_place(),
        code: u8,
    ) {
        let mut apart = Apart::new(&family, Families::shipped(), false);
        for (place, said) in heard {
            apart.heard(Answer { place, said });
        }
        let is_new = apart.answer(place).is_none();
        let shown: Vec<_> = apart.families.iter().map(|family| apart.is_shown(family)).collect();
        apart.heard(Answer::refusal_of(place, code));
        for (family, was_shown) in apart.families.iter().zip(shown) {
            let is_listed = family.signature().is_some_and(|signature| signature.refuses.contains(&place));
            prop_assert!(was_shown || is_listed || !is_new || !apart.is_shown(family), "{}", family.name());
        }
    }

    /// A unit that has a code or a signature, has what its profile prints, and refuses all else, is never halted by a word
    /// that harms it. Of a family with neither a unit says too little.
    #[test]
    fn a_unit_like_its_profile_takes_no_harm(
        unit in any_family(),
        named in any_family(),
        command in proptest::sample::select(HALTS.to_vec()),
        words in proptest::collection::vec(any::<u16>(), QUESTIONS + 1),
        states in proptest::collection::vec(0_u16..8, QUESTIONS + 1),
    ) {
        prop_assume!(named.command(command).is_some());
        prop_assume!(unit.is_listed() || unit.signature().is_some());
        let reported = Families::shipped().codes().all().find(|&code| {
            unit.code_place().is_some_and(|place| unit.is_own(place, code))
        });
        let mut next = words.into_iter().zip(states);
        let mut apart = Apart::new(&named, Families::shipped(), false);
        let verdict = asked(&mut apart, What::Command(command), |place| {
            let (word, state) = next.next().unwrap();
            match reported.filter(|_| unit.code_place() == Some(place)) {
                Some(code) => Said::Word(code),
                None if unit.refuses(place) || !unit.has(place) => Answer::refusal_of(place, 0x02).said,
                // A state that its profile does not print would speak against it.
                None if unit.state_place() == Some(place) => {
                    let mut states = [state, word].into_iter().chain(0..=0xFF);
                    Said::Word(states.find(|&each| unit.knows_state(each)).unwrap())
                }
                None => Said::Word(word),
            }
        });
        if let Some(Verdict::Take(taken)) = verdict {
            let sent = if is_same(&taken, &named) { Some(command) } else { taken.halt_for(command) };
            let harms = sent.is_some_and(|sent| unit.is_harmed_by(What::Command(sent), &taken));
            prop_assert!(!harms, "a {} named {} is taken for a {}", unit.name(), named.name(), taken.name());
        }
    }
}
