//! Halts that go wrong on the way: refusals, silence, acknowledgements, and a port that is lost. None starts a motor, and what
//! is said of it is so.

use std::sync::Arc;
use std::time::Duration;

use drivebus::sim::{Asked, FaultKind, Refusals};
use drivebus::{Bus, Error, ErrorKind, Halting, Profile};

use super::exchange::lost_at;
use super::judge::Judge;
use super::plant::{LONG, Motion, Plant};

/// Of six makers; the first is named as the next, where another name is wanted.
const MAKERS: [&str; 6] = ["gd350", "eds300", "ms300", "a1000", "acs355", "wj200"];

/// How a unit is told to stop that is named as another one.
struct StopAs {
    named: Arc<Profile>,
    halting: Halting,
}

fn stop_as(named: &Plant) -> StopAs {
    StopAs { named: Arc::clone(&named.profile), halting: Halting::stop() }
}

impl StopAs {
    fn within(self, time: Duration) -> Self {
        Self { halting: self.halting.within(time), ..self }
    }

    fn over(&self, bus: &Bus) -> Result<(), Error> {
        bus.drive(1, &self.named).unwrap().unverified().halt(&self.halting)
    }
}

/// How `stop` ends over `bus`, which the motor of `plant` bears.
fn halted(plant: &Plant, bus: &Bus, stop: &StopAs) -> Result<(), Error> {
    let judge = Judge::over(plant, bus);
    let came = stop.over(bus);
    let wrong = judge.verdict(&came);
    assert!(wrong.is_empty(), "a {}: {came:?}: {wrong:?}", plant.profile.name());
    came
}

#[test]
fn a_refusal_that_ends_leaves_no_motor_running() {
    for (family, next) in MAKERS.into_iter().zip(MAKERS.into_iter().cycle().skip(1)) {
        let (plant, other) = (Plant::of(family), Plant::of(next));
        for code in 0x01..=0x0B {
            for named in [&plant, &other] {
                // So a gateway says that the unit is silent, and of a silent one only its name is known.
                if code == 0x0B && named.profile.name() != family {
                    continue;
                }
                plant.put(Motion::Forward);
                let refusals = Refusals::new(code).of(Asked::Writes).time(Duration::from_millis(400));
                plant.drive().refuse(refusals).unwrap();
                halted(&plant, &plant.bus(), &stop_as(named)).unwrap();
                plant.drive().refuse_no_more();
            }
        }
    }
}

#[test]
fn one_that_does_not_end_is_told() {
    for family in MAKERS {
        let plant = Plant::running(family);
        for code in [0x01, 0x02, 0x03, 0x04, 0x06, 0x09, 0x0A, 0x0B] {
            plant.drive().refuse(Refusals::new(code).of(Asked::Writes)).unwrap();
            let halting = stop_as(&plant).within(Duration::from_secs(1));
            let error = halted(&plant, &plant.bus(), &halting).unwrap_err();
            assert_ne!(error.kind(), ErrorKind::NotAllowed, "{family} {code:02X}H: {error}");
            assert_eq!(plant.drive().state(), "forward", "{family} {code:02X}H: {error}");
        }
    }
}

/// Modbus V1.1b3, section 7: 05H acknowledges, and the unit is still at it.
#[test]
fn an_acknowledgement_proves_nothing() {
    let plant = Plant::running("acs355");
    plant.drive().refuse(Refusals::new(0x05).of(Asked::Writes)).unwrap();
    let halting = stop_as(&plant).within(Duration::from_secs(2));
    let error = halted(&plant, &plant.bus(), &halting).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert_eq!(plant.drive().state(), "forward");
    plant.drive().refuse(Refusals::new(0x05).of(Asked::Writes).taken()).unwrap();
    halted(&plant, &plant.bus(), &halting).unwrap();
}

/// 06H is busy by the specification. An EDS300 runs by the stop of a GD350 (its manual, p. 46).
#[test]
fn one_that_is_busy_is_halted_when_it_says_what_it_is() {
    let (gd350, eds300) = (Plant::of("gd350"), Plant::of("eds300"));
    for times in [1, 2, 5, 20] {
        for motion in [Motion::AtRest, Motion::Forward] {
            eds300.put(motion);
            eds300.drive().refuse(Refusals::new(0x06).of(Asked::Reads).count(times)).unwrap();
            halted(&eds300, &eds300.bus(), &stop_as(&gd350)).unwrap();
            eds300.drive().refuse_no_more();
        }
    }
    eds300.drive().refuse(Refusals::new(0x06)).unwrap();
    let error = halted(&eds300, &eds300.bus(), &stop_as(&gd350)).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, false), "{error}");
}

/// It does what it is told, and nobody hears it; or it hears nothing.
#[test]
fn silence_is_told_whether_the_motor_stands_or_not() {
    for family in MAKERS {
        for (fault, after) in [(FaultKind::Silence, "stopped"), (FaultKind::Deaf, "forward")] {
            let plant = Plant::running(family);
            plant.simulator.wire().set_rate(fault, 1.0).unwrap();
            let error = halted(&plant, &plant.bus(), &stop_as(&plant).within(Duration::from_secs(1))).unwrap_err();
            assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{family}: {error}");
            assert_eq!(plant.drive().state(), after, "{family}: {error}");
        }
    }
}

#[test]
fn what_is_lost_now_and_then_leaves_no_motor_running() {
    for family in MAKERS {
        let plant = Plant::of(family);
        for fault in [FaultKind::Deaf, FaultKind::Silence] {
            plant.put(Motion::Forward);
            plant.simulator.wire().set_rate(fault, 0.4).unwrap();
            // What the line shows of it is another question: the motor is what counts.
            let came = stop_as(&plant).over(&plant.bus());
            plant.simulator.wire().clear();
            plant.pass(LONG);
            assert_eq!(plant.drive().state(), "stopped", "a {family}, {fault}: {came:?}");
        }
    }
}

/// The cable comes out behind each of the first answers, and is back in the same drive half a second later.
#[test]
fn a_port_that_comes_back_leaves_no_motor_running() {
    for family in MAKERS {
        let plant = Plant::of(family);
        for answer in 1..=8 {
            plant.put(Motion::Forward);
            plant.simulator.wire().script(&[(answer, FaultKind::Unplug)]);
            let came = halted(&plant, &plant.bus(), &stop_as(&plant));
            assert!(came.as_ref().map_or_else(Error::may_have_acted, |()| true), "{family} at {answer}: {came:?}");
            assert_eq!(plant.drive().state(), "stopped", "{family} at {answer}: {came:?}");
            plant.simulator.wire().clear();
        }
    }
}

#[test]
fn a_bus_that_is_closed_tells_nobody_anything() {
    let plant = Plant::running("gd350");
    let bus = plant.bus();
    bus.close();
    let error = halted(&plant, &bus, &stop_as(&plant)).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Port, false), "{error}");
}

/// The port is lost behind each of the first answers, and leads to a drive of another family when it is open again.
///
/// An EDS300 refuses each read by which the line could make sure of an answer: that is no silence.
#[test]
fn what_one_drive_answered_says_nothing_of_another() {
    for here in ["gd350", "ms300", "a1000", "vfd500"] {
        for there in ["gd350", "eds300", "ms300", "acs355", "wj200", "v20"] {
            for motion in [Motion::AtRest, Motion::Forward] {
                let other = Plant::of(there);
                for answer in 1..=8 {
                    let one = Plant::running(here);
                    other.put(motion);
                    let bus = lost_at(answer, &one.simulator, &other.simulator);
                    halted(&other, &bus, &stop_as(&one)).ok();
                }
            }
        }
    }
}
