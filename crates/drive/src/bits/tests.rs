use drivebus_drives::Place;

use super::*;
use crate::command::WhyNotCommanded;
use crate::record::Record;
use crate::scripted::{Bench, Fault, call, fails, refuses};
use crate::task::{Cause, Link};

/// Of a Goodrive350: its code, its state, its virtual inputs and outputs, and its special control.
const CODE: u16 = 0x2103;
const STATE: u16 = 0x2100;
const INPUTS: u16 = 0x200A;
const OUTPUTS: u16 = 0x200B;
const SPECIAL: u16 = 0x2009;

type Given = [(&'static str, FieldInput<'static>)];

impl Bench {
    /// A GD350 at rest, with these words besides.
    fn gd350(words: &[(u16, u16)]) -> Self {
        Self::of("gd350", &[&[(CODE, 0x01A0), (STATE, 3)], words].concat())
    }

    fn set(&mut self, setpoint: Setpoint, given: &'static Given) -> Result<(), NotSetBits<Fault>> {
        self.set_so(setpoint, given, false)
    }

    fn set_so(&mut self, setpoint: Setpoint, given: &'static Given, is_forced: bool) -> Result<(), NotSetBits<Fault>> {
        let unit = self.call();
        let work = |line| async move { unit.set_bits(&line, Families::shipped(), setpoint, given, is_forced).await };
        self.script.carry_out_with(&mut self.keeper, work)
    }

    fn inputs(&mut self, given: &'static Given) -> Result<(), NotSetBits<Fault>> {
        self.set(Setpoint::VirtualInputs, given)
    }
}

const S1: &Given = &[("S1", FieldInput::Switch(true))];

/// GD350 operation manual, section 9.4.5: bit 0 of 200AH is S1, bit 1 is S2, bit 4 is HDIA.
#[test]
fn what_is_not_named_keeps_what_the_drive_says_it_has() {
    let mut bench = Bench::gd350(&[(INPUTS, 0x0202)]);
    bench
        .inputs(&[("S1", FieldInput::Switch(true)), ("S2", FieldInput::Label("off")), ("HDIA", FieldInput::Number(1))])
        .unwrap();
    assert_eq!(bench.script.written(), [(INPUTS.into(), vec![0x0211])]);
    let (_, write) = &bench.script.sent[0];
    // It may start a motor: the bus looks for no confirmation, and repeats nothing.
    assert_eq!((write.read_back, write.halts), (None, Some(0)));
}

#[test]
fn outputs_start_nothing_and_can_be_read_back() {
    // In fault, and over a bad link: none of that counts.
    let mut bench = Bench::gd350(&[(STATE, 4), (OUTPUTS, 0x0001)]);
    bench.script.link = Link { good: 0, asked: 10 };
    bench.set(Setpoint::VirtualOutputs, &[("RO1", FieldInput::Switch(true))]).unwrap();
    assert_eq!(bench.script.written(), [(OUTPUTS.into(), vec![0x0005])]);
    assert_eq!(bench.script.sent[0].1.read_back, Some(OUTPUTS));
    assert!(!bench.script.asked.iter().any(|read| read.place == Place::from(STATE)));
}

/// VFD500: 700AH can only be written.
#[test]
fn where_nothing_can_be_read_what_is_not_named_is_off() {
    let mut bench = Bench::of("vfd500", &[(0x700A, 0xFFFF)]).trusting();
    let field = bench.family.profile().find("virtual_output").unwrap().bits()[1].clone();
    let given: &'static Given = Box::leak(Box::new([("DO2", FieldInput::Switch(true))]));
    bench.set(Setpoint::VirtualOutputs, given).unwrap();
    assert_eq!((field.name(), bench.script.written()), ("DO2", vec![(0x700A, vec![field.mask()])]));
    assert_eq!(bench.script.sent[0].1.read_back, None);
}

/// The special control word chooses between motor 1 and motor 2 by bits 0 and 1: GD350 operation manual, section 9.4.5.
#[test]
fn a_field_takes_its_label_or_the_number_in_it() {
    for value in [FieldInput::Label("motor 2"), FieldInput::Number(2)] {
        let given: &'static Given = Box::leak(Box::new([("motor", value)]));
        let mut bench = Bench::gd350(&[(SPECIAL, 0)]);
        bench.set(Setpoint::SpecialControl, given).unwrap();
        assert_eq!(bench.script.written(), [(SPECIAL.into(), vec![1])]);
    }
}

#[test]
fn what_cannot_be_set_is_not_asked_for() {
    let mut bench = Bench::gd350(&[]);
    let why = bench.inputs(&[]).unwrap_err();
    assert!(matches!(why, NotSetBits::NothingNamed), "{why}");
    let why = bench.inputs(&[("S1", FieldInput::Switch(true)), ("S99", FieldInput::Switch(true))]).unwrap_err();
    assert!(matches!(why, NotSetBits::NoField { ref name, ref known } if name == "S99" && known[0] == "S1"), "{why}");
    for value in [FieldInput::Number(2), FieldInput::Number(-1), FieldInput::Number(65537), FieldInput::Label("On")] {
        let given: &'static Given = Box::leak(Box::new([("S1", value)]));
        let why = bench.inputs(given).unwrap_err();
        assert_eq!(why.to_string(), "S1 cannot be that; allowed is 0 = off, 1 = on");
    }
    let why = Bench::of("ms300", &[]).inputs(S1).unwrap_err();
    assert!(matches!(why, NotSetBits::NoRegister), "{why}");
    assert_eq!((bench.script.asked.len(), bench.script.sent.len()), (0, 0));
}

#[test]
fn what_may_start_a_motor_is_held_to_the_checks_of_a_start() {
    // 4 is a fault, 5 no voltage: section 9.4.5.
    for (state, in_fault) in [(4, true), (5, false)] {
        let mut bench = Bench::gd350(&[(STATE, state)]);
        match bench.inputs(S1) {
            Err(NotSetBits::NotReady(NotReady::InFault(_))) => assert!(in_fault),
            Err(NotSetBits::NotReady(NotReady::NoVoltage(_))) => assert!(!in_fault),
            other => panic!("{state}: {other:?}"),
        }
        assert_eq!(bench.script.sent, []);
    }
    // A family whose halts nobody proves.
    for family in Families::shipped().iter() {
        let unit = call(family, &Record::default(), false);
        let Some(register) = unit.register_of(Setpoint::VirtualInputs) else { continue };
        if unit.can_be_stopped::<Fault>().is_ok() || unit.rule().write(register).is_err() {
            continue;
        }
        let mut bench = Bench::of(family.name(), &[]);
        bench.inputs(S1).unwrap_err();
        assert_eq!((bench.script.asked.len(), bench.script.sent.len()), (0, 0));
    }
}

#[test]
fn over_a_bad_link_nothing_starts_unless_it_is_forced() {
    let mut bench = Bench::gd350(&[]);
    bench.script.link = Link { good: 5, asked: 10 };
    let why = bench.inputs(S1).unwrap_err();
    assert!(matches!(why, NotSetBits::NotReady(NotReady::BadLink { lost: 0, looks: 10, .. })), "{why}");
    assert_eq!(bench.script.sent, []);
    bench.set_so(Setpoint::VirtualInputs, S1, true).unwrap();
    assert_eq!(bench.script.sent.len(), 1);
}

#[test]
fn what_may_start_a_motor_is_sent_once() {
    for (came, is_refused) in [(fails(Cause::NoAnswer), false), (fails(Cause::BadAnswer), false), (refuses(0x06), true)]
    {
        let mut bench = Bench::gd350(&[]);
        bench.is_trusted = true;
        bench.keeper.confirms = [came].into();
        let NotSetBits::NotCommanded(error) = bench.inputs(S1).unwrap_err() else { panic!("it was set") };
        let NotCommanded { command: None, why, .. } = *error else { panic!("{error}") };
        assert_eq!(bench.script.sent.len(), 1);
        assert_eq!(matches!(why, WhyNotCommanded::Unanswered { .. }), !is_refused, "{why}");
        assert_eq!(why.may_have_acted(), !is_refused);
        assert!(bench.record.sent().started_unverified);
    }
}

/// Whoever halts it while it is looked at wins, as over a start.
#[test]
fn a_halt_wins_over_bits_that_may_start() {
    let mut bench = Bench::gd350(&[]);
    bench.script.halts = 3;
    bench.keeper.confirms = [fails(Cause::Halted)].into();
    let NotSetBits::NotCommanded(error) = bench.inputs(S1).unwrap_err() else { panic!("it was set") };
    let why = error.why;
    assert!(matches!(why, WhyNotCommanded::Halted(_)), "{why}");
    assert!(!why.may_have_acted());
    assert_eq!(bench.script.sent[0].1.halts, Some(3));
}

#[test]
fn one_that_contradicts_its_name_gets_no_bits() {
    for setpoint in [Setpoint::VirtualInputs, Setpoint::VirtualOutputs] {
        let name = if setpoint == Setpoint::VirtualInputs { "S1" } else { "RO1" };
        let given: &'static Given = Box::leak(Box::new([(name, FieldInput::Switch(true))]));
        let mut bench = Bench::of("gd350", &[(CODE, 0x0107), (STATE, 3)]);
        bench.set(setpoint, given).unwrap_err();
        assert_eq!(bench.script.sent, []);
    }
}
