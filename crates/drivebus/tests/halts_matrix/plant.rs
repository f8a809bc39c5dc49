//! A simulated drive whose motor runs as its own family runs it.

use std::sync::Arc;
use std::time::Duration;

use drivebus::drives::{Command, Entry, Place, Setpoint};
use drivebus::sim::{Options, SimulatedDrive, Simulator};
use drivebus::{Bus, Profile};

/// How long a motor is given to reach its speed, and later to come to rest. Ramps take up to ten seconds.
pub(crate) const LONG: Duration = Duration::from_secs(60);

/// A setpoint of some Hz in each family: what is slow soon stands.
const SLOW: u16 = 300;

/// What the motor does before it is told to halt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    AtRest,
    Forward,
    Reverse,
}

impl Motion {
    fn command(self) -> Option<Command> {
        match self {
            Self::AtRest => None,
            Self::Forward => Some(Command::RunForward),
            Self::Reverse => Some(Command::RunReverse),
        }
    }

    fn state(self) -> &'static str {
        match self {
            Self::AtRest => "stopped",
            Self::Forward => "forward",
            Self::Reverse => "reverse",
        }
    }
}

/// One drive on a line of its own, at address 1.
pub(crate) struct Plant {
    pub(crate) simulator: Simulator,
    pub(crate) profile: Arc<Profile>,
}

impl Plant {
    /// A drive of `family` that obeys the bus, and stands.
    pub(crate) fn of(family: &str) -> Self {
        let simulator = Simulator::new([(1, family)], Options::default().seed(1)).unwrap();
        let plant = Self { simulator, profile: Profile::builtin(family).unwrap() };
        for (address, word) in plant.obedience() {
            // Some are not simulated, or have one value only; a motor that does not run then is noticed.
            let _absent = plant.drive().set_parameter(address, word);
        }
        plant
    }

    /// One whose motor runs.
    pub(crate) fn running(family: &str) -> Self {
        let plant = Self::of(family);
        plant.put(Motion::Forward);
        plant
    }

    /// The parameters that let the bus command it, and say how fast.
    fn obedience(&self) -> Vec<(u16, u16)> {
        let needs = self.profile.setpoints().get(&Setpoint::Frequency).map_or(&[][..], |role| &role.needs);
        let settings = self.profile.control().iter().chain(needs);
        settings.map(|setting| (place(self.profile.find(&setting.code).unwrap()).address, setting.raw)).collect()
    }

    /// A bus to it that has heard nothing of it yet.
    pub(crate) fn bus(&self) -> Bus {
        let simulator = self.simulator.clone();
        Bus::builder().open_with(Box::new(move || Ok(Box::new(simulator.open_line()?)))).unwrap()
    }

    pub(crate) fn drive(&self) -> SimulatedDrive {
        self.simulator.drive(1).unwrap()
    }

    /// Whether its family can be told to do so.
    pub(crate) fn knows(&self, motion: Motion) -> bool {
        motion.command().is_none_or(|command| self.profile.command(command).is_some())
    }

    /// Sets it going in the words of its own family, and waits until it is up to speed.
    pub(crate) fn put(&self, motion: Motion) {
        let (drive, profile, bus) = (self.drive(), &self.profile, self.bus());
        // It is asked in the protocol that it speaks.
        bus.drive(1, profile).unwrap();
        if let Some(unlock) = profile.unlock() {
            self.write(&bus, (unlock.place, unlock.word));
        }
        if drive.state() != motion.state() {
            if let Some(stop) = profile.command(Command::Stop) {
                self.write(&bus, stop);
            }
            self.pass(LONG);
        }
        if let Some(run) = motion.command() {
            if let Some(speed) = profile.role("setpoints.frequency") {
                self.write(&bus, (place(speed), SLOW));
            }
            let (register, _) = profile.command(run).unwrap();
            let first = profile.start_sequence().iter().map(|step| (register, step.word));
            for word in first.chain(profile.command_first(run)).chain(profile.command(run)) {
                self.write(&bus, word);
            }
            self.pass(LONG);
            assert!(drive.frequency().abs() > 0.5, "{}: {} Hz", profile.name(), drive.frequency());
        }
        assert_eq!(drive.state(), motion.state(), "{}", profile.name());
        drive.take_writes();
    }

    /// Some families know no 06H.
    fn write(&self, bus: &Bus, (place, word): (Place, u16)) {
        let needs_many = self.profile.functions().contains(&0x10) && !self.profile.functions().contains(&0x06);
        if needs_many { bus.write(1, place, [word]) } else { bus.write(1, place, word) }.unwrap();
    }

    pub(crate) fn pass(&self, time: Duration) {
        self.simulator.advance(time).unwrap();
    }
}

fn place(entry: &Entry) -> Place {
    entry.place().unwrap()
}
