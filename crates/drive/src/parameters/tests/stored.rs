//! The word that stores all: BBV51701, p. 20. Bit 1 of CMI (8504, 2138H) stores what is set, and goes back to 0.

use super::*;
use crate::scripted::{Keeper, Reply};
use crate::task::{Read, Write};
use drivebus_rtu::Instant;

const CMI: u16 = 0x2138;
/// Ten times 5.0 s: ACC counts 0.1 s (9001, 2329H), and so does dEC.
const RAMPS: &Wanted = &[("ACC", Input::Float(5.0)), ("dEC", Input::Float(7.0))];
const WRITTEN: [(u32, u16); 2] = [(0x2329, 50), (0x232A, 70)];

/// An Altivar 312 that is through with storing after so many reads of CMI.
struct Stores {
    keeper: Keeper,
    after: u32,
}

impl crate::scripted::Unit for Stores {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        if read.place == Place::from(CMI) && self.keeper.words.get(&read.place) == Some(&2) {
            if self.after == 0 {
                self.keeper.words.insert(read.place, 0);
            }
            self.after = self.after.saturating_sub(1);
        }
        self.keeper.read(read, now)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        self.keeper.write(write, now)?;
        if write.place == Place::from(CMI) {
            self.keeper.words.insert(write.place, 2);
        }
        Ok(())
    }
}

struct Told {
    script: Script,
    unit: Stores,
    record: Record,
}

impl Told {
    fn new(words: &[(u16, u16)], after: u32) -> Self {
        let keeper = Keeper::new(&shipped("atv312"), words);
        Self { script: Script::new(), unit: Stores { keeper, after }, record: Record::default() }
    }

    fn write(&mut self, store: Store) -> Result<(), NotKept<Fault>> {
        let unit = call(&shipped("atv312"), &self.record, false);
        self.script.sent.clear();
        let work = |line| async move { unit.write_values(&line, Families::shipped(), RAMPS, store).await };
        self.script.carry_out_with(&mut self.unit, work)
    }

    fn words(&self) -> Vec<(u32, u16)> {
        self.script.written().into_iter().map(|(place, words)| (place, words[0])).collect()
    }

    fn why(&mut self) -> WhyNotStored<Fault> {
        let NotKept { done, why, .. } = self.write(Store::Eeprom).unwrap_err();
        assert_eq!(done, ["ACC", "dEC"], "they are set all the same");
        assert!(["ACC", "dEC"].iter().all(|code| self.record.is_in_ram(code) && self.record.stores(code) == 0));
        let Why::NotStored { register, why } = *why else { panic!("{why}") };
        assert_eq!(register, "extended_control_word");
        why
    }
}

#[test]
fn what_is_not_stored_stays_in_ram() {
    let mut told = Told::new(&[], 0);
    told.write(Store::Ram).unwrap();
    assert_eq!(told.words(), WRITTEN);
    assert!(told.record.is_in_ram("ACC") && told.record.is_in_ram("dEC"));
}

#[test]
fn all_is_stored_by_one_word_after_the_last_value() {
    let mut told = Told::new(&[], 3);
    told.write(Store::Eeprom).unwrap();
    assert_eq!(told.words(), [WRITTEN[0], WRITTEN[1], (CMI.into(), 2)]);
    assert_eq!((told.record.stores("ACC"), told.record.is_in_ram("ACC")), (1, false));
    // What is there is not stored again.
    told.write(Store::Eeprom).unwrap();
    assert_eq!(told.words(), []);
}

#[test]
fn what_was_set_in_ram_before_is_stored_by_the_word_alone() {
    let mut told = Told::new(&[], 0);
    told.write(Store::Ram).unwrap();
    told.write(Store::Eeprom).unwrap();
    assert_eq!(told.words(), [(CMI.into(), 2)]);
    assert!(!told.record.is_in_ram("ACC"));
}

/// Bit 9 makes a setpoint count 600/32767 Hz: 0002H would take it back while the motor runs.
#[test]
fn a_word_that_would_undo_another_bit_is_not_sent() {
    let mut told = Told::new(&[(CMI, 0x0200)], 0);
    let why = told.why();
    assert!(matches!(why, WhyNotStored::NotIdle { found: 0x0200, idle: 0, .. }), "{why}");
    assert!(!why.was_sent());
    assert_eq!(told.words(), WRITTEN);
}

#[test]
fn a_drive_that_is_not_through_in_time_is_not_said_to_have_stored() {
    let mut told = Told::new(&[], u32::MAX);
    let why = told.why();
    assert!(matches!(why, WhyNotStored::Late(2)), "{why}");
    assert!(why.was_sent());
}

#[test]
fn a_refused_word_stores_nothing() {
    let mut told = Told::new(&[], 0);
    told.unit.keeper.confirms = [Ok(()), Ok(()), refuses(0x03)].into();
    let why = told.why();
    assert!(matches!(why, WhyNotStored::NotWritten(NotWritten::Failed(_))), "{why}");
    // The next call stores what is there.
    told.write(Store::Eeprom).unwrap();
    assert_eq!(told.words(), [(CMI.into(), 2)]);
}

/// An ACS355 stores by parameter 1607: by its name nothing is stored unasked.
#[test]
fn what_stores_is_no_value() {
    let mut acs355 = Bench::of("acs355", &[]).trusting();
    for store in [Store::Ram, Store::Eeprom] {
        assert_eq!(acs355.not_planned(&[("1607", Input::Integer(1))], store), WhyNotPlanned::Stores);
    }
}
