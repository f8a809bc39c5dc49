//! Motors that run on a simulated line are halted, and proved to be: what goes out, and what every error says.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use drivebus::drives::{Command, Entry, Place, Setpoint};
use drivebus::sim::{Asked, Refusals, SimulatedDrive};
use drivebus::{Bus, CallOptions, Drive, Error, ErrorKind, Halting, Profile};

/// Families of four makers.
const FAMILIES: [&str; 5] = ["gd350", "vfd500", "ms300", "a1000", "wj200"];

struct Plant {
    bus: Bus,
    profile: Arc<Profile>,
}

impl Plant {
    /// A drive of that family whose motor runs.
    fn of(family: &str) -> Self {
        let bus = Bus::open(&format!("sim://{family}?clock=virtual&seed=1")).unwrap();
        let plant = Self { bus, profile: Profile::builtin(family).unwrap() };
        plant.run();
        plant
    }

    fn run(&self) {
        let (bus, profile) = (&self.bus, &self.profile);
        let place = |entry: &Entry| entry.place().unwrap();
        let speed = profile.role("setpoints.frequency").unwrap();
        let needs = &profile.setpoints()[&Setpoint::Frequency].needs;
        for setting in profile.control().iter().chain(needs) {
            let place = place(profile.find(&setting.code).unwrap());
            let _absent = self.simulated().set_parameter(place.address, setting.raw);
        }
        for _ in 0..3 {
            // Some want to be made ready before, by the words that come before a run.
            for step in [Command::Stop, Command::RunForward] {
                for (place, word) in [profile.command_first(step), profile.command(step)].into_iter().flatten() {
                    let _refused = self.write(place, word);
                }
                let _refused = self.write(place(speed), 1_000);
                bus.sleep(Duration::from_millis(200));
            }
        }
        bus.sleep(Duration::from_secs(30));
        assert_eq!(self.simulated().state(), "forward", "{}", profile.name());
        assert!(self.simulated().frequency() > 0.5, "{}", profile.name());
        self.simulated().take_writes();
    }

    /// Some families know no 06H.
    fn write(&self, place: Place, word: u16) -> Result<(), Error> {
        let needs_many = self.profile.functions().contains(&0x10) && !self.profile.functions().contains(&0x06);
        if needs_many { self.bus.write(1, place, [word]) } else { self.bus.write(1, place, word) }
    }

    fn simulated(&self) -> SimulatedDrive {
        self.bus.simulator().unwrap().drive(1).unwrap()
    }

    fn drive(&self) -> Drive {
        self.bus.drive(1, &self.profile).unwrap().unverified()
    }

    fn is_at_rest(&self) -> bool {
        self.bus.sleep(Duration::from_secs(60));
        self.simulated().frequency().abs() < 0.01 && self.simulated().state() != "forward"
    }
}

#[test]
fn a_motor_that_runs_is_halted_in_the_words_of_its_family() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        plant.drive().stop().unwrap();
        let written = plant.simulated().take_writes();
        assert_eq!(written.len(), 1, "{family}: {written:?}");
        assert!(plant.is_at_rest(), "{family}");

        let plant = Plant::of(family);
        match plant.drive().coast() {
            Ok(()) => assert!(plant.is_at_rest(), "{family}"),
            // A family may have no such command.
            Err(error) => {
                assert!(!plant.profile.commands().contains_key(&Command::Coast), "{family}: {error}");
                assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false));
            }
        }
    }
}

#[test]
fn what_the_drive_refuses_all_the_time_it_has_not_taken() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        plant.simulated().refuse(Refusals::new(0x04).of(Asked::Writes)).unwrap();
        let (drive, halting) = (plant.drive().trust_profile(), Halting::stop().within(Duration::from_secs(1)));
        let error = drive.halt(&halting).unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, false), "{family}: {error}");
        assert_eq!(plant.simulated().state(), "forward", "{family}");
        plant.simulated().refuse_no_more();
        drive.halt(&halting).unwrap();
        assert!(plant.is_at_rest(), "{family}");
    }
}

/// At this address nobody answers: the word goes out again and again, and nobody knows.
#[test]
fn a_silent_unit_may_have_taken_it() {
    let plant = Plant::of("gd350");
    let (drive, halting) =
        (plant.bus.drive(9, &plant.profile).unwrap(), Halting::stop().within(Duration::from_secs(1)));
    let error = drive.halt(&halting).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert!(error.to_string().starts_with("stop of unit 9 as INVT Goodrive350: it was sent "), "{error}");
    plant.bus.close();
    let error = drive.halt(&halting).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Port, false), "{error}");
}

/// EDS300 manual, p. 46: 5 runs one, and stops a GD350.
#[test]
fn a_unit_of_another_family_is_halted_as_what_it_is() {
    let plant = Plant::of("eds300");
    let gd350 = Profile::builtin("gd350").unwrap();
    plant.bus.drive(1, &gd350).unwrap().stop().unwrap();
    assert!(plant.is_at_rest());
    let (_, runs) = plant.profile.command(Command::RunForward).unwrap();
    assert!(plant.simulated().take_writes().iter().all(|write| write.value != runs));
}

#[test]
fn what_cannot_be_is_not_sent() {
    let plant = Plant::of("gd350");
    assert_eq!(plant.bus.drive(0, &plant.profile).unwrap_err().kind(), ErrorKind::NotAllowed);
    let long = Halting::stop().within(Duration::from_secs(3601));
    assert_eq!(plant.drive().halt(&long).unwrap_err().kind(), ErrorKind::NotAllowed);
    // Of the commands of a GD3000 only the one that runs it is printed.
    let gd3000 = Profile::builtin("gd3000").unwrap();
    let error = plant.bus.drive(1, &gd3000).unwrap().stop().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
    assert!(plant.simulated().take_writes().is_empty());
}

#[tokio::test]
async fn a_halt_is_a_future_too() {
    let plant = Plant::of("gd350");
    let drive = plant.drive().aio();
    drive.stop().await.unwrap();
    assert!(plant.is_at_rest());
    let bus = drive.bus();
    let unheard = bus.write_with(1, 0x2000, 1, CallOptions::new().halts(0)).await;
    assert!(unheard.is_err(), "a start that was decided on before it came");
}
