//! A drive that speaks Huanyang's own protocol: it is asked in that alone, whatever the line does, and no late answer is taken.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus::drives::State;
use drivebus::line::{Direction, Traced};
use drivebus::rtu::huanyang::has_form;
use drivebus::sim::{FaultKind, Options, Simulator};
use drivebus::{Bus, Drive, ErrorKind, Profile};

/// Words that stay as they are, and what they are from the factory of the simulated drive.
const CONSTANT: [(u16, u16); 5] = [(0x0105, 5_000), (0x0190, 1_440), (0x018E, 70), (0x018F, 4), (0x01A3, 1)];

/// The frames that went out.
type Sent = Arc<Mutex<Vec<Vec<u8>>>>;

/// A drive that obeys the bus, and all that was sent to it.
fn plant() -> (Simulator, Bus, Drive, Sent) {
    let simulator = Simulator::new([(1, "huanyang-hy")], Options::default().seed(7)).unwrap();
    for (address, word) in [(0x0101, 2), (0x0102, 2)] {
        simulator.drive(1).unwrap().set_parameter(address, word).unwrap();
    }
    let line = simulator.clone();
    let bus = Bus::builder().open_with(Box::new(move || Ok(Box::new(line.open_line()?)))).unwrap();
    let sent = Sent::default();
    let kept = Arc::clone(&sent);
    bus.watch(Some(Arc::new(move |traced: Traced| {
        if traced.direction == Direction::Sent {
            kept.lock().unwrap().push(traced.bytes);
        }
    })));
    let drive = bus.drive(1, &Profile::builtin("huanyang-hy").unwrap()).unwrap().unverified();
    (simulator, bus, drive, sent)
}

/// LinuxCNC, hy_vfd.c: 01H runs forward and 08H stops by function 03, 05 sets the frequency, 04 reads status 1.
#[test]
fn a_motor_runs_and_stops_by_the_words_of_its_protocol() {
    let (simulator, bus, drive, sent) = plant();
    drive.run(20.0).unwrap();
    bus.sleep(Duration::from_secs(30));
    assert_eq!((simulator.drive(1).unwrap().state(), drive.look().unwrap().state), ("forward", State::Running));
    assert_eq!(drive.read("running_frequency").unwrap().to_string(), "20.00");
    drive.stop().unwrap();
    bus.sleep(Duration::from_secs(30));
    assert_eq!((simulator.drive(1).unwrap().state(), drive.look().unwrap().state), ("stopped", State::Stopped));
    let sent = sent.lock().unwrap();
    let position = |frame: &[u8]| sent.iter().position(|each| each == frame);
    let run = position(&[0x01, 0x03, 0x01, 0x01, 0x31, 0x88]).unwrap();
    let stop = position(&[0x01, 0x03, 0x01, 0x08, 0xF1, 0x8E]).unwrap();
    // 20 Hz are 07D0H.
    let speed = sent.iter().position(|each| each.starts_with(&[0x01, 0x05, 0x02, 0x07, 0xD0])).unwrap();
    assert!(speed < run && run < stop, "{sent:02X?}");
    assert_eq!(sent.iter().filter(|each| each.starts_with(&[0x01, 0x03])).count(), 2, "each is sent once");
}

#[test]
fn whatever_the_line_does_no_answer_is_wrong_and_nothing_of_modbus_is_sent() {
    let (simulator, bus, _drive, sent) = plant();
    let wire = simulator.wire();
    for kind in FaultKind::ALL {
        let share = match kind {
            FaultKind::Unplug | FaultKind::Foreign => 0.0,
            FaultKind::Late | FaultKind::Overtaken => 0.06,
            _ => 0.02,
        };
        wire.set_rate(kind, share).unwrap();
    }
    let (mut right, mut failed) = (0, 0);
    for number in 0..600_usize {
        let (address, word) = CONSTANT[number % CONSTANT.len()];
        match bus.read(1, address, 1) {
            Ok(words) => {
                assert_eq!(words, [word], "{address:04X}H, read {number}");
                right += 1;
            }
            Err(error) => {
                let is_of_the_line =
                    matches!(error.kind(), ErrorKind::NoAnswer | ErrorKind::BadAnswer | ErrorKind::Crc);
                assert!(is_of_the_line, "{error}");
                failed += 1;
            }
        }
        if number % 7 == 0 {
            // Its answer repeats it: whatever comes of it, it is no other's.
            let _of_the_line = bus.write(1, 0x0500, 1_000 + u16::try_from(number).unwrap());
        }
    }
    assert!(right > 500 && failed > 0, "{right} right, {failed} failed");
    let sent = sent.lock().unwrap();
    assert!(sent.len() > 600 && sent.iter().all(|frame| has_form(frame)), "a frame of Modbus was sent");
    assert_eq!(wire.silence_violations(), 0);
}

#[test]
fn what_the_protocol_has_nothing_for_is_refused_and_not_sent() {
    let (simulator, bus, drive, sent) = plant();
    let refused = [
        bus.read(1, 0x2103, 1).map(drop),
        bus.read(1, 0x0400, 2).map(drop),
        bus.write(1, 0x2000, 5),
        bus.write(1, 0x0500, [2_500]),
        bus.write(1, 0x0300, 0x0108),
        bus.echo(1).map(drop),
        drive.coast(),
    ];
    for came in refused {
        let error = came.unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
    }
    assert!(sent.lock().unwrap().is_empty());
    // A unit that is named as one of Modbus again is asked in that.
    bus.drive(1, &Profile::builtin("gd350").unwrap()).unwrap();
    assert_eq!(bus.read(1, 0x2103, 1).unwrap_err().kind(), ErrorKind::NoAnswer);
    assert!(!sent.lock().unwrap().is_empty());
    assert_eq!(simulator.drive(1).unwrap().state(), "stopped");
}
