//! The bus against a simulated drive, in virtual time: what the owner of the line promises, to the nanosecond.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallError, CallOptions, Done, Failure, Line, Priority};
use drivebus_rtu::{Adu, Answer, Destination, FIRST_CONTACT, Instant, Request, SerialFormat, UnitAddress};
use drivebus_sim::{FaultKind, Options, Side, Simulator};

const STATE: u16 = 0x2100;

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn simulator(format: SerialFormat) -> Simulator {
    Simulator::new([(1, "gd350"), (2, "gd350")], Options::default().format(format)).unwrap()
}

/// A bus on a line that was just opened: nobody knows who asked before.
fn fresh_bus(simulator: &Simulator, options: BusOptions) -> Bus {
    let line: Box<dyn Line> = Box::new(simulator.line());
    let mut line = Some(line);
    Bus::open(Box::new(move || Ok(line.take().unwrap())), options, &mut || false).unwrap()
}

/// A bus that was open for long enough that no other program's answer can come any more, and whose adapter is known.
fn bus(simulator: &Simulator, options: BusOptions) -> Bus {
    let bus = fresh_bus(simulator, options.echo(AdapterEcho::Absent));
    bus.sleep(FIRST_CONTACT, &mut || false);
    bus
}

fn pair() -> (Simulator, Bus) {
    let simulator = simulator(SerialFormat::DEFAULT);
    let bus = bus(&simulator, BusOptions::new(SerialFormat::DEFAULT));
    (simulator, bus)
}

fn ask(bus: &Bus, unit_address: u8, request: &Request<'_>) -> Result<(Vec<u16>, Done), Box<CallError>> {
    let mut read = Vec::new();
    let done = bus.call(unit(unit_address).into(), request, CallOptions::default(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            read = words.iter().collect();
        }
    })?;
    Ok((read, done))
}

fn read(bus: &Bus, address: u16, count: u16) -> Result<Vec<u16>, Box<CallError>> {
    Ok(ask(bus, 1, &Request::read(address, count).unwrap())?.0)
}

#[test]
fn a_read_is_repeated_and_a_write_is_not() {
    let (simulator, bus) = pair();
    simulator.wire().drop_answers(2);
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
    assert_eq!(bus.stats().total.timeouts, 2);
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);

    let accel = 0x800B; // P00.11, RAM
    simulator.wire().drop_answers(1);
    let error = ask(&bus, 1, &Request::write(accel, 50)).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { attempts: 1, .. }), "{error}");
    assert!(error.sent.is_some() && error.to_string().contains("the unit may have taken it"), "{error}");
    let writes = simulator.drive(1).unwrap().writes();
    assert_eq!(writes.iter().filter(|write| write.address == accel).count(), 1, "{writes:?}");
}

/// Silence takes a time-out and counts whole; damage takes none and counts half.
#[test]
fn a_damaged_answer_is_asked_for_twice_as_often_as_a_missing_one() {
    for (retries, silent, damaged) in [(0, 1, 1), (1, 2, 3), (2, 3, 5)] {
        let asked = |spoil: &dyn Fn(&Simulator)| {
            let (simulator, bus) = pair();
            spoil(&simulator);
            let options = CallOptions::new().retries(retries);
            let request = Request::read(STATE, 1).unwrap();
            bus.call(unit(1).into(), &request, options, &mut || false, &mut |_| ()).unwrap_err();
            simulator.wire().requests()
        };
        assert_eq!(asked(&|simulator| simulator.wire().drop_answers(100)), silent, "{retries} retries, silence");
        let damage = |simulator: &Simulator| simulator.wire().set_rate(FaultKind::LoseByte, 1.0).unwrap();
        assert_eq!(asked(&damage), damaged, "{retries} retries, damage");
    }
}

#[test]
fn a_reply_that_comes_during_the_next_request_is_never_its_answer() {
    let (simulator, bus) = pair();
    simulator.wire().delay_answers(Duration::from_millis(515), 1);
    let once = CallOptions::new().retries(0);
    let late = bus.call(unit(1).into(), &Request::read(0x2103, 1).unwrap(), once, &mut || false, &mut |_| ());
    assert!(matches!(late.unwrap_err().failure, Failure::NoAnswer { .. }));
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3], "not 01A0H, the identification asked for before");
    let stats = bus.stats();
    assert_eq!((stats.total.late, stats.total.resyncs), (1, 1), "{stats:?}");
}

#[test]
fn a_stop_is_sent_to_a_unit_that_seems_deaf() {
    let (simulator, bus) = pair();
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
    simulator.wire().drop_answers(100); // it hears, and is not heard
    assert!(read(&bus, STATE, 1).is_err());
    let stop = Request::write(0x2000, 5);
    let urgent = CallOptions::new().priority(Priority::Stop).in_doubt(true);
    let error = bus.call(unit(1).into(), &stop, urgent, &mut || false, &mut |_| ()).unwrap_err();
    assert!(error.sent.is_some(), "{error}");
    let writes = simulator.drive(1).unwrap().writes();
    assert_eq!(writes.iter().filter(|write| (write.address, write.value) == (0x2000, 5)).count(), 1);
    // Anything else is not sent before the unit has returned an echo.
    let error = ask(&bus, 1, &Request::write(0x2001, 5)).unwrap_err();
    assert_eq!(error.sent, None, "{error}");
}

/// A stop does not wait until it is known whether the adapter echoes; its confirmation does.
#[test]
fn the_echo_of_an_adapter_confirms_no_stop() {
    let urgent = CallOptions::new().priority(Priority::Stop).in_doubt(true);
    let stop = Request::write(0x2000, 5);
    for (echo, deaf) in [(false, false), (true, false), (true, true)] {
        let simulator = simulator(SerialFormat::DEFAULT);
        simulator.wire().set_echo(echo);
        simulator.wire().set_rate(FaultKind::Deaf, f64::from(u8::from(deaf))).unwrap();
        let bus = fresh_bus(&simulator, BusOptions::new(SerialFormat::DEFAULT));
        let first = bus.call(unit(1).into(), &stop, urgent, &mut || false, &mut |_| ());
        assert_eq!(first.is_ok(), !echo, "{first:?}");
        if let Err(error) = first {
            assert!(error.sent.is_some() && error.to_string().contains("may have taken it"), "{error}");
        }
        assert_eq!(simulator.drive(1).unwrap().words_written(), u64::from(!deaf));

        simulator.wire().clear();
        assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
        bus.call(unit(1).into(), &stop, urgent, &mut || false, &mut |_| ()).unwrap();
        assert_eq!(simulator.drive(1).unwrap().words_written(), 1 + u64::from(!deaf));
    }
}

/// The first time-out on a bus, of a drive that stalls for longer than two time-outs: it may store to EEPROM.
#[test]
fn an_answer_that_comes_after_the_echo_was_given_up_is_never_the_next_ones() {
    let (simulator, bus) = pair();
    let once = CallOptions::new().retries(0);
    let identify = Request::read(0x2103, 1).unwrap();
    simulator.wire().delay_answers(Duration::from_millis(1_200), 1);
    bus.call(unit(1).into(), &identify, once, &mut || false, &mut |_| ()).unwrap_err();
    let mut seen = Vec::new();
    for _ in 0..4 {
        let mut take = |answer: Answer<'_>| {
            if let Answer::Read { words, .. } = answer {
                seen.extend(words.iter());
            }
        };
        let _ = bus.call(unit(1).into(), &Request::read(STATE, 1).unwrap(), once, &mut || false, &mut take);
    }
    assert!(!seen.is_empty() && seen.iter().all(|&word| word == 3), "{seen:04X?}");
}

#[test]
fn a_silent_unit_costs_its_own_time_outs_only() {
    let (simulator, bus) = pair();
    let error = ask(&bus, 9, &Request::read(STATE, 1).unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "unit 9, read 2100H: no answer within 500 ms, asked 3 times",);
    assert_eq!(error.request, Adu::request(unit(9).into(), &Request::read(STATE, 1).unwrap()).as_bytes());
    let spent = error.ended.unwrap().saturating_duration_since(Instant::ZERO + FIRST_CONTACT);
    assert!(spent < 3 * Duration::from_millis(540), "three time-outs and the requests: {spent:?}");
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
    assert_eq!(bus.stats().units[&unit(1)].requests, 1);
    assert_eq!(simulator.wire().silence_violations(), 0);
}

#[test]
fn what_the_unit_refuses_is_not_asked_again() {
    let (simulator, bus) = pair();
    let error = read(&bus, 0x6300, 1).unwrap_err(); // P99.00
    assert!(matches!(error.failure, Failure::Refused { function: 3, code } if code.0 == 2), "{error}");
    assert_eq!(simulator.wire().requests(), 1);
}

#[test]
fn a_damaged_answer_is_told_with_both_crcs_and_its_bytes() {
    let (simulator, bus) = pair();
    let bad = [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x46];
    simulator.wire().answer_with(&bad);
    let once = CallOptions::new().retries(0);
    let request = Request::read(STATE, 1).unwrap();
    let error = bus.call(unit(1).into(), &request, once, &mut || false, &mut |_| ()).unwrap_err();
    assert_eq!(error.raw, bad);
    assert_eq!(
        error.to_string(),
        "unit 1, read 2100H: the CRC of the bytes is F8 45, with them came F8 46; came: 01 03 02 00 03 F8 46"
    );
}

#[test]
fn a_read_only_bus_sends_no_write() {
    let simulator = simulator(SerialFormat::DEFAULT);
    let options = BusOptions::new(SerialFormat::DEFAULT).read_only(true);
    let bus = bus(&simulator, options);
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
    for (destination, request) in [
        (Destination::Unit(unit(1)), Request::write(0x2000, 1)),
        (Destination::Unit(unit(1)), Request::write_many(0x2000, &[1, 1000]).unwrap()),
        (Destination::Broadcast, Request::write(0x2000, 5)),
    ] {
        let error = bus.call(destination, &request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap_err();
        assert!(matches!(error.failure, Failure::ReadOnly { .. }), "{error}");
        assert_eq!(error.sent, None);
    }
    assert_eq!(simulator.wire().requests(), 1);
}

#[test]
fn a_broadcast_reaches_all_and_waits_for_none() {
    let (simulator, bus) = pair();
    let request = Request::write(0x800B, 77);
    let done = bus.call(Destination::Broadcast, &request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
    let format = SerialFormat::DEFAULT;
    assert_eq!(done.ended, done.sent + format.chars(8) + Duration::from_millis(100), "the turnaround delay");
    for address in [1, 2] {
        assert_eq!(simulator.drive(address).unwrap().register(0x000B), Ok(77));
    }
    let answers = simulator.wire().trace().iter().filter(|sent| sent.side == Side::Unit).count();
    assert_eq!(answers, 0);
}

#[test]
fn giving_up_leaves_a_line_that_answers_rightly() {
    let (simulator, bus) = pair();
    simulator.wire().delay_answers(Duration::from_millis(200), 1);
    let request = Request::read(0x2103, 1).unwrap();
    let error = bus.call(unit(1).into(), &request, CallOptions::default(), &mut || true, &mut |_| ()).unwrap_err();
    assert_eq!(error.failure, Failure::Interrupted);
    assert!(error.ended.unwrap() < Instant::ZERO + FIRST_CONTACT + Duration::from_millis(100), "within 0.1 s");
    assert_eq!(read(&bus, STATE, 1).unwrap(), [3]);
}

#[test]
fn a_closed_bus_says_so() {
    let (_simulator, bus) = pair();
    bus.close();
    bus.close();
    assert!(bus.is_closed());
    assert!(matches!(read(&bus, STATE, 1).unwrap_err().failure, Failure::Closed));
}

#[test]
fn threads_take_turns_and_each_gets_its_own_answer() {
    let (_simulator, bus) = pair();
    std::thread::scope(|scope| {
        for thread in 0..8_u16 {
            let bus = &bus;
            scope.spawn(move || {
                for _ in 0..50 {
                    let (address, expected) = if thread % 2 == 0 { (0x2103, 0x01A0) } else { (STATE, 3) };
                    assert_eq!(read(bus, address, 1).unwrap(), [expected]);
                }
            });
        }
    });
    assert_eq!(bus.stats().total.answers, 400);
}

/// The others lose one time-out when a unit dies, and then one in each period of its back-off.
#[test]
fn a_dead_unit_leaves_the_line_to_the_others() {
    let (simulator, bus) = pair();
    let once = CallOptions::new().retries(0);
    let state = Request::read(STATE, 1).unwrap();
    let asked = |unit| {
        simulator.wire().trace().iter().filter(|sent| sent.side == Side::Master && sent.bytes[0] == unit).count()
    };
    read(&bus, STATE, 1).unwrap();
    for _ in 0..2 {
        bus.call(unit(9).into(), &state, once, &mut || false, &mut |_| ()).unwrap_err();
    }
    let before = asked(9);
    let error = bus.call(unit(9).into(), &state, once, &mut || false, &mut |_| ()).unwrap_err();
    assert!(matches!(error.failure, Failure::NotAsked { .. }) && error.sent.is_none(), "{error}");
    assert_eq!(asked(9), before, "not asked in its back-off");
    bus.sleep(Duration::from_secs(1), &mut || false);
    read(&bus, STATE, 1).unwrap();
    bus.call(unit(9).into(), &state, CallOptions::default(), &mut || false, &mut |_| ()).unwrap_err();
    assert_eq!(asked(9), before + 1, "once, without retries");
    assert_eq!(bus.stats().units[&unit(9)].not_asked, 1);
    // A stop is sent whatever was heard.
    let stop = once.priority(Priority::Stop).in_doubt(true);
    bus.call(unit(9).into(), &Request::write(0x2000, 5), stop, &mut || false, &mut |_| ()).unwrap_err();
    assert_eq!(asked(9), before + 2);
}

/// The link tells of the last ten exchanges.
#[test]
fn a_link_is_as_good_as_its_last_exchanges() {
    let (simulator, bus) = pair();
    for _ in 0..10 {
        read(&bus, STATE, 1).unwrap();
    }
    simulator.wire().drop_answers(2);
    read(&bus, STATE, 1).unwrap();
    let link = bus.link(unit(1));
    assert_eq!((link.good, link.asked), (8, 10));
}
