use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::harm::What;
use crate::scripted::{self, Fault, Reply, Script, UNIT, any_family, any_reply, fails, like, refuses, shipped};
use crate::task::{Cause, Write};
use drivebus_rtu::huanyang::Protocol;

/// A unit that was named as one of a family, and its line.
struct Named {
    same: SameUnit,
    script: Script,
}

impl Named {
    fn of(family: &str) -> Self {
        Self::as_one(&shipped(family), false)
    }

    fn as_one(family: &Arc<Family>, is_trusted: bool) -> Self {
        Self { same: SameUnit::new(UNIT, family, &Identity::new(0), is_trusted), script: Script::new() }
    }

    fn check(&mut self, is_judged: bool, unit: impl FnMut(Read) -> Reply) -> Result<u64, NotSame<Fault>> {
        let same = self.same.clone();
        self.script
            .carry_out(unit, |line| async move { same.check(&line, Families::shipped(), is_judged, false).await })
    }

    fn contradiction(&mut self, unit: impl FnMut(Read) -> Reply) -> Result<Option<Contradiction>, Fault> {
        let same = self.same.clone();
        self.script.carry_out(unit, |line| async move { same.contradiction(&line, Families::shipped(), true).await })
    }

    fn is_known(&self) -> bool {
        self.same.identity().is_known(self.script.connection)
    }

    fn is_sure(&self) -> bool {
        self.same.identity().is_sure(self.script.connection)
    }

    fn opened_again(&mut self) {
        self.script.connection += 1;
    }
}

/// GD350 manual, section 9.4.5: 01A0H at 2103H.
fn gd350(read: Read) -> Reply {
    like(&shipped("gd350"), &[(0x2103, 0x01A0), (0x2100, 3)])(read)
}

/// GD35 manual: 0108H.
fn gd35(read: Read) -> Reply {
    like(&shipped("gd35"), &[(0x2103, 0x0108), (0x2100, 3)])(read)
}

#[test]
fn it_is_asked_once_for_each_connection() {
    let mut named = Named::of("gd350");
    assert!(!named.is_known());
    assert_eq!(named.check(true, gd350).unwrap(), 0);
    assert_eq!(named.script.places(), [0x2103]);
    assert!(named.is_known() && named.is_sure());
    assert_eq!(named.check(true, gd350).unwrap(), 0);
    assert_eq!(named.script.asked, []);

    named.opened_again();
    assert!(!named.is_known() && !named.is_sure());
    assert_eq!(named.check(true, gd350).unwrap(), 1);
    assert_eq!(named.script.places(), [0x2103]);
    assert!(named.is_known() && named.is_sure());
}

/// A VFD500 until its second question, and then a GD350 behind a port that was opened again.
struct Exchanged {
    asked: u64,
}

impl scripted::Unit for Exchanged {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        self.asked += 1;
        if self.asked > 1 { gd350(read) } else { like(&shipped("vfd500"), &[])(read) }
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        panic!("nobody expects {write}")
    }

    fn reopened(&self) -> u64 {
        (self.asked > 1).into()
    }
}

#[test]
fn what_two_drives_answered_in_turns_is_asked_anew() {
    let same = Named::of("vfd500").same;
    let mut script = Script::new();
    let against = script.carry_out(Exchanged { asked: 0 }, |line| async move {
        same.contradiction(&line, Families::shipped(), true).await
    });
    assert!(against.unwrap().is_some());
    let places = script.places();
    assert!(places[1..].contains(&places[0]), "{places:X?}");
}

#[test]
fn another_one_is_not_written_to() {
    let mut named = Named::of("gd350");
    named.check(true, gd350).unwrap();
    named.opened_again();
    let error = named.check(true, gd35).unwrap_err();
    let NotSame::Another { before, now } = &error else { panic!("{error}") };
    assert_eq!((before.to_string(), now.to_string()), ("01A0H".to_owned(), "0108H".to_owned()));
    // What it was stays known, and the next call asks again.
    assert!(named.check(true, gd35).is_err());
    assert_eq!(named.check(true, gd350).unwrap(), 1);
}

#[test]
fn what_does_not_say_what_it_is_any_more_is_not_written_to() {
    let mut named = Named::of("gd350");
    named.check(true, gd350).unwrap();
    named.opened_again();
    for cause in [Cause::NoAnswer, Cause::BadAnswer, Cause::Port] {
        let error = named.check(true, |_| fails(cause)).unwrap_err();
        assert!(matches!(error, NotSame::Unsaid(error) if error.cause == cause));
    }
    assert!(matches!(named.check(true, |_| fails(Cause::Other)), Err(NotSame::Failed(_))));
    let error = named.check(true, |_| refuses(0x09)).unwrap_err();
    assert!(matches!(&error, NotSame::PutOff(told) if told.to_string() == "refused with exception 09H"), "{error}");
}

/// Nobody knows it, so that silence speaks against nothing; it is asked the next time.
#[test]
fn one_that_was_never_heard_may_be_silent() {
    let mut named = Named::of("gd350");
    assert_eq!(named.check(true, |_| fails(Cause::NoAnswer)).unwrap(), 0);
    assert!(!named.is_known());
    assert_eq!(named.check(true, |_| refuses(0x06)).unwrap(), 0);
    assert_eq!((named.script.places(), named.is_known()), (vec![0x2103], false));
}

#[test]
fn what_speaks_against_its_name_is_told_where_it_is_judged() {
    let mut named = Named::of("gd350");
    assert_eq!(named.check(false, gd35).unwrap(), 0);
    assert!(!named.is_known());
    let error = named.check(true, gd35).unwrap_err();
    assert!(matches!(&error, NotSame::Contradicts(Contradiction::Code { word: 0x0108, .. })), "{error}");
    // It is asked each time, for it may have been put right.
    assert_eq!(named.check(true, gd350).unwrap(), 0);
    assert!(named.is_sure());

    let mut trusted = Named::as_one(&shipped("gd350"), true);
    assert_eq!(trusted.check(true, gd35).unwrap(), 0);
    assert!(!trusted.is_sure());
}

/// VFD500 manual V1.02: no 2103H. MS300 manual: 2104H and 2106H, and no 3000H.
#[test]
fn the_signature_of_another_family_speaks_against_a_name() {
    let mut named = Named::of("gd600");
    let unit = |read: Read| like(&shipped("vfd500"), &[])(read);
    let error = named.check(false, unit).unwrap_err();
    let NotSame::Contradicts(Contradiction::Signature(families)) = &error else { panic!("{error}") };
    assert_eq!(families.iter().map(|family| family.name()).collect::<Vec<_>>(), ["vfd500"]);
    assert!(error.to_string().contains("VFD500"), "{error}");
    assert!(named.script.asked.iter().all(|read| !read.is_urgent));
    assert!(named.contradiction(unit).unwrap().is_some());
    assert!(named.script.asked.iter().all(|read| read.is_urgent));
    // Under its own name nothing does.
    let mut named = Named::of("vfd500");
    assert!(named.contradiction(unit).unwrap().is_none());
    assert!(named.is_known() && named.is_sure());
}

#[test]
fn one_that_refuses_all_is_known_by_that_and_no_more() {
    let mut named = Named::of("gd350");
    named.same = SameUnit::new(UNIT, &shipped("gd350"), &Identity::new(0), true);
    assert_eq!(named.check(true, |_| refuses(0x02)).unwrap(), 0);
    assert!(!named.is_known() && !named.is_sure());
    named.opened_again();
    assert!(matches!(named.check(true, gd350), Err(NotSame::Another { .. })));
}

#[test]
fn a_code_that_it_gave_before_counts() {
    let named = Named::of("gd350");
    named.same.gave(0x01A0, named.script.now);
    assert!(named.is_known() && named.is_sure());
    let mut another = Named::of("gd350");
    another.same.gave(0x0199, another.script.now);
    assert!(another.is_known() && !another.is_sure());
    assert_eq!(another.check(true, gd350).unwrap(), 0);
    assert_eq!(another.script.asked, []);
}

/// All handles of a unit have one memory of it.
#[test]
fn what_is_known_is_shared() {
    let mut named = Named::of("gd350");
    let other = SameUnit::new(UNIT, named.same.family(), named.same.identity(), false);
    named.check(true, gd350).unwrap();
    assert!(other.identity().is_sure(0));
    other.identity().is_another();
    assert!(!named.is_sure() && !named.is_known());
}

#[test]
fn what_was_said_is_old_after_ten_seconds() {
    let identity = Identity::new(0);
    let at = |seconds| Instant::ZERO + Duration::from_secs(seconds);
    assert!(identity.is_old(at(0)));
    identity.settle(0, at(5));
    assert!(!identity.is_old(at(15)));
    assert!(identity.is_old(at(15) + Duration::from_nanos(1)));
    identity.settle(1, at(20));
    assert!(identity.is_old(at(20)), "another connection settles nothing");
}

#[test]
fn what_is_harmless_is_so_over_one_connection() {
    let identity = Identity::new(2);
    let place = Place::from(0x2000);
    identity.found_harmless(place, 1);
    assert!(!identity.is_harmless(place, 2));
    identity.found_harmless(place, 2);
    assert!(identity.is_harmless(place, 2) && !identity.is_harmless(place, 3));
    assert!(!identity.is_harmless(Place::from(0x2001), 2));
    identity.is_another();
    assert!(!identity.is_harmless(place, 2));
}

/// Of two families with one name, one answer alone is compared wherever it was asked for.
#[test]
fn what_was_told_is_compared_as_it_is_shown() {
    let answers = [Answer::word_at(0x2103, 7), Answer::refusal_of(0x2100, 2), Answer::word_at(0x2103, 8)];
    assert_eq!(Told::of(&answers, |_, word| word == 8).to_string(), "2103H 0008H, 2100H refused with exception 02H");
    assert_eq!(Told::of(&answers[..1], |_, _| false).to_string(), "answered");
    assert_eq!(Told::of(&answers[..1], |_, _| true), Told::of_code(7));
    assert_eq!(Told::of(&[], |_, _| true).to_string(), "");
}

proptest! {
    /// Whatever comes, a check ends, and what is sure is known and not sent to who contradicts.
    #[test]
    fn it_ends(
        family in any_family(),
        is_trusted: bool,
        replies in proptest::collection::vec(any_reply(), 1..60),
        calls in proptest::collection::vec((any::<bool>(), any::<bool>(), any::<bool>()), 1..6),
    ) {
        let mut replies = replies.iter().cycle();
        let mut named = Named::as_one(&family, is_trusted);
        for (is_check, is_judged, is_opened) in calls {
            if is_opened {
                named.opened_again();
            }
            let unit = |_| replies.next().unwrap().clone();
            if is_check {
                let connection = named.script.connection;
                let is_same = named.check(is_judged, unit);
                prop_assert!(is_same.is_err() || is_same.is_ok_and(|told| told == connection));
            } else if let Ok(against) = named.contradiction(unit) {
                prop_assert!(against.is_none() || !named.is_known());
            }
            prop_assert!(named.script.asked.len() <= 200);
            prop_assert!(named.is_known() || !named.is_sure());
            let at_once = crate::goes_out_at_once(&named.same, Families::shipped(), What::Word(0x2000.into()), u64::MAX);
            // What is said in another protocol harms nobody of Modbus.
            let is_modbus = family.protocol() == Protocol::Modbus;
            prop_assert!(is_trusted || !is_modbus || !at_once, "over another connection nothing is known");
        }
    }
}
