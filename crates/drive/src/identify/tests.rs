use drivebus_rtu::{ExceptionCode, Meaning};
use proptest::prelude::*;

use super::*;
use crate::scripted::{Fault, Reply, Script, UNIT, any_reply, fails, like, refuses, shipped};
use crate::task::Cause;

/// Where units keep their codes.
const CODE: u32 = 0x2103;

fn found(script: &mut Script, unit: impl FnMut(Read) -> Reply) -> Result<Identification, NotTold<Fault>> {
    script.carry_out(unit, |line| async move { identify(&line, Families::shipped(), UNIT).await })
}

fn of(unit: impl FnMut(Read) -> Reply) -> Identification {
    found(&mut Script::new(), unit).unwrap()
}

/// GD350 manual, section 9.4.5 and p. 329.
#[test]
fn a_printed_code_says_what_a_unit_is() {
    let mut script = Script::new();
    let found = found(&mut script, like(&shipped("gd350"), &[(0x2103, 0x01A0), (0x2100, 3)])).unwrap();
    assert_eq!((found.family(), found.certainty, found.code), (Some("gd350"), Certainty::Certain, Some(0x01A0)));
    assert_eq!(script.places(), [CODE, 0x2100]);
    let read = script.asked[0];
    assert_eq!((read.count, read.is_urgent, read.timeout, read.retries), (1, false, None, None));
    let told = found.to_string();
    assert!(told.starts_with("unit 5: Goodrive350 "), "{told}");
    assert!(told.contains("(certain: it reports 01A0H at 2103H, printed in "), "{told}");
}

/// GD300L manual, p. 130; GD310-UL, p. 211.
#[test]
fn a_code_of_several_is_shared() {
    let found = of(like(&shipped("gd300"), &[(0x2103, 0x010A), (0x2100, 3)]));
    assert_eq!((found.certainty, found.candidates.len(), found.family()), (Certainty::Shared, 3, None));
    assert_eq!(found.usable(Families::shipped(), false).unwrap().name(), "gd300");
    assert!(found.to_string().contains("gd300, Goodrive300L lift drive and Goodrive310-UL"), "{found}");
}

/// IMO SD1 manual, p. 137: there is no profile of it.
#[test]
fn a_family_without_a_profile_is_a_candidate() {
    let found = of(|read| if read.place.number() == CODE { Ok(0x0180) } else { refuses(0x02) });
    assert_eq!((found.family(), found.certainty), (Some("sd1"), Certainty::Certain));
    assert!(found.usable(Families::shipped(), true).is_none());
}

/// A Delta VFD-F has its output frequency at 2103H (manual, p. 5-58), in 0.01 Hz: at 4.16 Hz that is 01A0H.
#[test]
fn who_is_in_no_state_of_such_a_drive_is_not_surely_one() {
    for (state, is_sure) in [
        (Ok(3), true),
        (Ok(0), false),
        (refuses(0x02), false),
        (refuses(0x09), true),
        (refuses(0x06), true),
        (fails(Cause::NoAnswer), true),
        (fails(Cause::BadAnswer), true),
    ] {
        let found = of(|read| if read.place.number() == CODE { Ok(0x01A0) } else { state.clone() });
        assert_eq!(found.certainty == Certainty::Certain, is_sure, "{state:?}");
        assert_eq!(found.certainty == Certainty::Unverified, !is_sure, "{state:?}");
        let Reason::Code { against, alone, .. } = &found.reason else { panic!("{found}") };
        assert_eq!((against.is_none(), *alone), (is_sure, Certainty::Certain), "{state:?}");
        assert_eq!(found.to_string().contains("but it"), !is_sure, "{found}");
    }
    let lost =
        found(&mut Script::new(), |read| if read.place.number() == CODE { Ok(0x01A0) } else { fails(Cause::Port) });
    assert!(matches!(lost, Err(NotTold::Failed(error)) if error.cause == Cause::Port));
}

/// VFD500 manual V1.02: 1900H and 1E0EH are there. It has no code.
#[test]
fn one_without_a_code_is_told_by_what_it_answers_and_refuses() {
    let mut script = Script::new();
    let found = found(&mut script, like(&shipped("vfd500"), &[])).unwrap();
    assert_eq!((found.certainty, found.family(), found.code), (Certainty::ByAnswers, Some("vfd500"), None));
    let seen = [(0x1900, true), (0x1E0E, true), (0x2103, false)].map(|(place, yes)| (Place::from(place), yes));
    assert_eq!(found.reason, Reason::Answers(seen.to_vec()));
    assert_eq!(script.places()[..3], [CODE, 0x1900, 0x1E0E]);
    assert!(found.usable(Families::shipped(), false).is_none());
    assert_eq!(found.usable(Families::shipped(), true).unwrap().name(), "vfd500");
    assert!(found.to_string().ends_with(": 1900H answered, 1E0EH answered, 2103H refused)"), "{found}");
}

/// What answers the rest as a VFD500 and has a word at 2103H is none: those refuse it.
#[test]
fn a_code_that_nobody_knows_falls_to_no_other_family() {
    let found = of(like(&shipped("vfd500"), &[(0x2103, 0x0199)]));
    assert_eq!((found.certainty, found.code, found.candidates.len()), (Certainty::Unknown, Some(0x0199), 0));
    assert_eq!(
        found.to_string(),
        "unit 5: not known (unknown: it says 0199H at 2103H; what it answers fits no known family)"
    );
    let locked = of(|_| refuses(0x09));
    assert!(locked.to_string().contains("2103H (exception 09H: a user password may lock it)"), "{locked}");
}

#[test]
fn who_is_silent_is_asked_no_more() {
    for cause in [Cause::NoAnswer, Cause::BadAnswer, Cause::Port, Cause::Other] {
        let mut script = Script::new();
        assert!(matches!(found(&mut script, |_| fails(cause)), Err(NotTold::Failed(error)) if error.cause == cause));
        assert_eq!(script.places(), [CODE]);
    }
}

/// *Modbus Application Protocol* V1.1b3, §7: 06H is busy; 0AH and 0BH are a gateway's.
#[test]
fn a_refusal_that_decides_nothing_is_asked_for_again() {
    let mut script = Script::new();
    let busy = found(&mut script, |_| refuses(0x06)).unwrap_err();
    assert!(
        matches!(&busy, NotTold::Busy { times: 5, code: ExceptionCode(6), last, .. } if last.cause == busy_cause())
    );
    assert_eq!((script.places(), busy.cause()), (vec![CODE; 5], Cause::BadAnswer));
    assert!(
        busy.to_string().contains("unit 5 is busy, or gets requests damaged: it refused 2103H with exception 06H 5")
    );

    for code in [0x0A, 0x0B] {
        let gone = found(&mut script, |_| refuses(code)).unwrap_err();
        assert!(matches!(gone, NotTold::Unreached { code: ExceptionCode(told), .. } if told == code));
        assert_eq!((script.places(), gone.cause()), (vec![CODE], Cause::NoAnswer));
    }

    // One that answers at last; and 01H, by which one family says that the request came damaged.
    for first in [0x06, 0x01] {
        let mut left = 4;
        let found = of(|read| {
            left -= i32::from(read.place.number() == CODE);
            if left >= 0 { refuses(first) } else { like(&shipped("gd350"), &[(0x2103, 0x01A0), (0x2100, 3)])(read) }
        });
        assert_eq!((found.family(), left), (Some("gd350"), -1));
    }
    let none = of(|_| refuses(0x01));
    assert_eq!(none.certainty, Certainty::Unknown);
}

fn busy_cause() -> Cause {
    Cause::Refused(ExceptionCode(6), Meaning::AskAgain)
}

/// A code that a document prints of each of several families with profiles is not enough; nor is one that none prints.
#[test]
fn a_code_is_as_sure_as_what_lists_it() {
    let row = |family: &str, verified: bool| {
        let mut row = shipped("gd35").profile().identifications()[0].clone();
        (row.code, row.family, row.title) = (0x010A, family.to_owned(), family.to_uppercase());
        (row.shared, row.verified, row.source) = (Vec::new(), verified, format!("of {family}"));
        row
    };
    let by = |rows: &[Row]| by_code(UNIT, Place::from(0x2103), 0x010A, rows);

    let shared = by(&[row("gd300", true), row("gd35", true), row("gd9000", true)]);
    assert_eq!((shared.certainty, shared.candidates.len()), (Certainty::Shared, 3));
    assert_eq!(shared.titles, ["GD300", "GD35", "GD9000"]);
    for is_unverified in [false, true] {
        assert!(shared.usable(Families::shipped(), is_unverified).is_none());
    }

    let thin = by(&[row("gd300", false)]);
    assert_eq!((thin.certainty, thin.family()), (Certainty::Unverified, Some("gd300")));
    assert!(thin.usable(Families::shipped(), false).is_none());
    assert!(thin.usable(Families::shipped(), true).is_some());
    assert!(thin.to_string().contains("which no document prints, only of gd300"), "{thin}");

    // What is printed counts, also behind what is not.
    let both = by(&[row("gd300", false), row("gd35", true)]);
    assert!(matches!(both.reason, Reason::Code { source, alone: Certainty::Shared, .. } if source == "of gd35"));
}

#[test]
fn each_certainty_has_its_name() {
    for certainty in Certainty::ALL {
        assert_eq!(Certainty::named(certainty.name()), Some(certainty));
    }
    assert_eq!(Certainty::named("perhaps"), None);
}

proptest! {
    /// Whatever comes, it ends: a code, a state, and each place of each signature, five times at most.
    #[test]
    fn it_ends(replies in proptest::collection::vec(any_reply(), 1..200)) {
        let mut replies = replies.iter().cycle();
        let mut script = Script::new();
        let found = found(&mut script, |_| replies.next().unwrap().clone());
        prop_assert!(script.asked.len() <= 5 * 30);
        if let Ok(found) = found {
            prop_assert_eq!(found.unit, UNIT);
            prop_assert_eq!(found.candidates.is_empty(), found.certainty == Certainty::Unknown);
            prop_assert!(!found.to_string().is_empty());
        }
    }
}
