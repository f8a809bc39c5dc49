//! Each shipped family named as each other one, and told to halt: no motor is started, reversed or sped up by that, none of
//! its parameters is changed, and it is halted as what it is.
//!
//! As `tests/python/matrix.py`, for programs in Rust. `plant` sets a motor going, `judge` looks at it, and `ends` and
//! `exchange` have what goes wrong on the way.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod ends;
mod exchange;
mod judge;
mod plant;

use drivebus::drives::Command;
use drivebus::{Bus, Error, ErrorKind, Halting, Profile, aio};

use judge::Judge;
use plant::{Motion, Plant};

/// No document prints a command of these.
const NOT_COMMANDED: [&str; 3] = ["gd600-rectifier", "gd3000-rectifier", "chv100"];

/// What is told to a unit.
#[derive(Debug, Clone, Copy)]
struct Told<'n> {
    named: &'n str,
    command: Command,
    is_trusted: bool,
}

impl Told<'_> {
    fn halting(self) -> Halting {
        if self.command == Command::Coast { Halting::coast() } else { Halting::stop() }
    }

    /// Halts the unit over `bus`.
    fn halt(self, bus: &Bus) -> Result<(), Error> {
        let drive = bus.drive(1, &Profile::builtin(self.named).unwrap()).unwrap().unverified();
        let drive = if self.is_trusted { drive.trust_profile() } else { drive };
        drive.halt(&self.halting())
    }

    /// The same, awaited.
    fn halt_awaited(self, bus: Bus) -> Result<(), Error> {
        let bus = aio::Bus::from(bus);
        let drive = bus.drive(1, &Profile::builtin(self.named).unwrap()).unwrap().unverified();
        let drive = if self.is_trusted { drive.trust_profile() } else { drive };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(drive.halt(&self.halting()))
    }

    /// Whatever is wrong with how `plant`, which is in `motion`, is halted by that over a bus of its own.
    fn wrong(self, plant: &Plant, motion: Motion, is_awaited: bool) -> Vec<String> {
        let bus = plant.bus();
        let judge = Judge::over(plant, &bus);
        let came = if is_awaited { self.halt_awaited(bus) } else { self.halt(&bus) };
        let mut wrong = judge.verdict(&came);
        wrong.extend(self.unexpected(plant, &came));
        let told = |each| format!("a {} {motion:?}, {self:?}, {came:?}: {each}", plant.profile.name());
        wrong.into_iter().map(told).collect()
    }

    /// Whoever has commands at all says what it is, so that it is halted, if only its name has such a command.
    fn unexpected(self, plant: &Plant, came: &Result<(), Error>) -> Option<String> {
        let is_known = Profile::builtin(self.named).unwrap().command(self.command).is_some();
        // A name of another protocol halts nothing: the unit hears none of it. That must be told.
        let speaks = |profile: &Profile| profile.requests().protocol;
        if speaks(&plant.profile) != speaks(&Profile::builtin(self.named).unwrap()) {
            return came.is_ok().then(|| "a unit of another protocol was taken for halted".to_owned());
        }
        match came {
            Ok(()) => (!is_known).then(|| "nobody knows such a command".to_owned()),
            Err(error) if !is_known => {
                (error.kind() != ErrorKind::NotAllowed).then(|| "the command is not known".to_owned())
            }
            Err(_) if NOT_COMMANDED.contains(&plant.profile.name()) => None,
            Err(_) => Some("it was not halted".to_owned()),
        }
    }
}

/// A unit of `family` by every name: turning it is stopped and coasts, and now and then it stands, is awaited, or its name is
/// said to be meant.
fn by_every_name(family: &str) -> Vec<String> {
    let plant = Plant::of(family);
    let names: Vec<_> = Profile::builtin_names().collect();
    let own = names.iter().position(|name| *name == family).unwrap();
    let mut wrong = Vec::new();
    for (number, named) in names.into_iter().enumerate() {
        let turns = if number % 2 == 0 && plant.knows(Motion::Reverse) { Motion::Reverse } else { Motion::Forward };
        let motion = if plant.knows(turns) { turns } else { Motion::AtRest };
        let kind = (number + own) % 5;
        for command in [Command::Stop, Command::Coast] {
            let told = Told { named, command, is_trusted: false };
            let mut tried = |told: Told<'_>, motion, is_awaited| {
                plant.put(motion);
                wrong.extend(told.wrong(&plant, motion, is_awaited));
            };
            tried(told, motion, kind == 0);
            match kind {
                1 => tried(Told { is_trusted: true, ..told }, motion, false),
                2 => tried(told, Motion::AtRest, false),
                _ => {}
            }
        }
    }
    wrong
}

/// Every fourth family, from that one on: the parts run side by side.
fn part(first: usize) {
    let wrong: Vec<_> = Profile::builtin_names().skip(first).step_by(4).flat_map(by_every_name).collect();
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong[..wrong.len().min(20)].join("\n"));
}

#[test]
fn no_halt_starts_reverses_or_sets_anything() {
    part(0);
}

#[test]
fn nor_in_the_second_part_of_the_families() {
    part(1);
}

#[test]
fn nor_in_the_third() {
    part(2);
}

#[test]
fn nor_in_the_fourth() {
    part(3);
}
