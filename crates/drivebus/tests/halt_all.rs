//! Motors that run on one simulated line are halted side by side: who is told what, and what is said of who is not halted.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use drivebus::drives::{Command, Setpoint, Store};
use drivebus::sim::{Asked, Refusals, Side};
use drivebus::{Bus, Drive, Error, ErrorKind, Halting, Profile};

/// A line with these units, whose motors run.
struct Plant {
    bus: Bus,
    drives: Vec<Drive>,
}

impl Plant {
    fn of(families: &[&str]) -> Self {
        let units: Vec<_> = (1..).zip(families).map(|(unit, family): (u8, _)| format!("{unit}={family}")).collect();
        let bus = Bus::open(&format!("sim://{}?clock=virtual&seed=1", units.join(","))).unwrap();
        let drives: Vec<_> = (1..).zip(families).map(|(unit, family)| named(&bus, unit, family).unverified()).collect();
        for drive in &drives {
            drive.prepare_for(Setpoint::Frequency, Store::Eeprom).unwrap();
            drive.run(10.0).unwrap();
        }
        bus.sleep(Duration::from_secs(60));
        let plant = Self { bus, drives };
        for drive in &plant.drives {
            assert_eq!(plant.state(drive.unit()), "forward", "{}", drive.profile().name());
        }
        plant
    }

    fn state(&self, unit: u8) -> &'static str {
        self.bus.simulator().unwrap().drive(unit).unwrap().state()
    }

    /// Whether the motor of `unit` stands when it had the time to.
    fn stands(&self, unit: u8) -> bool {
        self.bus.sleep(Duration::from_secs(60));
        self.state(unit) == "stopped"
    }

    /// The frames that `work` sent.
    fn sent<T>(&self, work: impl FnOnce() -> T) -> (T, Vec<Vec<u8>>) {
        let wire = self.bus.simulator().unwrap().wire();
        let before = wire.trace().len();
        let done = work();
        let frames =
            wire.trace().into_iter().skip(before).filter(|one| one.side == Side::Master).map(|one| one.bytes).collect();
        (done, frames)
    }
}

fn named(bus: &Bus, unit: u8, family: &str) -> Drive {
    bus.drive(unit, &Profile::builtin(family).unwrap()).unwrap()
}

fn briefly() -> Halting {
    Halting::stop().within(Duration::from_secs(1))
}

/// Whom the frames that write are for.
fn told(frames: &[Vec<u8>]) -> Vec<u8> {
    frames.iter().filter(|frame| [0x05, 0x06, 0x10].contains(&frame[1])).map(|frame| frame[0]).collect()
}

fn failed(error: &drivebus::NotAllHalted) -> Vec<(u8, ErrorKind, bool)> {
    error.failures().iter().map(|(unit, error)| (*unit, error.kind(), error.may_have_acted())).collect()
}

#[test]
fn each_is_told_in_the_words_of_its_family_before_the_first_is_looked_at() {
    let plant = Plant::of(&["gd350", "vfd500", "wj200", "a1000"]);
    let (done, frames) = plant.sent(|| plant.bus.halt_all(&plant.drives, &Halting::stop()));
    done.unwrap();
    assert_eq!(told(&frames[..4]), [1, 2, 3, 4]);
    assert_eq!(told(&frames).len(), 4, "and nobody twice");
    for drive in &plant.drives {
        assert!(plant.stands(drive.unit()), "{}", drive.profile().name());
    }
}

#[test]
fn the_proofs_go_on_side_by_side() {
    let families = ["gd350", "gd350", "gd350", "gd350"];
    let took = |work: &dyn Fn(&Plant)| {
        let plant = Plant::of(&families);
        let began = plant.bus.now();
        work(&plant);
        plant.bus.now().saturating_duration_since(began)
    };
    let together = took(&|plant| plant.bus.halt_all(&plant.drives, &Halting::stop()).unwrap());
    let in_turn = took(&|plant| plant.drives.iter().for_each(|drive| drive.stop().unwrap()));
    assert!(together < in_turn.mul_f64(0.7), "{together:?} {in_turn:?}");
}

#[test]
fn who_is_silent_is_named_and_all_others_are_halted() {
    let plant = Plant::of(&["gd350", "vfd500"]);
    let absent = named(&plant.bus, 9, "gd350");
    let all = [&absent, &plant.drives[0], &plant.drives[1]];
    let error = plant.bus.halt_all(all, &briefly()).unwrap_err();
    assert_eq!(error.halted(), [1, 2]);
    assert_eq!(failed(&error), [(9, ErrorKind::Unconfirmed, true)]);
    let alone = absent.halt(&briefly()).unwrap_err().to_string();
    let (begins, _) = alone.split_once(" sent ").unwrap();
    let says = format!("2 of 3 drives were proved to be halted; not proved: unit 9. {begins} sent ");
    assert!(error.to_string().starts_with(&says), "{error}");
    assert!(plant.stands(1) && plant.stands(2));
    // It was silent: now it is told last.
    let (done, frames) = plant.sent(|| plant.bus.halt_all(all, &briefly()));
    assert!(done.is_err());
    assert_eq!(told(&frames)[..3], [1, 2, 9]);
}

#[test]
fn who_refuses_is_named_and_all_others_are_halted() {
    let plant = Plant::of(&["gd350", "vfd500", "gd350"]);
    let refusing = |unit| plant.bus.simulator().unwrap().drive(unit).unwrap();
    refusing(2).refuse(Refusals::new(0x04).of(Asked::Writes)).unwrap();
    let error = plant.bus.halt_all(&plant.drives, &briefly()).unwrap_err();
    assert_eq!((error.halted(), failed(&error)), (&[1, 3][..], vec![(2, ErrorKind::Refused, false)]));
    assert_eq!(plant.state(2), "forward");
    assert!(plant.stands(1) && plant.stands(3));
    let as_one = Error::from(error.clone());
    assert_eq!((as_one.kind(), as_one.may_have_acted()), (ErrorKind::Refused, false));
    assert_eq!(as_one.to_string(), error.to_string());
    // With one that is silent they are of two kinds.
    let absent = named(&plant.bus, 9, "gd350");
    let error = plant.bus.halt_all([&plant.drives[1], &absent], &briefly()).unwrap_err();
    assert!(
        error.to_string().starts_with("0 of 2 drives were proved to be halted; not proved: units 2, 9. "),
        "{error}"
    );
    let as_one = Error::from(error);
    assert_eq!((as_one.kind(), as_one.may_have_acted()), (ErrorKind::Unconfirmed, true));
    refusing(2).refuse_no_more();
    plant.bus.halt_all(&plant.drives, &briefly()).unwrap();
    assert!(plant.stands(2));
}

/// EDS300 manual, p. 46: 5 runs one, and stops a GD350.
#[test]
fn who_is_named_wrongly_is_halted_as_what_it_is() {
    let plant = Plant::of(&["eds300", "vfd500"]);
    let wrongly = named(&plant.bus, 1, "gd350");
    let (done, frames) = plant.sent(|| plant.bus.halt_all([&wrongly, &plant.drives[1]], &Halting::stop()));
    done.unwrap();
    assert_eq!(told(&frames), [2, 1], "who has to be asked first keeps nobody waiting");
    assert!(plant.stands(1) && plant.stands(2));
    let (_, runs) = plant.drives[0].profile().command(Command::RunForward).unwrap();
    let writes = plant.bus.simulator().unwrap().drive(1).unwrap().take_writes();
    assert_eq!(writes.iter().filter(|write| write.value == runs).count(), 1, "that was its start");
}

#[test]
fn what_cannot_be_is_not_sent() {
    let (plant, other) = (Plant::of(&["gd350"]), Plant::of(&["gd350", "vfd500"]));
    let longer = Halting::stop().within(Duration::from_secs(3601));
    let (error, frames) = plant.sent(|| plant.bus.halt_all(&plant.drives, &longer).unwrap_err());
    assert_eq!(failed(&error), [(1, ErrorKind::NotAllowed, false)]);
    let none: [&Drive; 0] = [];
    let (error, more) = plant.sent(|| plant.bus.halt_all(none, &Halting::stop()).unwrap_err());
    assert_eq!((error.failures(), error.halted()), (&[][..], &[][..]));
    assert_eq!(error.to_string(), "no drive was named, so nobody was told to halt");
    assert_eq!(Error::from(error).kind(), ErrorKind::NotAllowed);
    assert!(frames.is_empty() && more.is_empty());

    // One of another line keeps nobody from being halted, and is told nothing.
    let both = [&other.drives[1], &plant.drives[0]];
    let (error, frames) = other.sent(|| plant.bus.halt_all(both, &Halting::stop()).unwrap_err());
    assert_eq!((error.halted(), failed(&error)), (&[1][..], vec![(2, ErrorKind::NotAllowed, false)]));
    assert!(error.to_string().ends_with("unit 2 is on another line: it was not told"), "{error}");
    assert!(frames.is_empty() && plant.stands(1));
    plant.bus.close();
    let error = plant.bus.halt_all(&plant.drives, &briefly()).unwrap_err();
    assert_eq!(failed(&error), [(1, ErrorKind::Port, false)]);
}

#[tokio::test]
async fn the_halt_of_all_is_a_future_too() {
    let plant = Plant::of(&["gd350", "vfd500"]);
    let (bus, drives) = (plant.bus.aio(), plant.drives.iter().map(Drive::aio).collect::<Vec<_>>());
    let absent = named(&plant.bus, 9, "gd350").aio();
    let error = bus.halt_all(drives.iter().chain([&absent]), &briefly()).await.unwrap_err();
    assert_eq!((error.halted(), failed(&error)), (&[1, 2][..], vec![(9, ErrorKind::Unconfirmed, true)]));
    assert!(plant.stands(1) && plant.stands(2));
    bus.halt_all(&drives, &Halting::coast()).await.unwrap();
    let longer = Halting::stop().confirm(Duration::MAX);
    assert_eq!(failed(&bus.halt_all(&drives, &longer).await.unwrap_err()).len(), 2);
}
