//! Durations at their ends: whatever a caller gives, a call ends with an answer or an error, or waits, and never panics.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Done, Line, Poll, PollTarget, Priority, UnitOptions,
};
use drivebus_rtu::{Destination, Instant, Request, SerialFormat, UnitAddress};
use drivebus_sim::{FaultKind, Options, Simulator};
use proptest::prelude::*;

/// The ends, and what an addition or a conversion may carry over them.
const EXTREMES: [Duration; 7] = [
    Duration::ZERO,
    Duration::from_nanos(1),
    Duration::from_millis(500),
    Duration::from_nanos(u64::MAX - 1),
    Duration::from_nanos(u64::MAX),
    Duration::from_secs(u64::MAX),
    Duration::MAX,
];

/// A time-out that never ends is given up after so many looks, of 50 ms each.
const LOOKS: u32 = 20;

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn patience() -> impl FnMut() -> bool {
    let mut looks = 0;
    move || {
        looks += 1;
        looks > LOOKS
    }
}

fn bus_on(simulator: &Simulator, options: BusOptions) -> Bus {
    let simulator = simulator.clone();
    let open = move || Ok(Box::new(simulator.open_line()?) as Box<dyn Line>);
    Bus::open(Box::new(open), options, &mut || false).unwrap()
}

fn pair() -> (Simulator, Bus) {
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    let bus = bus_on(&simulator, BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent));
    (simulator, bus)
}

fn read(bus: &Bus, raw: u8, options: CallOptions) -> Result<Done, Box<CallError>> {
    let request = Request::read(0x2100, 1).unwrap();
    bus.call(unit(raw).into(), &request, options, &mut patience(), &mut |_| ())
}

#[test]
fn a_time_out_without_an_end_is_as_good_as_any_to_a_unit_that_answers() {
    let (_simulator, bus) = pair();
    for timeout in [Duration::from_nanos(u64::MAX), Duration::MAX] {
        for verify in [false, true] {
            read(&bus, 1, CallOptions::new().timeout(timeout).retries(u32::MAX).verify(verify)).unwrap();
        }
    }
}

#[test]
fn a_read_that_has_to_be_confirmed_takes_any_time_out() {
    for timeout in EXTREMES {
        let (simulator, bus) = pair();
        simulator.wire().drop_answers(1);
        let options = CallOptions::new().timeout(timeout).retries(3).verify(true);
        let _ = read(&bus, 1, options);
        read(&bus, 1, CallOptions::new()).unwrap();
    }
}

#[test]
fn a_gap_without_an_end_waits_until_it_is_given_up() {
    for gap in EXTREMES {
        let (_simulator, bus) = pair();
        bus.configure(unit(1), UnitOptions::new().gap(gap).timeout(gap));
        assert_eq!(read(&bus, 1, CallOptions::new()).is_ok(), gap == Duration::from_millis(500), "{gap:?}");
        let poll = Poll::start(Arc::new(bus), vec![PollTarget::new(unit(1), vec![(0x2100, 1)])], None, 4);
        assert!(poll.unwrap().shortest() >= gap);
    }
}

#[test]
fn a_poll_takes_any_interval_and_any_wait() {
    let (_simulator, bus) = pair();
    let bus = Arc::new(bus);
    for interval in EXTREMES.into_iter().map(Some).chain([None]) {
        for timeout in EXTREMES {
            let target = PollTarget::new(unit(1), vec![(0x2100, 1)]);
            let Ok(poll) = Poll::start(Arc::clone(&bus), vec![target], interval, 4) else { continue };
            poll.wait(3, Some(timeout), &mut patience()).unwrap();
        }
    }
}

#[test]
fn to_sleep_and_to_listen_take_any_time() {
    let (_simulator, bus) = pair();
    for time in EXTREMES {
        bus.sleep(time, &mut patience());
        let _ = bus.listen(time, &mut patience(), &mut |_, _| ());
        let _ = bus.overhear(time, &mut patience(), &mut |_| ());
    }
}

#[test]
fn a_simulated_line_keeps_any_answer_back() {
    for time in EXTREMES {
        for kind in [FaultKind::Delay, FaultKind::Late, FaultKind::Overtaken, FaultKind::Unplug] {
            let (simulator, bus) = pair();
            let wire = simulator.wire();
            wire.set_delay(time);
            wire.set_late(time);
            wire.set_overtaken(time, time);
            wire.set_replug(time);
            wire.set_rate(kind, 1.0).unwrap();
            wire.delay_answers(time, 2);
            for _ in 0..3 {
                let _ = read(&bus, 1, CallOptions::new().retries(1));
            }
        }
    }
}

#[test]
fn virtual_time_passes_to_its_end() {
    for time in EXTREMES {
        let (simulator, bus) = pair();
        simulator.advance(time).unwrap();
        simulator.advance(time).unwrap();
        assert!(simulator.now() >= Instant::ZERO + time);
        let _ = read(&bus, 1, CallOptions::new());
    }
}

fn time() -> impl Strategy<Value = Duration> {
    prop_oneof![
        4 => prop::sample::select(&EXTREMES[..]),
        1 => any::<u64>().prop_map(Duration::from_nanos),
        1 => (any::<u64>(), 0..1_000_000_000_u32).prop_map(|(secs, nanos)| Duration::new(secs, nanos)),
    ]
}

fn number() -> impl Strategy<Value = u32> {
    prop_oneof![Just(0), Just(1), Just(2), Just(u32::MAX - 1), Just(u32::MAX)]
}

fn bus_options() -> impl Strategy<Value = BusOptions> {
    (time(), time(), number(), any::<(bool, bool)>()).prop_map(|(timeout, turnaround, retries, (learn, read_only))| {
        BusOptions::new(SerialFormat::DEFAULT)
            .timeout(timeout)
            .turnaround(turnaround)
            .retries(retries)
            .learn_timeout(learn)
            .read_only(read_only)
    })
}

fn call_options() -> impl Strategy<Value = CallOptions> {
    let priority = prop::sample::select(vec![Priority::Stop, Priority::Write, Priority::Read, Priority::Poll]);
    let times = (prop::option::of(time()), prop::option::of(number()));
    let rest = (any::<(bool, bool)>(), prop::option::of(Just(0x2100_u16)), prop::option::of(any::<u64>()));
    (times, prop::option::of(priority), rest).prop_map(
        |((timeout, retries), priority, (flags, read_back, connection))| {
            CallOptions::new()
                .timeout(timeout)
                .retries(retries)
                .priority(priority)
                .in_doubt(flags.0)
                .verify(flags.1)
                .read_back(read_back)
                .connection(connection)
        },
    )
}

fn asked() -> impl Strategy<Value = (u8, Request<'static>)> {
    const WORDS: [u16; 2] = [1, 2];
    prop::sample::select(vec![
        (0, Request::write(0x2000, 1)),
        (1, Request::read(0x2100, 1).unwrap()),
        (1, Request::write(0x2000, 1)),
        (1, Request::write_many(0x2001, &WORDS).unwrap()),
        (9, Request::read(0x2100, 1).unwrap()),
    ])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn no_option_makes_a_call_panic(
        bus_options in bus_options(),
        set in (prop::option::of(time()), prop::option::of(time())),
        calls in prop::collection::vec((asked(), call_options(), 0_u32..3), 1..5),
    ) {
        let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
        let bus = bus_on(&simulator, bus_options);
        bus.configure(unit(1), UnitOptions::new().timeout(set.0).gap(set.1));
        for ((raw, request), options, dropped) in calls {
            simulator.wire().drop_answers(dropped);
            let to = if raw == 0 { Destination::Broadcast } else { unit(raw).into() };
            // What comes of it is another test's: here it comes to an end.
            let _ = bus.call(to, &request, options, &mut patience(), &mut |_| ());
        }
    }
}
