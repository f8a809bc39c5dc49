use std::collections::BTreeSet;

use drivebus_drives::Place;
use drivebus_rtu::Instant;

use super::*;
use crate::scripted::{Script, UNIT, zeros_but};

fn builtin(name: &str) -> Arc<Profile> {
    Profile::builtin(name).unwrap()
}

/// The look at a unit that answers with these `words` by place, and the places that it was asked for.
fn looked(name: &str, is_trusted: bool, words: &[(u16, u16)]) -> (Look, BTreeSet<Place>) {
    let looks = Looks::new(&builtin(name), is_trusted);
    let mut script = Script::new();
    script.now = Instant::ZERO + Duration::from_secs(1);
    let look = script.carry_out(zeros_but(words), async move |line| looks.look(&line, UNIT, true).await);
    assert!(script.asked.iter().all(|read| read.is_urgent && read.is_stamped), "{:?}", script.asked);
    let asked = script.asked.iter().flat_map(|read| (read.place.address..).take(read.count.into())).map(Place::from);
    (look.unwrap(), asked.collect())
}

/// GD350 operation manual, section 9.4.5: 2100H is the state, 2101H has bits, 2102H the fault code.
#[test]
fn the_words_of_a_gd350() {
    let (look, asked) = looked("gd350", false, &[(0x2100, 1), (0x2101, 0x0001), (0x2102, 0)]);
    assert_eq!(asked, [0x2100, 0x2101, 0x2102].map(Place::from).into());
    assert_eq!((look.state, look.word, look.fault, look.is_tripped()), (State::Forward, Some(1), Some(0), false));
    assert_eq!(look.field("ready"), Some("ready"));
    assert_eq!(look.asked, Duration::from_secs(1));
    assert_eq!(look.to_string(), "forward");

    let (look, _) = looked("gd350", false, &[(0x2100, 4), (0x2102, 10)]);
    assert_eq!((look.state, look.fault, look.is_in_fault), (State::Fault, Some(10), true));
    assert_eq!(look.to_string(), "fault, fault 10");
    assert_eq!(look.fault_of(&builtin("gd350")).unwrap().code, 10);
}

/// The codes of a GD600's states are on no page, and its fault code is.
#[test]
fn what_no_document_prints_is_left_out_until_it_is_trusted() {
    let looks = Looks::new(&builtin("gd600"), false);
    assert!(matches!(looks.state(), Err(WhyNot::NotPrinted(_))));
    assert_eq!(Looks::new(&builtin("gd600"), true).state(), Ok(()));
    let (printed, _) = looked("gd600", false, &[]);
    assert_eq!((printed.state, printed.word), (State::Unknown, None));
    let (trusted, _) = looked("gd600", true, &[]);
    assert_eq!(trusted.word, Some(0));
}

/// In every family, trusted or not: what the look asks for may be read, and what it says is what the words say.
#[test]
fn a_look_shows_what_its_words_say() {
    for name in Profile::builtin_names() {
        let profile = builtin(name);
        for is_trusted in [false, true] {
            let looks = Looks::new(&profile, is_trusted);
            let (look, asked) = looked(name, is_trusted, &[]);
            assert_eq!(asked.is_empty(), looks.is_blind(), "{name}");
            assert_eq!(look.word.is_some(), looks.state().is_ok(), "{name}");
            assert_eq!(look.fault.is_some(), looks.fault().is_ok(), "{name}");
            assert!(look.state == look.word.map_or(State::Unknown, |word| profile.state(word)), "{name}");
        }
    }
}
