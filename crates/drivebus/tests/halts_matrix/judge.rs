//! Who says what a halt did to a motor: its shaft at each frame on the wire and afterwards, and the words that it took.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus::drives::{Command, Place, Profile, Table};
use drivebus::rtu::Table as Written;
use drivebus::sim::{Side, SimulatedDrive, WriteRecord};
use drivebus::{Bus, Error, ErrorKind, Instant};

use super::NOT_COMMANDED;
use super::plant::{LONG, Plant};

/// They have no motor and no commands; the simulated ones take the stop of their maker.
const RECTIFIERS: [&str; 2] = ["gd600-rectifier", "gd3000-rectifier"];
const INVT_STOP: (Place, u16) = (Place::new(Table::Holding, 0x2000), 5);

/// What rounding may add to a speed, in Hz.
const NOTHING: f64 = 1e-6;

/// A shaft at one moment.
#[derive(Debug, Clone, Copy)]
struct Shaft {
    state: &'static str,
    hz: f64,
}

impl Shaft {
    fn of(drive: &SimulatedDrive) -> Self {
        Self { state: drive.state(), hz: drive.frequency() }
    }

    /// What is wrong with that it goes on from here to `later`.
    fn wrong(self, later: Self) -> Option<String> {
        let is_allowed = later.state == self.state || later.state == "stopped";
        let is_slower = later.hz * self.hz >= 0.0 && later.hz.abs() <= self.hz.abs() + NOTHING;
        (!is_allowed || !is_slower).then(|| format!("the motor went from {self:?} to {later:?}"))
    }

    fn turns(self) -> bool {
        self.state != "stopped" || self.hz.abs() > NOTHING
    }
}

/// A motor that is watched from now on.
pub(crate) struct Judge<'p> {
    plant: &'p Plant,
    began: Shaft,
    since: Instant,
    eeprom: u64,
    /// The worst that it did at any frame.
    seen: Arc<Mutex<Option<String>>>,
}

impl<'p> Judge<'p> {
    /// Watches the motor of `plant` at each frame that goes over `bus`.
    pub(crate) fn over(plant: &'p Plant, bus: &Bus) -> Self {
        let (drive, seen) = (plant.drive(), Arc::new(Mutex::new(None)));
        drive.take_writes();
        let (began, found) = (Shaft::of(&drive), Arc::clone(&seen));
        let eeprom = drive.eeprom_writes();
        bus.watch(Some(Arc::new(move |_| {
            if let Some(wrong) = began.wrong(Shaft::of(&drive)) {
                found.lock().unwrap().get_or_insert(wrong);
            }
        })));
        Self { plant, began, since: plant.simulator.now(), eeprom, seen }
    }

    /// Whatever is wrong, now that the halt has ended with `came`.
    pub(crate) fn verdict(&self, came: &Result<(), Error>) -> Vec<String> {
        let mut wrong: Vec<String> = self.seen.lock().unwrap().take().into_iter().collect();
        let drive = self.plant.drive();
        let taken: Vec<_> = drive.take_writes().iter().map(|word| (place(word), word.value)).collect();
        let mut own = own_halts(&self.plant.profile);
        // A drive that is locked takes no halt before.
        own.extend(self.plant.profile.unlock().map(|unlock| (unlock.place, unlock.word)));
        let foreign: Vec<_> = taken.iter().filter(|word| !own.contains(word)).collect();
        if !foreign.is_empty() {
            wrong.push(format!("it took {foreign:04X?}"));
        }
        if drive.eeprom_writes() != self.eeprom {
            wrong.push("its EEPROM was written".to_owned());
        }
        wrong.extend(self.unlisted());
        let at_end = Shaft::of(&drive);
        wrong.extend(self.began.wrong(at_end));
        self.plant.pass(Duration::from_millis(300));
        let soon = Shaft::of(&drive);
        wrong.extend(at_end.wrong(soon));
        self.plant.pass(LONG);
        let later = Shaft::of(&drive);
        wrong.extend(soon.wrong(later));
        match came {
            Ok(()) if at_end.turns() && soon.hz.abs() >= at_end.hz.abs() => {
                wrong.push(format!("it was halted, and does not slow down: {at_end:?}"));
            }
            Ok(()) if later.turns() => wrong.push(format!("it was halted, and still turns: {later:?}")),
            Ok(()) => {}
            Err(error) => {
                if !error.may_have_acted() && !taken.is_empty() {
                    wrong.push(format!("it took something, which {error:?} does not say"));
                }
                if error.kind() == ErrorKind::NotAllowed && !taken.is_empty() {
                    wrong.push("something was sent, and was not allowed".to_owned());
                }
                if self.began.turns() && !later.turns() && !error.may_have_acted() {
                    wrong.push("it was halted, which nobody says".to_owned());
                }
            }
        }
        wrong
    }

    /// What was written where a drive of that family may have a parameter without a row: that the simulated one refuses it
    /// proves nothing. Not asked of those without commands: whichever groups they have, no answer tells them.
    fn unlisted(&self) -> Option<String> {
        let profile = &self.plant.profile;
        if NOT_COMMANDED.contains(&profile.name()) {
            return None;
        }
        let may_keep = |frame: &[u8]| {
            let &[_, 0x06 | 0x10, high, low, ..] = frame else { return None };
            let address = u16::from_be_bytes([high, low]);
            let plain = profile.stored_address(address).unwrap_or(address);
            let is_in_group = profile.unlisted_groups().any(|group| group == plain.to_be_bytes()[0]);
            (is_in_group && profile.entry_at(plain).is_none()).then_some(address)
        };
        let trace = self.plant.simulator.wire().trace();
        let mut said = trace.iter().filter(|each| each.side == Side::Master && each.begin >= self.since);
        let kept = said.find_map(|each| may_keep(&each.bytes))?;
        Some(format!("{kept:04X}H was written, where it may have a parameter"))
    }
}

/// The words by which units of that family halt, each with its place.
pub(crate) fn own_halts(profile: &Profile) -> BTreeSet<(Place, u16)> {
    if RECTIFIERS.contains(&profile.name()) {
        return BTreeSet::from([INVT_STOP]);
    }
    let halts = [Command::Stop, Command::Coast, Command::JogStop].into_iter();
    halts.flat_map(|halt| profile.command_first(halt).into_iter().chain(profile.command(halt))).collect()
}

fn place(word: &WriteRecord) -> Place {
    let table = match word.table {
        Written::Coil => Table::Coil,
        _ => Table::Holding,
    };
    Place::new(table, word.address)
}
