//! Cyclic polling of simulated drives in virtual time: when each is asked, to the nanosecond, and what becomes of the others
//! when one of them dies, refuses, or the port is lost.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Failure, Line, LineClock, Poll, PollBatch, PollError,
    PollSample, PollTarget, PortError, UnitOptions,
};
use drivebus_rtu::{
    BeginError, DataBits, FIRST_CONTACT, Instant, Parity, Request, SerialFormat, Silence, StopBits, UnitAddress,
};
use drivebus_sim::{Options, SimLine, Simulator};

const STATE: u16 = 0x2100;
const MONITOR: u16 = 0x3000;
const NOT_THERE: u16 = 0x2FFF;
const RESPONSE_DELAY: u16 = 0x0E03; // P14.03
const TIMEOUT: Duration = Duration::from_millis(500);

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn target(raw: u8, reads: &[(u16, u16)]) -> PollTarget {
    PollTarget::new(unit(raw), reads.to_vec())
}

/// A line on which one unit does not hear what is sent to it: its wire is cut.
#[derive(Debug)]
struct Cut {
    line: SimLine,
    unit: Arc<AtomicU8>,
}

impl Line for Cut {
    fn now(&self) -> Instant {
        self.line.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        // The characters take their time, and nobody takes them for a request: their CRC is another one's.
        let mut sent = bytes.to_vec();
        if sent.first() == Some(&self.unit.load(Ordering::Relaxed)) {
            sent[0] = 99;
        }
        self.line.send(&sent)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        self.line.receive(buffer, until)
    }

    fn sleep(&mut self, until: Instant) {
        self.line.sleep(until);
    }

    fn name(&self) -> String {
        self.line.name()
    }

    fn is_virtual(&self) -> bool {
        self.line.is_virtual()
    }

    fn clock(&self) -> Option<LineClock> {
        self.line.clock()
    }
}

/// Units 1 to 3, which answer as soon as they may, on a bus that has been open for a while.
fn line_at(format: SerialFormat) -> (Simulator, Arc<Bus>) {
    line_with_cut(format, &Arc::default())
}

/// The same, and the unit in `cut` hears nothing.
fn line_with_cut(format: SerialFormat, cut: &Arc<AtomicU8>) -> (Simulator, Arc<Bus>) {
    let units = [(1, "gd350"), (2, "gd350"), (3, "gd350")];
    let simulator = Simulator::new(units, Options::default().format(format)).unwrap();
    for (raw, _) in units {
        simulator.drive(raw).unwrap().set_parameter(RESPONSE_DELAY, 0).unwrap();
    }
    let line = simulator.line();
    let (mut first, again, unit) = (Some(line), simulator.clone(), Arc::clone(cut));
    let opener = move || -> Result<Box<dyn Line>, PortError> {
        let line = first.take().map_or_else(|| again.open_line(), Ok)?;
        Ok(Box::new(Cut { line, unit: Arc::clone(&unit) }))
    };
    let options = BusOptions::new(format).echo(AdapterEcho::Absent).timeout(TIMEOUT);
    let bus = Bus::open(Box::new(opener), options, &mut || false).unwrap();
    bus.sleep(FIRST_CONTACT, &mut || false);
    (simulator, Arc::new(bus))
}

fn line() -> (Simulator, Arc<Bus>) {
    line_at(SerialFormat::DEFAULT)
}

fn poll(bus: &Arc<Bus>, targets: Vec<PollTarget>, interval: Option<Duration>) -> Poll {
    Poll::start(Arc::clone(bus), targets, interval, 100_000).unwrap()
}

/// Lets `poll` go on for `time`, and takes what came of it.
fn samples(poll: &Poll, time: Duration) -> PollBatch {
    poll.wait(usize::MAX, Some(time), &mut || false).unwrap();
    poll.take(usize::MAX)
}

fn sent(batch: &PollBatch, target: usize) -> Vec<Instant> {
    batch.iter().filter(|(sample, _)| sample.target == target).map(|(sample, _)| sample.sent).collect()
}

fn millis(count: u64) -> Duration {
    Duration::from_millis(count)
}

#[test]
fn without_an_interval_the_line_is_idle_only_when_the_protocol_says_so() {
    for baud_rate in [9_600, 19_200, 115_200] {
        let format = SerialFormat::new(baud_rate, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
        let (simulator, bus) = line_at(format);
        let targets = vec![target(1, &[(MONITOR, 16), (STATE, 1)]), target(2, &[(MONITOR, 1)])];
        let poll = poll(&bus, targets, None);
        let batch = samples(&poll, Duration::from_secs(10));
        // For each read: request, silence, answer, silence.
        let read = |words: u32| format.chars(8) + format.t35() + format.chars(5 + 2 * words) + format.t35();
        let cycle = read(16) + read(1) + read(1);
        assert_eq!(poll.shortest(), cycle);
        for target in [0, 1] {
            let sent = sent(&batch, target);
            assert!(sent.len() > 50);
            for pair in sent.windows(2) {
                assert_eq!(pair[1].saturating_duration_since(pair[0]), cycle, "target {target} at {format}");
            }
        }
        assert_eq!(simulator.wire().silence_violations(), 0);
        assert_eq!((poll.counts().missing, poll.counts().late, poll.counts().dropped), (0, 0, 0));
    }
}

#[test]
fn samples_hold_the_words_of_their_reads() {
    let (simulator, bus) = line();
    simulator.drive(2).unwrap().set_analog(1, 734).unwrap();
    let poll = poll(&bus, vec![target(1, &[(STATE, 1)]), target(2, &[(0x300C, 2), (STATE, 1)])], None);
    assert_eq!(poll.wait(2, None, &mut || false), Ok(2));
    let batch = poll.take(2);
    let words: Vec<_> = batch.iter().map(|(sample, words)| (sample.target, words)).collect();
    assert_eq!(words, [(0, &[3, 0, 0][..]), (1, &[734, 0, 3][..])], "stopped is 3");
}

#[test]
fn beats_come_to_the_nanosecond_and_do_not_drift() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(MONITOR, 16)]), target(2, &[(MONITOR, 16)])], Some(millis(70)));
    let sent = sent(&samples(&poll, Duration::from_secs(60)), 0);
    assert_eq!(sent.len(), 60_000_usize.div_ceil(70));
    for (beat, &moment) in sent.iter().enumerate() {
        assert_eq!(moment, sent[0] + millis(70) * u32::try_from(beat).unwrap());
    }
    assert_eq!(poll.counts().late, 0);
}

#[test]
fn a_rate_that_the_wire_cannot_carry_is_refused_with_the_shortest_interval() {
    let (simulator, bus) = line();
    let asked = simulator.wire().requests();
    let targets = || vec![target(1, &[(MONITOR, 16)])];
    // 8 + 3.5 + 37 + 3.5 characters of 11 bits at 19200 bit/s are 29.79 ms.
    let shortest = Poll::start(Arc::clone(&bus), targets(), None, 1).unwrap().shortest();
    assert_eq!(shortest.as_micros(), 29_791);
    let refused = Poll::start(Arc::clone(&bus), targets(), Some(millis(29)), 1).unwrap_err();
    assert!(matches!(refused, PollError::TooFast { shortest: known, .. } if known == shortest));
    assert!(refused.to_string().contains("at least 0.029792 s"), "{refused}");
    assert_eq!(simulator.wire().requests(), asked, "nothing is sent");
    let poll = poll(&bus, targets(), Some(shortest));
    samples(&poll, Duration::from_secs(1));
    assert_eq!(poll.counts().late, 0, "the shortest interval can be kept");
}

#[test]
fn a_unit_that_needs_a_longer_silence_makes_the_shortest_cycle_longer() {
    let (_simulator, bus) = line();
    let (t35, gap) = (bus.options().format.t35(), millis(20));
    let targets = || vec![target(1, &[(STATE, 1)]), target(2, &[(STATE, 1)])];
    let usual = poll(&bus, targets(), None).shortest();
    bus.configure(unit(1), UnitOptions::new().gap(gap));
    let (poll, cycle) = (poll(&bus, targets(), None), usual.saturating_sub(t35) + gap);
    assert_eq!(poll.shortest(), cycle);
    for pair in sent(&samples(&poll, Duration::from_secs(1)), 0).windows(2) {
        assert_eq!(pair[1].saturating_duration_since(pair[0]), cycle);
    }
}

#[test]
fn a_sample_begins_with_its_first_request() {
    let (_simulator, bus) = line();
    let format = bus.options().format;
    let poll = poll(&bus, vec![target(1, &[(STATE, 1), (MONITOR, 2)])], None);
    let read = |words: u32| format.chars(8) + format.t35() + format.chars(5 + 2 * words);
    for (sample, _) in samples(&poll, Duration::from_secs(1)).iter() {
        let time = sample.ended.saturating_duration_since(sample.sent);
        assert_eq!(time, read(1) + format.t35() + read(2));
    }
}

#[test]
fn a_unit_that_dies_costs_the_others_one_time_out_in_a_period() {
    let cut = Arc::default();
    let (_simulator, bus) = line_with_cut(SerialFormat::DEFAULT, &cut);
    let targets = (1..=3).map(|raw| target(raw, &[(MONITOR, 4)])).collect();
    let poll = poll(&bus, targets, Some(millis(100)));
    samples(&poll, Duration::from_secs(5));
    assert_eq!(poll.counts().missing, 0);

    cut.store(2, Ordering::Relaxed);
    let batch = samples(&poll, Duration::from_secs(60));
    let missing: Vec<_> =
        batch.iter().filter_map(|(sample, _)| sample.missing.as_ref().map(|why| (sample, why))).collect();
    assert!(missing.iter().all(|(sample, _)| sample.target == 1), "only the dead one is missing");
    let asked = |why: &CallError| !matches!(why.failure, Failure::NotAsked { .. });
    let timed_out = missing.iter().filter(|(_, why)| asked(why)).count();
    // Twice until it counts as dead, then after waits of 1, 2, 4 and 8 seconds and every 8 from then on: 11 times, where
    // the time-outs themselves took no time.
    assert!((10..=12).contains(&timed_out), "{timed_out}");
    assert_eq!(poll.counts().missing, missing.len() as u64);
    for other in [0, 2] {
        let sent = sent(&batch, other);
        let waits = sent.windows(2).map(|pair| pair[1].saturating_duration_since(pair[0]));
        let late: Vec<_> = waits.filter(|&wait| wait > millis(150)).collect();
        assert!(late.len() <= timed_out, "unit {} was kept waiting by {timed_out} time-outs: {late:?}", other + 1);
        assert!(late.iter().all(|&wait| wait < TIMEOUT + millis(150)), "one time-out at a time: {late:?}");
        // A time-out lasts five beats, and up to one more until the next one.
        assert!(sent.len() >= 600 - 6 * timed_out, "{} samples", sent.len());
    }

    cut.store(0, Ordering::Relaxed);
    samples(&poll, Duration::from_secs(9));
    let before = poll.counts().missing;
    samples(&poll, Duration::from_secs(5));
    assert_eq!(poll.counts().missing, before, "back within the longest period, and for good");
}

#[test]
fn a_refused_register_marks_its_own_sample() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(NOT_THERE, 1), (MONITOR, 1)]), target(2, &[(MONITOR, 1)])], None);
    let batch = samples(&poll, Duration::from_secs(1));
    let refused =
        |sample: &PollSample| sample.missing.as_ref().is_some_and(|why| matches!(why.failure, Failure::Refused { .. }));
    assert!(batch.len() > 10);
    assert!(batch.iter().all(|(sample, _)| refused(sample) == (sample.target == 0)), "{batch:?}");
}

#[test]
fn a_poll_of_the_dead_alone_does_not_run_away() {
    let (simulator, bus) = line();
    let read = Request::read(STATE, 1).unwrap();
    bus.call(unit(1).into(), &read, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
    let poll = poll(&bus, vec![target(9, &[(STATE, 1)])], None);
    let before = simulator.now();
    let batch = samples(&poll, Duration::from_secs(20));
    let time = simulator.now().saturating_duration_since(before);
    assert!((Duration::from_secs(20)..Duration::from_secs(21)).contains(&time), "{time:?}");
    assert!(batch.iter().all(|(sample, _)| sample.missing.is_some()));
    assert!(batch.len() <= 20 * 20, "{} samples: no more than one in 50 ms", batch.len());
}

#[test]
fn the_oldest_give_way_and_are_counted() {
    let (_simulator, bus) = line();
    let poll = Poll::start(Arc::clone(&bus), vec![target(1, &[(STATE, 1)])], Some(millis(100)), 4).unwrap();
    let batch = samples(&poll, millis(950));
    let sent = sent(&batch, 0);
    assert_eq!((sent.len(), poll.counts().dropped, poll.counts().cycles), (4, 6, 10));
    assert_eq!(sent[3].saturating_duration_since(sent[0]), millis(300), "the latest four");
}

#[test]
fn beats_that_pass_while_nobody_waits_are_late() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(STATE, 1)])], Some(millis(100)));
    assert_eq!(samples(&poll, millis(50)).len(), 1);
    bus.sleep(millis(1_000), &mut || false);
    // At 1.05 s the beat of 1.0 s is due; those of 0.1 to 0.9 are over.
    assert_eq!(samples(&poll, millis(100)).len(), 2);
    assert_eq!((poll.counts().late, poll.counts().cycles), (9, 3));
}

#[test]
fn a_poll_goes_on_when_the_port_is_back() {
    for interval in [None, Some(millis(100))] {
        let (simulator, bus) = line();
        let poll = poll(&bus, vec![target(1, &[(STATE, 1)]), target(2, &[(STATE, 1)])], interval);
        poll.wait(2, None, &mut || false).unwrap();
        assert_eq!(poll.take(2).iter().filter(|(sample, _)| sample.missing.is_some()).count(), 0);
        simulator.wire().unplug();
        poll.wait(6, None, &mut || false).unwrap();
        let lost =
            |sample: &PollSample| sample.missing.as_ref().is_some_and(|why| matches!(why.failure, Failure::Port(_)));
        assert!(poll.take(6).iter().all(|(sample, _)| lost(sample)));
        simulator.wire().replug().unwrap();
        poll.wait(4, None, &mut || false).unwrap();
        assert_eq!(poll.take(4).iter().filter(|(sample, _)| sample.missing.is_none()).count(), 4);
        assert_eq!(bus.stats().reconnects, 1);
    }
}

#[test]
fn while_the_port_is_lost_time_goes_on_and_ends_a_wait() {
    for interval in [None, Some(millis(100))] {
        let (simulator, bus) = line();
        let poll = poll(&bus, vec![target(1, &[(MONITOR, 2), (STATE, 1)]), target(2, &[(STATE, 1)])], interval);
        poll.wait(4, None, &mut || false).unwrap();
        simulator.wire().unplug();
        let pulled = simulator.now();
        // Counted in tries, not in looks, of which a busy machine has more: fifty tries take the half second.
        let does_not_end = || poll.counts().missing > 1_000;
        poll.wait(usize::MAX, Some(millis(500)), &mut || does_not_end()).unwrap();
        assert!(bus.now() >= pulled + millis(500), "the bus tells the time without its line");
        let batch = poll.take(usize::MAX);
        assert!(batch.iter().any(|(sample, _)| sample.missing.is_some() && sample.sent >= pulled));
        let mut last = Instant::ZERO;
        for (sample, _) in batch.iter() {
            assert!(last <= sample.sent && sample.sent <= sample.ended, "after {last:?} came {sample:?}");
            last = sample.ended;
        }
        assert!(last < pulled + millis(600), "no longer than it was waited for");
    }
}

#[test]
fn closing_the_bus_or_the_poll_ends_it_and_leaves_what_is_there() {
    let (simulator, bus) = line();
    let first = poll(&bus, vec![target(1, &[(STATE, 1)])], None);
    let second = poll(&bus, vec![target(2, &[(STATE, 1)])], None);
    for poll in [&first, &second] {
        poll.wait(3, None, &mut || false).unwrap();
        assert!(!poll.is_over());
    }
    first.close();
    assert!(first.is_over() && !second.is_over());
    assert_eq!(first.wait(9, None, &mut || false), Ok(3), "nothing more comes");
    let asked = simulator.wire().requests();
    bus.close();
    assert_eq!(second.wait(9, None, &mut || false), Ok(3));
    assert!(second.is_over());
    assert_eq!((first.take(9).len(), second.take(9).len()), (3, 3));
    assert_eq!(simulator.wire().requests(), asked);
    let late = Poll::start(bus, vec![target(1, &[(STATE, 1)])], None, 1).unwrap_err();
    assert_eq!(late, PollError::Bus(Failure::Closed));
}

#[test]
fn two_polls_share_a_line_and_each_keeps_its_beats() {
    let (simulator, bus) = line();
    let slow = poll(&bus, vec![target(1, &[(STATE, 1)])], Some(millis(500)));
    let fast = poll(&bus, vec![target(2, &[(STATE, 1)])], Some(millis(50)));
    let (mut beats, mut between) = (0, 0);
    for _ in 0..100 {
        beats += samples(&slow, millis(50)).len();
        between += samples(&fast, millis(50)).len();
    }
    // Each is let go on for every other 50 ms: the one finds each of its beats there, the other misses every second.
    assert_eq!((beats, slow.counts().late), (20, 0));
    assert_eq!(between, 100);
    assert!((99..=100).contains(&fast.counts().late), "{:?}", fast.counts());
    assert_eq!((slow.counts().missing, fast.counts().missing), (0, 0));
    assert_eq!(simulator.wire().silence_violations(), 0);
}

#[test]
fn two_polls_in_two_threads_ask_one_after_the_other() {
    let (simulator, bus) = line();
    let slow = poll(&bus, vec![target(1, &[(STATE, 1)])], Some(millis(500)));
    let fast = poll(&bus, vec![target(2, &[(STATE, 1)])], None);
    let mut asked: Vec<_> = std::thread::scope(|scope| {
        let polls = [&slow, &fast].map(|poll| scope.spawn(|| samples(poll, Duration::from_secs(10))));
        let batches = polls.map(|thread| thread.join().unwrap());
        batches.iter().flat_map(|batch| batch.iter().map(|(sample, _)| (sample.sent, sample.ended))).collect()
    });
    // Both move the same time: which of them the system lets run how often, nobody knows.
    asked.sort_unstable();
    assert!(asked.windows(2).all(|pair| pair[0].1 <= pair[1].0), "one at a time");
    for poll in [&slow, &fast] {
        let counts = poll.counts();
        assert!(counts.cycles > 0, "{counts:?}");
        assert_eq!(counts.missing, 0);
    }
    assert_eq!(simulator.wire().silence_violations(), 0);
}

#[test]
fn who_waits_can_give_up() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(STATE, 1)])], Some(Duration::from_secs(3_600)));
    assert_eq!(poll.wait(1, None, &mut || false), Ok(1));
    let mut asked = 0;
    let there = poll.wait(2, None, &mut || {
        asked += 1;
        asked == 3
    });
    assert_eq!((there, asked, poll.is_over()), (Ok(1), 3, false));
}

#[test]
fn who_waits_does_not_wait_for_itself() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(STATE, 1)])], Some(Duration::from_secs(3_600)));
    poll.wait(1, None, &mut || false).unwrap();
    let mut inside = None;
    poll.wait(2, None, &mut || {
        inside = Some(poll.wait(2, None, &mut || false));
        true
    })
    .unwrap();
    assert_eq!(inside, Some(Err(Failure::NotBegun(BeginError::OutOfTurn))));
    assert_eq!(poll.wait(2, Some(Duration::from_secs(3_600)), &mut || false), Ok(2), "afterwards as always");
}

#[test]
fn who_cannot_wait_is_called_once() {
    let (_simulator, bus) = line();
    let poll = poll(&bus, vec![target(1, &[(STATE, 1)])], None);
    let (called, calls) = mpsc::channel();
    let call = |name: &'static str, count, wanted: bool| {
        let called = called.clone();
        let wanted = Arc::new(AtomicBool::new(wanted));
        poll.call_when(count, wanted, move || called.send(name).unwrap());
    };
    call("three", 3, true);
    call("two", 2, true);
    call("not any more", 2, false);
    call("never", 99, true);
    for (there, expected) in [(1, vec![]), (2, vec!["two"]), (5, vec!["three"])] {
        poll.wait(there, None, &mut || false).unwrap();
        assert_eq!(calls.try_iter().collect::<Vec<_>>(), expected, "{there} samples");
    }
    call("at once", 5, true);
    assert_eq!(calls.try_iter().collect::<Vec<_>>(), ["at once"]);
    poll.close();
    assert_eq!(calls.try_iter().collect::<Vec<_>>(), ["never"], "it has ended");
}
