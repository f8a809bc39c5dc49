use drivebus_drives::Place;

use super::*;
use crate::parameters::WhyNotKept;
use crate::scripted::{Bench, Fault, Keeper, call, refuses, shipped};
use crate::writing::NotWritten;

impl Bench {
    /// A GD350 at rest, whose P00.01, P00.02 and P00.06 are these.
    fn gd350_set(set: [u16; 3]) -> Self {
        let [commands, bus, frequency] = set;
        // That 0 of P00.02 is Modbus is printed for sister series alone.
        Self::of("gd350", &[(0x2103, 0x01A0), (0x2100, 3), (1, commands), (2, bus), (6, frequency)]).trusting()
    }

    fn prepare(&mut self, setpoint: Setpoint, store: Store) -> Result<Vec<Setting>, NotPrepared<Fault>> {
        let unit = self.call();
        let work = |line| async move { unit.prepare(&line, Families::shipped(), setpoint, store).await };
        self.script.carry_out_with(&mut self.keeper, work)
    }
}

/// GD350 operation manual, section 9.4.5: P00.01 = 2, P00.06 = 8; the setpoint first, and who commands last.
#[test]
fn only_what_is_set_otherwise_is_written() {
    let mut bench = Bench::gd350_set([0, 0, 0]);
    let settings = bench.prepare(Setpoint::Frequency, Store::Ram).unwrap();
    assert!(settings.iter().all(Setting::is_right));
    let order: Vec<_> = settings.iter().map(|setting| setting.wanted.code.as_str()).collect();
    assert!(order.contains(&"P00.01") && order.contains(&"P00.06"));
    let place = |code: &str| bench.family.profile().find(code).unwrap().address().unwrap();
    let written: Vec<_> =
        order.iter().filter(|code| **code != "P00.02").map(|code| u32::from(place(code) | 0x8000)).collect();
    assert_eq!(bench.script.written().into_iter().map(|(at, _)| at).collect::<Vec<_>>(), written);
    assert!(bench.script.written().contains(&(0x8001, vec![2])) && bench.script.written().contains(&(0x8006, vec![8])));
    bench.script.sent.clear();
    bench.prepare(Setpoint::Frequency, Store::Ram).unwrap();
    assert_eq!(bench.script.sent, []);
}

/// What this record set in RAM is kept as well, although it is right.
#[test]
fn what_was_prepared_in_ram_is_stored_when_that_is_said() {
    let mut bench = Bench::gd350_set([0, 0, 8]);
    bench.prepare(Setpoint::Frequency, Store::Ram).unwrap();
    bench.script.sent.clear();
    bench.prepare(Setpoint::Frequency, Store::Eeprom).unwrap();
    assert_eq!(bench.script.written(), [(0x0001, vec![2])]);
    bench.script.sent.clear();
    bench.prepare(Setpoint::Frequency, Store::Eeprom).unwrap();
    assert_eq!(bench.script.sent, []);
}

/// The GD350 text names the Modbus choice of P09.00 without its number.
#[test]
fn a_value_that_is_not_printed_is_not_written() {
    let mut bench = Bench { is_trusted: false, ..Bench::gd350_set([2, 0, 8]) };
    let why = bench.prepare(Setpoint::Pid, Store::Ram).unwrap_err();
    assert!(matches!(&why, NotPrepared::MayNot { setting, .. } if setting.wanted.code == "P09.00"), "{why}");
    assert_eq!(bench.script.sent, []);
    // Where the drive has it already, nobody asks who prints it.
    bench.keeper.words.insert(Place::from(0x0900), 6);
    bench.prepare(Setpoint::Pid, Store::Ram).unwrap();
    assert_eq!(bench.script.sent, []);
    // And who trusts it writes it.
    let mut trusting = Bench::gd350_set([2, 0, 8]);
    trusting.prepare(Setpoint::Pid, Store::Ram).unwrap();
    assert_eq!(trusting.script.written(), [(0x8900, vec![6])]);
}

/// Altivar 312 communication variables manual, pp. 11 and 35: only a return to the factory settings takes LAC = 2 back.
#[test]
fn what_is_set_by_hand_is_left_to_who_writes_it() {
    for (lac, is_left) in [(0, true), (1, true), (2, false)] {
        let atv312 = shipped("atv312");
        let place = atv312.profile().find("LAC").unwrap().address().unwrap();
        let mut bench = Bench::of("atv312", &[(place, lac)]);
        let done = bench.prepare(Setpoint::Frequency, Store::Eeprom);
        if is_left {
            let why = done.unwrap_err();
            assert!(matches!(&why, NotPrepared::ByHand(setting) if setting.wanted.code == "LAC"), "{why}");
            assert_eq!(bench.script.sent, []);
        } else {
            done.unwrap();
            // Fr1 = 164, and bit 1 of CMI, which stores it (p. 20).
            assert_eq!(bench.script.written(), [(0x20DD, vec![164]), (0x2138, vec![2])]);
        }
    }
}

/// Altivar 312 communication variables manual, p. 20: with bit 9 of CMI, setpoints count otherwise. Bit 14 is about something else.
#[test]
fn of_a_word_with_other_bits_only_those_that_count_are_looked_at() {
    for (cmi, is_left) in [(0x0200, true), (0x4200, true), (0x4000, false), (0, false)] {
        let place = |name| shipped("atv312").profile().find(name).unwrap().address().unwrap();
        let words = [(place("LAC"), 2), (place("Fr1"), 164), (place("extended_control_word"), cmi)];
        let mut bench = Bench::of("atv312", &words);
        let done = bench.prepare(Setpoint::Frequency, Store::Eeprom);
        assert_eq!(bench.script.sent, []);
        match done {
            Err(NotPrepared::ByHand(setting)) if is_left => {
                let said = "extended_control_word is 1, and must be 0 (bit 9: setpoints count 0.1 Hz)";
                assert_eq!(setting.to_string(), said);
            }
            done => assert!(!is_left && done.is_ok(), "{cmi:04X}H: {done:?}"),
        }
    }
}

#[test]
fn a_drive_that_keeps_what_it_had_is_told_of() {
    let mut refusing = Bench::gd350_set([0, 0, 0]);
    refusing.keeper.confirms = [Ok(()), refuses(0x03)].into();
    let NotPrepared::NotKept(not_kept) = refusing.prepare(Setpoint::Frequency, Store::Ram).unwrap_err() else {
        panic!("it was prepared")
    };
    assert_eq!((not_kept.done.len(), not_kept.parts), (1, 1));
    assert!(matches!(*not_kept.why, WhyNotKept::NotWritten { why: NotWritten::Failed(_), .. }));
}

/// It confirms, and shows what it had.
#[test]
fn what_is_shown_afterwards_counts() {
    struct Stubborn(Keeper);

    impl crate::scripted::Unit for Stubborn {
        fn read(&mut self, read: crate::task::Read, now: drivebus_rtu::Instant) -> crate::scripted::Reply {
            self.0.read(read, now)
        }

        fn write(&mut self, _: &crate::task::Write, _: drivebus_rtu::Instant) -> Result<(), Fault> {
            Ok(())
        }
    }

    let Bench { mut script, record, family, keeper, .. } = Bench::gd350_set([0, 0, 8]);
    let unit = call(&family, &record, true);
    let work = |line| async move { unit.prepare(&line, Families::shipped(), Setpoint::Frequency, Store::Ram).await };
    let why = script.carry_out(Stubborn(keeper), work).unwrap_err();
    let NotPrepared::Unshown(settings) = why else { panic!("{why}") };
    let wrong: Vec<_> = settings.iter().filter(|setting| !setting.is_right()).collect();
    assert_eq!(wrong.iter().map(|setting| setting.wanted.code.as_str()).collect::<Vec<_>>(), ["P00.01"]);
}

#[test]
fn a_setpoint_that_the_family_has_not_is_not_prepared_for() {
    let mut bench = Bench::of("eds300", &[]);
    let why = bench.prepare(Setpoint::Torque, Store::Ram).unwrap_err();
    assert!(matches!(why, NotPrepared::NoSetpoint), "{why}");
    assert_eq!((bench.script.asked.len(), bench.script.sent.len()), (0, 0));
}
