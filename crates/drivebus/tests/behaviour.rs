//! The door over a simulated line in virtual time: what goes in, what comes out, and what every error says.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use drivebus::drive::task::{Mailbox, Read, Task};
use drivebus::drive::{Certainty, Looks};
use drivebus::drives::{Command, Protocol, State};
use drivebus::rtu::UnitAddress;
use drivebus::sim::Refusals;
use drivebus::{AdapterEcho, Bus, CallOptions, Error, ErrorKind, Profile, Reading, Target, UnitOptions};

const LINE: &str = "sim://1=gd350,2=vfd500?clock=virtual&seed=1";

fn bus() -> Bus {
    Bus::open(LINE).unwrap()
}

#[test]
fn words_are_read_and_written() {
    let bus = bus();
    assert_eq!(bus.read(1, 0x2103, 1).unwrap(), [0x01A0]);
    bus.write(1, 0x800B, 123).unwrap();
    bus.write(1, 0x800B, [124, 125]).unwrap();
    assert_eq!(bus.read(1, 0x000B, 2).unwrap(), [124, 125]);
    assert!(!bus.echo(2).unwrap().is_zero());
    assert_eq!(bus.transact(1, &[0x03, 0x21, 0x03, 0x00, 0x01], None).unwrap(), [0x03, 0x02, 0x01, 0xA0]);
    bus.broadcast(0x800B, 200).unwrap();
    assert_eq!(bus.read(1, 0x000B, 1).unwrap(), [200]);
    assert_eq!(bus.stats().total.requests, bus.stats().total.answers);
    assert_eq!(bus.link(1).unwrap().good, bus.link(1).unwrap().asked);
}

#[test]
fn a_drive_runs_and_an_urgent_stop_stops_it() {
    let (bus, gd350) = (bus(), Profile::builtin("gd350").unwrap());
    let simulated = bus.simulator().unwrap().drive(1).unwrap();
    for (address, word) in [(0x8001, 2), (0x8006, 8)] {
        bus.write(1, address, word).unwrap(); // it obeys the bus, and takes its frequency from there
    }
    bus.write(1, 0x2001, 1_000).unwrap();
    let (address, run) = gd350.command(Command::RunForward).unwrap();
    bus.write(1, address, run).unwrap();
    bus.sleep(Duration::from_secs(30));
    assert_eq!(gd350.state(bus.read(1, 0x2100, 1).unwrap()[0]), State::Forward);
    assert!((simulated.frequency() - 10.0).abs() < 0.01);
    let (address, stop) = gd350.command(Command::Stop).unwrap();
    bus.write_with(1, address, stop, CallOptions::new().urgent()).unwrap();
    bus.sleep(Duration::from_secs(30));
    let verified = CallOptions::new().urgent().verify();
    assert_eq!(gd350.state(bus.read_with(1, 0x2100, 1, verified).unwrap()[0]), State::Stopped);
}

#[test]
fn values_come_by_name_in_the_fewest_reads() {
    let (bus, gd350) = (bus(), Profile::builtin("gd350").unwrap());
    let reading = Reading::new(&gd350, ["output_current", "bus_voltage", "p00.03"]).unwrap();
    assert_eq!(reading.reads().count(), 2, "registers in one, the parameter in another");
    let values = bus.values(1, &reading).unwrap();
    assert_eq!(values.get("output_current").unwrap().to_string(), "0.0");
    assert_eq!(values.get("p00.03").unwrap().to_string(), "50.00", "as it was asked for");
    let named: Vec<String> = values.iter().map(|(name, value, unit)| format!("{name} {value} {unit}")).collect();
    assert_eq!(named.len(), 3);
    assert_eq!(named[0], "output_current 0.0 A");
    assert_eq!(reading.values(&[]).get("output_current"), None, "no words, no value");
}

#[test]
fn what_cannot_be_read_by_name_is_refused() {
    let gd350 = Profile::builtin("gd350").unwrap();
    let unknown = Reading::new(&gd350, ["output_curent"]).unwrap_err();
    assert_eq!(unknown.kind(), ErrorKind::NotAllowed);
    assert_eq!(unknown.to_string(), "gd350 has no \"output_curent\"; the closest is \"output_current\"");
    assert_eq!(Reading::new(&gd350, []).unwrap_err().kind(), ErrorKind::NotAllowed);
}

#[test]
fn a_poll_brings_samples_of_values_and_of_words() {
    let (bus, gd350) = (bus(), Profile::builtin("gd350").unwrap());
    let reading = Reading::new(&gd350, ["output_current"]).unwrap();
    let targets =
        [Target::values(1, &reading), Target::words(2, [(0x1900, 1), (0x1B00, 2)]), Target::words(9, [(0, 1)])];
    let poll = bus.poll(targets, Duration::from_secs(2)).unwrap();
    let samples: Vec<_> = poll.samples().take(6).collect();
    assert_eq!(samples.iter().map(drivebus::Sample::unit).collect::<Vec<_>>(), [1, 2, 9, 1, 2, 9]);
    let values = samples[0].values().unwrap().unwrap();
    assert_eq!(values.get("output_current").unwrap().to_string(), "0.0");
    assert_eq!(samples[1].words().unwrap().len(), 3);
    assert!(samples[1].values().unwrap().is_none(), "words were asked for");
    assert_eq!(samples[2].words().unwrap_err().kind(), ErrorKind::NoAnswer);
    let beat = samples[3].sent().saturating_duration_since(samples[0].sent());
    assert!(beat.abs_diff(Duration::from_secs(2)) < Duration::from_millis(100), "{beat:?}");
    poll.close();
    assert!(poll.is_over());
    let short = bus.poll([Target::words(1, [(0, 1)])], Duration::from_millis(1)).unwrap_err();
    assert_eq!(short.kind(), ErrorKind::NotAllowed);
    assert!(short.to_string().starts_with("an interval of 0.001 s is shorter than the line can carry"), "{short}");
}

#[test]
fn what_cannot_be_asked_is_refused_before_anything_is_sent() {
    let bus = bus();
    let refused = |error: Error, message: &str| {
        assert_eq!((error.kind(), error.to_string()), (ErrorKind::NotAllowed, message.to_owned()));
        assert!(!error.may_have_acted());
    };
    let broadcast = "unit 0 is the broadcast address, which nobody answers; allowed is 1 to 247, or use broadcast()";
    refused(bus.read(0, 0, 1).unwrap_err(), broadcast);
    refused(bus.write(248, 0, 1).unwrap_err(), "unit 248 is out of range; allowed is 1 to 247");
    refused(bus.read(1, 0, 126).unwrap_err(), "count 126 is out of range; allowed is 1 to 125");
    refused(bus.write(1, 0, []).unwrap_err(), "number of values 0 is out of range; allowed is 1 to 123");
    let never = CallOptions::new().timeout(Duration::ZERO);
    refused(bus.read_with(1, 0, 1, never).unwrap_err(), "timeout 0 is out of range; allowed is more than 0 to 3600");
    refused(
        bus.configure(1, UnitOptions::new().gap(Duration::from_secs(3601))).unwrap_err(),
        "gap 3601 is out of range; allowed is 0 to 3600",
    );
    assert_eq!(bus.stats().total.requests, 0);
}

#[test]
fn a_bus_is_opened_only_as_it_can_be() {
    let opened = |builder: drivebus::Builder| builder.open(LINE).map(drop).map_err(|error| error.to_string());
    let refused = |message: &str| Err(message.to_owned());
    assert_eq!(opened(Bus::builder().retries(101)), refused("retries 101 is out of range; allowed is 0 to 100"));
    assert_eq!(opened(Bus::builder().queue(0)), refused("queue 0 is out of range; allowed is 1 to 1000000"));
    assert_eq!(opened(Bus::builder().baudrate(1)), refused("baud rate 1 is not a number from 50 to 10000000 bit/s"));
    assert_eq!(opened(Bus::builder().baudrate(9_600).queue(1).retries(0)), Ok(()));
    let echo = Bus::builder().echo(AdapterEcho::Present).open("tcp://127.0.0.1").unwrap_err().to_string();
    assert!(echo.starts_with("echo \"yes\" is for an adapter that hands back what it sends"), "{echo}");
}

#[cfg(feature = "serial")]
#[test]
fn direction_control_is_for_a_serial_port() {
    let rs485: drivebus::Rs485 = "kernel".parse().unwrap();
    let refused = Bus::builder().rs485(rs485).open(LINE).unwrap_err();
    assert_eq!(refused.to_string(), "rs485 is for a serial port given by its path: nobody would move an RTS here");
    let missing = Bus::builder().rs485(rs485).open("/dev/drivebus-is-not-here").unwrap_err();
    assert_eq!(missing.kind(), ErrorKind::Port);
}

#[test]
fn an_error_says_whose_fault_it_is_and_whether_the_drive_took_it() {
    let bus = bus();
    let refused = bus.read(1, 0x5FFF, 1).unwrap_err();
    assert_eq!((refused.kind(), refused.code()), (ErrorKind::Refused, Some(2)));
    assert!(!refused.may_have_acted());
    assert!(refused.to_string().contains("(illegal_data_address by the specification)"), "{refused}");

    let wire = bus.simulator().unwrap().wire();
    wire.drop_answers(1);
    let silent = bus.write(1, 0x800B, 7).unwrap_err();
    assert_eq!(silent.kind(), ErrorKind::NoAnswer);
    assert!(silent.may_have_acted(), "{silent}");
    assert_eq!(bus.read(1, 0x000B, 1).unwrap(), [7], "it did");

    wire.answer_with(&[0x01, 0x06, 0x00]);
    let short = bus.write(1, 0x800B, 8).unwrap_err();
    assert_eq!((short.kind(), short.raw()), (ErrorKind::BadAnswer, &[0x01, 0x06, 0x00][..]));

    let read_only = Bus::builder().read_only(true).open(LINE).unwrap();
    let kept = read_only.write(1, 0x800B, 1).unwrap_err();
    assert_eq!((kept.kind(), kept.may_have_acted()), (ErrorKind::NotAllowed, false));

    bus.close();
    let closed = bus.read(1, 0, 1).unwrap_err();
    assert_eq!((closed.kind(), closed.to_string().ends_with("the bus is closed")), (ErrorKind::Port, true));
}

/// Of a family that nothing tells from others nobody says that it is one of them alone.
#[test]
fn a_unit_is_found_for_what_it_is() {
    let mut certain = 0;
    for name in Profile::builtin_names() {
        let bus = Bus::open(&format!("sim://{name}?clock=virtual&seed=1")).unwrap();
        let profile = Profile::builtin(name).unwrap();
        if profile.requests().protocol != Protocol::Modbus {
            // It does not answer what it is asked in Modbus.
            assert_eq!(bus.identify(1).unwrap_err().kind(), ErrorKind::NoAnswer, "{name}");
            continue;
        }
        let found = bus.identify(1).unwrap();
        let is_it = found.candidates.iter().any(|each| each == profile.name() || profile.reports_as().contains(each));
        assert!(is_it || found.candidates.is_empty(), "{name}: {found}");
        certain += usize::from(found.certainty == Certainty::Certain);
    }
    assert!(certain >= 4, "{certain}");
    let silent = bus().identify(9).unwrap_err();
    assert_eq!((silent.kind(), silent.may_have_acted()), (ErrorKind::NoAnswer, true));
    assert_eq!(bus().identify(0).unwrap_err().kind(), ErrorKind::NotAllowed);
}

#[test]
fn a_unit_that_is_always_busy_does_not_say_what_it_is() {
    let bus = bus();
    bus.simulator().unwrap().drive(1).unwrap().refuse(Refusals::new(0x06)).unwrap();
    let busy = bus.identify(1).unwrap_err();
    assert_eq!(busy.kind(), ErrorKind::BadAnswer);
    assert!(busy.to_string().starts_with("unit 1 is busy, or gets requests damaged: it refused "), "{busy}");
}

#[test]
fn a_look_shows_what_a_drive_does() {
    let (bus, gd350) = (bus(), Profile::builtin("gd350").unwrap());
    let looks = Arc::new(Looks::new(&gd350, false));
    let before = bus.look(1, &looks).unwrap();
    assert_eq!((before.state, before.is_tripped()), (State::Stopped, false));
    for (address, word) in [(0x8001, 2), (0x8006, 8), (0x2001, 1_000), (0x2000, 1)] {
        bus.write(1, address, word).unwrap();
    }
    let now = bus.look(1, &looks).unwrap();
    assert_eq!((now.state, now.word, now.to_string().as_str()), (State::Forward, Some(1), "forward"));
    assert!(now.asked >= before.asked);
    // At this address is a VFD500, which refuses what a GD350 has there.
    assert_eq!(bus.look(2, &looks).unwrap_err().kind(), ErrorKind::Refused);
}

/// A task of one's own: what an operation may not do is told, and nothing panics.
#[test]
fn an_operation_of_ones_own_is_carried_out() {
    let bus = bus();
    let unit = UnitAddress::new(1).unwrap();
    let twice = bus.carry_out(Task::new(async move |line: Mailbox<Error>| {
        let first = line.read(Read::word(unit, 0x2103.into())).await?;
        line.sleep(Duration::from_secs(1)).await?;
        Ok((first, line.read_stamped(Read::words(unit, 0x2100.into(), 2).urgent(true)).await?.words.len(), line.now()))
    }));
    let (first, count, now) = twice.unwrap();
    assert_eq!((first, count), (vec![0x01A0], 2));
    assert!(now.as_nanos() > 1_000_000_000);
    let stuck = bus.carry_out(Task::<Result<(), _>, _>::new(async |_| std::future::pending().await));
    assert_eq!(stuck.unwrap_err().kind(), ErrorKind::NotAllowed);
    let too_many = Task::new(async move |line: Mailbox<Error>| line.read(Read::words(unit, 0.into(), 500)).await);
    assert_eq!(bus.carry_out(too_many).unwrap_err().kind(), ErrorKind::NotAllowed);
}
