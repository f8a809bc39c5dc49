//! One simulated drive that is set to obey the bus, and a program's handle to it.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus::drives::{Command, Setpoint};
use drivebus::sim::{Options, Side, SimulatedDrive, Simulator};
use drivebus::{Bus, Drive, Profile};

use super::tapped;

/// What is done when a frame of the master is about to go out.
type Tap = Box<dyn FnMut(&[u8]) + Send>;

pub(crate) struct Plant {
    pub(crate) bus: Bus,
    pub(crate) profile: Arc<Profile>,
    pub(crate) simulator: Simulator,
    /// What the program uses, also by what no document proves: the simulator is no proof of a family either.
    pub(crate) drive: Drive,
    tap: Arc<Mutex<Option<Tap>>>,
}

impl Plant {
    /// A drive as it comes, which obeys its keypad.
    pub(crate) fn as_it_comes(family: &str) -> Self {
        let simulator = Simulator::new([(1, family)], Options::default().seed(1)).unwrap();
        let tap: Arc<Mutex<Option<Tap>>> = Arc::default();
        let tapped = Arc::clone(&tap);
        let bus = tapped::open(&simulator, move |frame| {
            // What it does may look at the line, and be shown nothing of that.
            let taken = tapped.lock().unwrap().take();
            if let Some(mut tap) = taken {
                tap(frame);
                tapped.lock().unwrap().get_or_insert(tap);
            }
        });
        let profile = Profile::builtin(family).unwrap();
        let drive = bus.drive(1, &profile).unwrap().unverified();
        Self { bus, profile, simulator, drive, tap }
    }

    /// A drive that obeys the bus, and takes its frequency from there.
    pub(crate) fn of(family: &str) -> Self {
        let plant = Self::as_it_comes(family);
        let needs = &plant.profile.setpoints()[&Setpoint::Frequency].needs;
        for setting in plant.profile.control().iter().chain(needs) {
            let place = plant.profile.find(&setting.code).unwrap().place().unwrap();
            // A simulated drive may lack what no document prints.
            let _absent = plant.simulated().set_parameter(place.address, setting.raw);
        }
        plant
    }

    /// Shows each frame to `tap` before it goes out, from now on.
    pub(crate) fn tap(&self, tap: impl FnMut(&[u8]) + Send + 'static) {
        *self.tap.lock().unwrap() = Some(Box::new(tap));
    }

    pub(crate) fn simulated(&self) -> SimulatedDrive {
        self.simulator.drive(1).unwrap()
    }

    /// Whether the motor turns this way at so many hertz when it had the time to get there.
    pub(crate) fn turns(&self, state: &str, hz: f64) -> bool {
        self.bus.sleep(Duration::from_secs(60));
        let (is, turns) = (self.simulated().state(), self.simulated().frequency());
        is == state && (turns.abs() - hz).abs() < 0.1
    }

    /// Whether the motor stands when it had the time to.
    pub(crate) fn stands(&self) -> bool {
        self.turns("stopped", 0.0)
    }

    /// Whether `frame` carries this command, by itself or with a word behind it.
    pub(crate) fn commands(&self, command: Command, frame: &[u8]) -> bool {
        let (place, word) = self.profile.command(command).unwrap();
        let at = if frame[1] == 0x10 { 7 } else { 4 };
        let [high, low] = word.to_be_bytes();
        [0x06, 0x10].contains(&frame[1])
            && frame.len() >= at + 2
            && frame[2..4] == place.address.to_be_bytes()
            && frame[at..at + 2] == [high, low]
    }

    /// Frames of the master that carry this command, of those that are remembered.
    pub(crate) fn sent(&self, command: Command) -> usize {
        let frames = self.simulator.wire().trace();
        frames.iter().filter(|one| one.side == Side::Master && self.commands(command, &one.bytes)).count()
    }
}
