//! How long the bus waits, before a request and for its answer, in virtual time and to the nanosecond.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallError, CallOptions, Done, Failure, Line, Priority, UnitOptions};
use drivebus_rtu::{Destination, FIRST_CONTACT, OVERTAKING, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, Simulator};

const FORMAT: SerialFormat = SerialFormat::DEFAULT;
fn once() -> CallOptions {
    CallOptions::new().retries(0)
}

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn pair(options: BusOptions) -> (Simulator, Bus) {
    let simulator = Simulator::new([(1, "gd350"), (2, "gd350")], Options::default()).unwrap();
    let mut line: Option<Box<dyn Line>> = Some(Box::new(simulator.line()));
    let options = options.echo(AdapterEcho::Absent);
    let bus = Bus::open(Box::new(move || Ok(line.take().unwrap())), options, &mut || false).unwrap();
    bus.sleep(FIRST_CONTACT, &mut || false);
    (simulator, bus)
}

fn read(bus: &Bus, raw: u8, options: CallOptions) -> Result<Done, Box<CallError>> {
    bus.call(unit(raw).into(), &Request::read(0x2100, 1).unwrap(), options, &mut || false, &mut |_| ())
}

/// How long unit 1 was waited for, from the end of the request, when it did not answer.
fn waited(simulator: &Simulator, bus: &Bus, options: CallOptions) -> Duration {
    simulator.wire().drop_answers(1);
    let error = read(bus, 1, options).unwrap_err();
    let sent = error.sent.unwrap() + FORMAT.chars(8);
    let waited = error.ended.unwrap().saturating_duration_since(sent);
    assert!(matches!(error.failure, Failure::NoAnswer { timeout, .. } if timeout == waited), "{error}");
    // Whatever it owes is settled, and has come or never will, before it is asked again.
    read(bus, 1, CallOptions::default()).unwrap();
    bus.sleep(OVERTAKING, &mut || false);
    waited
}

#[test]
fn a_unit_gets_its_own_silence_and_its_own_time_out() {
    let (simulator, bus) = pair(BusOptions::new(FORMAT));
    let (gap, timeout) = (Duration::from_millis(20), Duration::from_millis(300));
    bus.configure(unit(1), UnitOptions::new().timeout(timeout).gap(gap));
    let mut before = read(&bus, 2, once()).unwrap();
    for (raw, silence) in [(1, gap), (1, gap), (2, FORMAT.t35()), (2, FORMAT.t35()), (1, gap)] {
        let done = read(&bus, raw, once()).unwrap();
        assert_eq!(done.sent.saturating_duration_since(before.ended), silence, "unit {raw}");
        before = done;
    }
    assert_eq!(waited(&simulator, &bus, once()), timeout);
    let own = once().timeout(Duration::from_millis(70));
    assert_eq!(waited(&simulator, &bus, own), Duration::from_millis(70), "a call's own time-out is the last word");
    bus.configure(unit(1), UnitOptions::default());
    assert_eq!(waited(&simulator, &bus, once()), Duration::from_millis(500));
}

/// A GD350 answers 5 ms after the silence (P14.03), 7 ms after the request: four times that is below the floor.
#[test]
fn a_read_waits_as_long_as_answers_have_taught_and_once_longer_after_silence() {
    let floor = Duration::from_millis(100) + FORMAT.chars(7);
    let all = Duration::from_millis(500);
    let polled = once().priority(Priority::Poll);
    for (learn_timeout, options, learned) in [(true, once(), floor), (false, once(), all), (false, polled, floor)] {
        let (simulator, bus) = pair(BusOptions::new(FORMAT).learn_timeout(learn_timeout));
        assert_eq!(waited(&simulator, &bus, options), all, "nothing is known yet");
        for _ in 0..8 {
            read(&bus, 1, once()).unwrap();
        }
        assert_eq!(waited(&simulator, &bus, options), learned);
        if learned == floor {
            assert_eq!(waited(&simulator, &bus, options), all, "what was usual is not any more");
        }
    }
}

#[test]
fn what_a_slow_unit_needs_is_learned() {
    let (simulator, bus) = pair(BusOptions::new(FORMAT).learn_timeout(true));
    simulator.wire().delay_answers(Duration::from_millis(30), 8);
    for _ in 0..8 {
        read(&bus, 1, once()).unwrap();
    }
    // The unit's own 5 ms and the silence before its answer come on top.
    let delay = Duration::from_millis(35) + FORMAT.t35();
    assert_eq!(waited(&simulator, &bus, once()), 4 * delay + FORMAT.chars(7));
    let figures = bus.stats().units[&unit(1)].delay;
    assert_eq!(figures.max, delay);
}

#[test]
fn units_are_given_the_turnaround_of_the_bus_after_a_broadcast() {
    let turnaround = Duration::from_millis(150);
    let (_simulator, bus) = pair(BusOptions::new(FORMAT).turnaround(turnaround));
    let stop = Request::write(0x2000, 5);
    let done = bus.call(Destination::Broadcast, &stop, once(), &mut || false, &mut |_| ()).unwrap();
    assert_eq!(done.ended.saturating_duration_since(done.sent), FORMAT.chars(8) + turnaround);
}

#[test]
fn what_was_learned_makes_no_wait_longer_than_the_time_out() {
    let timeout = Duration::from_millis(60);
    let (simulator, bus) = pair(BusOptions::new(FORMAT).learn_timeout(true).timeout(timeout));
    for _ in 0..8 {
        read(&bus, 1, once()).unwrap();
    }
    assert_eq!(waited(&simulator, &bus, once()), timeout);
}

/// A unit may take long to write to its EEPROM, and its reads teach nothing about that.
#[test]
fn a_write_waits_the_whole_time_out_whatever_reads_have_taught() {
    let (simulator, bus) = pair(BusOptions::new(FORMAT).learn_timeout(true));
    for _ in 0..8 {
        read(&bus, 1, once()).unwrap();
    }
    simulator.wire().drop_answers(1);
    let write = Request::write(0x800B, 100); // P00.11 in RAM
    let error = bus.call(unit(1).into(), &write, once(), &mut || false, &mut |_| ()).unwrap_err();
    let sent = error.sent.unwrap() + FORMAT.chars(8);
    assert_eq!(error.ended.unwrap().saturating_duration_since(sent), Duration::from_millis(500), "{error}");
}
