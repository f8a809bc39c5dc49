use std::sync::Arc;

use drivebus_drives::{AccessError, Place, State, ValueError};

use super::*;
use crate::family::Family;
use crate::record::Record;
use crate::same_unit::NotSame;
use crate::scripted::{Bench, Fault, Script, call, fails, refuses, shipped};
use crate::settled::NotSettled;
use crate::task::{Cause, Notice};
use crate::writing::NotWritten;

mod any;
mod stored;

/// What a Goodrive350 says of itself, and of its motor: that it stands.
const GD350: [(u16, u16); 2] = [(0x2103, 0x01A0), (0x2100, 3)];

/// And a Goodrive200A.
const GD200A: [(u16, u16); 2] = [(0x2103, 0x0107), (0x2100, 3)];

type Wanted = [(&'static str, Input<'static>)];

impl Bench {
    fn write(&mut self, wanted: &'static Wanted, store: Store) -> Result<(), NotKept<Fault>> {
        let unit = self.call();
        self.write_by(unit, wanted, store)
    }

    fn write_by(&mut self, unit: Unit, wanted: &'static Wanted, store: Store) -> Result<(), NotKept<Fault>> {
        let families = Families::shipped();
        let work = |line| async move { unit.write_values(&line, families, wanted, store).await };
        self.script.carry_out_with(&mut self.keeper, work)
    }

    fn why(&mut self, wanted: &'static Wanted, store: Store) -> Why<Fault> {
        *self.write(wanted, store).unwrap_err().why
    }

    fn not_planned(&mut self, wanted: &'static Wanted, store: Store) -> WhyNotPlanned {
        let Why::NotPlanned(NotPlanned { why, .. }) = self.why(wanted, store) else { panic!("it was planned") };
        assert_eq!(self.script.sent, []);
        *why
    }

    fn notices(&self) -> Vec<&Notice> {
        self.script.told.iter().filter(|notice| matches!(notice, Notice::Stored { .. })).collect()
    }
}

/// GD350 operation manual, section 9.4.5: bit 15 of the address writes to RAM alone, 000BH is P00.11, which counts tenths.
#[test]
fn an_invt_keeps_in_eeprom_what_goes_to_its_plain_address() {
    let mut bench = Bench::of("gd350", &GD350);
    bench.write(&[("P00.11", Input::Float(5.0))], Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x800B, vec![50])]);
    // Bit 15 writes, and cannot be read.
    assert_eq!(bench.script.sent[0].1.read_back, Some(0x000B));
    assert!(bench.record.is_in_ram("P00.11"));
    bench.script.sent.clear();
    bench.write(&[("acceleration_time_1", Input::Float(6.0))], Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), [(0x000B, vec![60])]);
    assert!(!bench.record.is_in_ram("P00.11"));
    assert_eq!(bench.record.stores("P00.11"), 1);
}

/// VFD500 manual (manualslib 1986548), p. 134: 40.00 Hz is 0FA0H; 0007H goes to RAM, 8007H is kept.
#[test]
fn a_vfd500_keeps_in_eeprom_what_has_bit_15() {
    for (store, place) in [(Store::Ram, 0x0007), (Store::Eeprom, 0x8007)] {
        let mut bench = Bench::of("vfd500", &[]).trusting();
        bench.write(&[("P00.07", Input::Text("40.00"))], store).unwrap();
        assert_eq!(bench.script.written(), [(place, vec![0x0FA0])]);
        assert_eq!(bench.script.sent[0].1.read_back, Some(0x0007));
    }
}

/// GD350 operation manual, section 9.4.8: P00.11 and P00.12 by one 10H.
#[test]
fn successive_parameters_share_a_request_where_that_is_printed() {
    let mut bench = Bench::of("gd350", &GD350);
    bench.write(&[("P00.11", Input::Float(5.0)), ("P00.12", Input::Float(7.0))], Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x800B, vec![50, 70])]);
    bench.script.sent.clear();
    bench.write(&[("P00.12", Input::Float(7.0)), ("P00.11", Input::Float(5.0))], Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x800C, vec![70]), (0x800B, vec![50])]);
}

/// No GD20 page at hand prints that one 10H may write several parameters.
#[test]
fn where_nothing_is_printed_of_it_each_goes_by_its_own() {
    let mut bench = Bench::of("gd20", &[]).trusting();
    assert!(bench.family.profile().requests().joined.is_none());
    bench.write(&[("P00.11", Input::Float(5.0)), ("P00.12", Input::Float(7.0))], Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x800B, vec![50]), (0x800C, vec![70])]);
}

/// What sets the line or says who commands is written alone, and so is what a drive takes only at rest: GD200A manual, p. 92.
#[test]
fn what_decides_more_than_itself_shares_no_request() {
    let mut bench = Bench::of("gd200a", &[&GD200A, &[(3, 5000), (4, 5000), (5, 0)][..]].concat());
    bench.write(&[("P14.03", Input::Integer(6)), ("P14.04", Input::Float(1.0))], Store::Ram).unwrap();
    bench.write(&[("P00.01", Input::Integer(2)), ("P00.02", Input::Integer(0))], Store::Ram).unwrap();
    bench.write(&[("P00.04", Input::Float(50.0)), ("P00.05", Input::Float(1.0))], Store::Ram).unwrap();
    assert!(bench.script.sent.iter().all(|(_, write)| crate::scripted::words_of(write).len() == 1));
    assert_eq!(bench.script.sent.len(), 6);
}

#[test]
fn what_eeprom_has_is_not_written_again() {
    let mut bench = Bench::of("gd350", &[&GD350, &[(0x000B, 50), (0x000C, 40)][..]].concat());
    let both = &[("P00.11", Input::Float(5.0)), ("P00.12", Input::Float(5.0))];
    bench.write(both, Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), [(0x000C, vec![50])]);
    assert_eq!((bench.record.stores("P00.11"), bench.record.stores("P00.12")), (0, 1));
    bench.script.sent.clear();
    bench.write(both, Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), []);
}

/// What is read is what is in force. Out of RAM it says nothing of EEPROM, neither before the write nor behind it.
#[test]
fn what_was_written_to_ram_is_stored_although_it_is_in_force() {
    let mut bench = Bench::of("gd350", &GD350);
    let wanted = &[("P00.11", Input::Float(5.0))];
    bench.write(wanted, Store::Ram).unwrap();
    bench.write(wanted, Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), [(0x800B, vec![50]), (0x000B, vec![50])]);
    assert_eq!(bench.script.sent[1].1.read_back, None);
    bench.script.sent.clear();
    bench.write(wanted, Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), []);
}

#[test]
fn a_write_to_ram_whose_answer_is_lost_may_have_been_taken() {
    let mut bench = Bench::of("gd350", &[&GD350, &[(0x000B, 50)][..]].concat());
    bench.keeper.confirms = [fails(Cause::NoAnswer)].into();
    let error = bench.write(&[("P00.11", Input::Float(5.0))], Store::Ram).unwrap_err();
    assert!(error.why.was_sent());
    assert_eq!(error.why.cause(), Cause::NoAnswer);
    assert!(bench.record.is_in_ram("P00.11"));
}

#[test]
fn a_program_that_stores_in_a_loop_is_told() {
    let mut bench = Bench::of("gd350", &GD350);
    for round in 1..=6 {
        bench.keeper.words.insert(Place::from(0x000B), 0);
        bench.write(&[("acceleration_time_1", Input::Float(5.0))], Store::Eeprom).unwrap();
        assert_eq!(bench.notices().len(), usize::from(round > 4) + usize::from(round > 5), "{round}");
    }
    assert_eq!(bench.notices()[0], &Notice::Stored { name: "P00.11".to_owned(), times: 5 });
}

/// P00.03 of a GD350 can be changed only at rest.
#[test]
fn what_can_be_written_only_at_rest_waits_for_it() {
    let mut bench = Bench::of("gd350", &[&GD350, &[(0x2100, 1)][..]].concat());
    let wanted = &[("P00.11", Input::Float(5.0)), ("P00.03", Input::Float(60.0))];
    let why = bench.why(wanted, Store::Ram);
    assert!(matches!(why, Why::Running { ref names, state: State::Forward } if *names == ["P00.03"]), "{why}");
    assert_eq!(bench.script.sent, []);
    assert!(bench.script.told.contains(&Notice::Shows(State::Forward)));
    bench.keeper.words.insert(Place::from(0x2100), 3);
    bench.write(wanted, Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x800B, vec![50]), (0x8003, vec![6000])]);
}

#[test]
fn what_the_profile_does_not_allow_is_not_asked_for() {
    let mut gd350 = Bench::of("gd350", &GD350);
    let mut why = |name, value, store| {
        let wanted: &'static Wanted = Box::leak(Box::new([(name, value)]));
        gd350.not_planned(wanted, store)
    };
    let one = Input::Integer(1);
    assert!(matches!(why("no_such_name", one, Store::Ram), WhyNotPlanned::Unknown(_)));
    assert_eq!(why("output_current", one, Store::Ram), WhyNotPlanned::ReadOnly);
    for command in ["control_command", "virtual_input", "special_control_word"] {
        assert_eq!(why(command, one, Store::Ram), WhyNotPlanned::Moves);
    }
    // Printed for a sister series only.
    assert!(matches!(why("P14.03", one, Store::Ram), WhyNotPlanned::MayNot(_)));
    // 0.0 to 3600.0 s.
    for value in [Input::Float(3600.1), Input::Float(-0.1), Input::Float(f64::NAN)] {
        assert!(matches!(why("P00.11", value, Store::Ram), WhyNotPlanned::Unfit(_)));
    }
    let finer = why("P00.11", Input::Float(0.05), Store::Ram);
    assert!(matches!(finer, WhyNotPlanned::Unfit(ValueError::SurplusDigits { .. })));
    // Coasting is one choice; the numbers are not printed.
    assert_eq!(why("P01.08", one, Store::Ram), WhyNotPlanned::NoRange(1));
    let register = why("pid_reference", Input::Float(1.0), Store::Eeprom);
    assert!(matches!(register, WhyNotPlanned::NoPlace(AccessError::NotStored { .. })));
    // The manual of the GD10 is not at hand, nor how it keeps its parameters.
    let mut gd10 = Bench::of("gd10", &[]);
    let unverified = gd10.not_planned(&[("P00.01", Input::Integer(2))], Store::Ram);
    assert!(matches!(unverified, WhyNotPlanned::MayNot(_) | WhyNotPlanned::MayNotKeep(_)), "{unverified}");
    // V20: each write counts as kept.
    let mut v20 = Bench::of("v20", &[]);
    assert_eq!(v20.not_planned(&[("P1120", Input::Float(1.0))], Store::Ram), WhyNotPlanned::OnlyStored);
}

/// One that is not allowed keeps all others back, in whatever order they stand.
#[test]
fn nothing_is_sent_where_one_of_several_is_not_allowed() {
    let mut bench = Bench::of("gd350", &GD350);
    bench.not_planned(&[("P00.11", Input::Float(5.0)), ("output_current", Input::Float(5.0))], Store::Ram);
    assert_eq!(bench.script.asked, []);
    bench.not_planned(&[("output_current", Input::Float(5.0)), ("P00.11", Input::Float(5.0))], Store::Ram);
}

/// Of parameters that shared a request, nobody knows which were taken before the drive refused it.
#[test]
fn a_shared_request_that_is_refused_says_what_is_in_force() {
    let mut bench = Bench::of("gd350", &[&GD350, &[(0x000B, 50), (0x000C, 40)][..]].concat());
    bench.keeper.confirms = [Ok(()), refuses(0x03)].into();
    let wanted = &[("pid_reference", Input::Float(1.0)), ("P00.11", Input::Float(9.0)), ("P00.12", Input::Float(9.0))];
    let NotKept { done, parts, why, .. } = bench.write(wanted, Store::Ram).unwrap_err();
    assert_eq!((done, parts), (vec!["pid_reference".to_owned()], 1));
    let Why::NotWritten { names, why: NotWritten::Failed(_), in_force: Some(InForce::Shown(held)) } = *why else {
        panic!("{why}")
    };
    assert_eq!(names, ["P00.11", "P00.12"]);
    assert_eq!(held.iter().map(ToString::to_string).collect::<Vec<_>>(), ["P00.11 = 5.0 s", "P00.12 = 4.0 s"]);
    // One alone that is refused kept what it had.
    bench.keeper.confirms = [refuses(0x03)].into();
    let why = bench.why(&[("P00.11", Input::Float(9.0))], Store::Ram);
    assert!(matches!(why, Why::NotWritten { in_force: None, .. }), "{why}");
}

/// GD350: P00.15 tunes the motor. A drive that says that it is busy may have begun.
#[test]
fn what_acts_when_it_is_written_is_sent_once() {
    let mut bench = Bench::of("gd350", &GD350).trusting();
    bench.keeper.confirms = [refuses(0x06)].into();
    bench.write(&[("P00.15", Input::Integer(2))], Store::Ram).unwrap_err();
    assert_eq!(bench.script.written(), [(0x800F, vec![2])]);
    assert_eq!(bench.script.sent[0].1.read_back, None);
}

/// 06H: busy, by the specification.
#[test]
fn what_a_busy_drive_did_not_take_is_sent_no_more_than_five_times() {
    let mut bench = Bench::of("gd350", &GD350);
    let wanted = &[("P00.11", Input::Float(5.0))];
    bench.write(wanted, Store::Ram).unwrap();
    bench.script.sent.clear();
    // It is in force out of RAM, so that nothing can be read of it.
    bench.keeper.confirms = vec![refuses(0x06); 9].into();
    bench.write(wanted, Store::Eeprom).unwrap_err();
    assert_eq!(bench.script.written(), vec![(0x000B, vec![50]); 5]);
    assert_eq!(bench.record.stores("P00.11"), 0);
    assert!(bench.record.is_in_ram("P00.11"));
}

/// 0180H: IMO SD1, and no Goodrive350.
#[test]
fn a_unit_that_contradicts_its_name_gets_nothing() {
    let mut bench = Bench::of("gd350", &[(0x2103, 0x0107), (0x2100, 3)]);
    let why = bench.why(&[("P00.11", Input::Float(5.0))], Store::Ram);
    assert_eq!(bench.script.sent, []);
    let Why::NotWritten { why, .. } = why else { panic!("{why}") };
    assert!(matches!(why, NotWritten::NotSame(NotSame::Contradicts(_)) | NotWritten::Harm(_)), "{why}");
}

/// VFD500: P30.14 says in what the registers of the bus count the frequency. It is no part of a call that counts in that.
#[test]
fn what_decides_is_written_by_itself() {
    let mut bench = Bench::of("vfd500", &[]).trusting();
    let why = bench.why(&[("speed_reference", Input::Float(1.0)), ("P30.14", Input::Integer(1))], Store::Ram);
    let Why::Decides { name, other } = why else { panic!("{why}") };
    assert_eq!((name.as_str(), other.as_str()), ("P30.14", "speed_reference"));
    assert_eq!((bench.script.asked.len(), bench.script.sent.len()), (0, 0));
    // By itself it is written.
    bench.write(&[("P30.14", Input::Integer(1))], Store::Ram).unwrap();
    assert_eq!(bench.script.written(), [(0x1E0E, vec![1])]);
}

/// A drive that was said to count in one unit is not made one that counts in another.
#[test]
fn what_was_said_of_a_drive_stands() {
    let mut bench = Bench::of("vfd500", &[]).trusting();
    let choices = bench.family.profile().variants()["speed_unit"].choices.clone();
    let profile = bench.family.profile().with_variants([("speed_unit", "Hz")]).unwrap();
    let unit = call(&bench.family, &bench.record, true).with_profile(&Arc::new(profile));
    for (name, choice) in choices {
        let wanted: &'static Wanted = Box::leak(Box::new([("P30.14", Input::Integer(choice.word.into()))]));
        let written = bench.write_by(unit.clone(), wanted, Store::Ram);
        if name == "Hz" {
            written.unwrap();
            continue;
        }
        let why = *written.unwrap_err().why;
        let Why::Unsays { name, variant, choice } = why else { panic!("{why}") };
        assert_eq!((name.as_str(), variant.as_str(), choice.as_str()), ("P30.14", "speed_unit", "Hz"));
    }
    assert_eq!(bench.script.sent.len(), 1);
}

/// VFD500 manual: with P30.14 = 1 the registers count hundredths of a hertz. Which word says so is asked of the drive.
#[test]
fn a_value_is_counted_as_the_drive_is_set() {
    let choices = shipped("vfd500").profile().variants()["speed_unit"].choices.clone();
    let mut bench = Bench::of("vfd500", &[(0x1E0E, choices["Hz"].word)]).trusting();
    bench.write(&[("speed_reference", Input::Float(12.34))], Store::Ram).unwrap();
    assert_eq!(bench.script.written().pop().unwrap().1, [1234]);
    bench.script.sent.clear();
    bench.keeper.words.insert(Place::from(0x1E0E), 9);
    let why = bench.why(&[("speed_reference", Input::Float(12.34))], Store::Ram);
    assert!(matches!(why, Why::NotSettled(NotSettled::Unknown { raw: 9, .. })), "{why}");
    assert_eq!(bench.script.sent, []);
}
