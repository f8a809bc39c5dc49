//! Errands: requests that wait in the queue of a bus without a thread, against a simulated drive in virtual time.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Errand, Failure, Line, PortError, Priority, Reply, Running,
};
use drivebus_rtu::{Answer, Instant, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, SimLine, Simulator};

const IDENTIFICATION: u16 = 0x2103;
const ACCELERATION: u16 = 0x800B; // P00.11 in RAM

type Outcome = Result<Reply, Box<CallError>>;

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn simulator() -> Simulator {
    Simulator::new([(1, "gd350"), (2, "gd350")], Options::default()).unwrap()
}

fn open(line: impl Line + 'static, read_only: bool) -> Arc<Bus> {
    let mut line = Some(line);
    let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).read_only(read_only);
    Arc::new(Bus::open(Box::new(move || Ok(Box::new(line.take().unwrap()))), options, &mut || false).unwrap())
}

fn pair() -> (Simulator, Arc<Bus>) {
    let simulator = simulator();
    let bus = open(simulator.line(), false);
    (simulator, bus)
}

/// Sends an errand whose outcome comes with `name`.
fn send(
    bus: &Arc<Bus>,
    name: u32,
    request: &Request<'_>,
    options: CallOptions,
    to: &Sender<(u32, Outcome)>,
) -> Option<Running> {
    let to = to.clone();
    bus.send(Errand::new(unit(1).into(), request, options, move |outcome| to.send((name, outcome)).unwrap()))
}

fn identify() -> Request<'static> {
    Request::read(IDENTIFICATION, 1).unwrap()
}

fn word(reply: &Reply) -> u16 {
    let Ok(Answer::Read { words, .. }) = Answer::parse(&reply.pdu) else { return 0 };
    words.iter().next().unwrap_or_default()
}

/// Somebody who has the line until told to let go: whatever is sent meanwhile stands in the queue.
fn hold(bus: &Arc<Bus>) -> (Sender<()>, std::thread::JoinHandle<()>) {
    let (let_go, told) = channel::<()>();
    let (has_it, held) = channel();
    let bus = Arc::clone(bus);
    let thread = std::thread::spawn(move || {
        let told = Mutex::new(told);
        let mut once = Some(has_it);
        bus.call(unit(2).into(), &identify(), CallOptions::default(), &mut || false, &mut |_| {
            once.take().unwrap().send(()).unwrap();
            told.lock().unwrap().recv().unwrap();
        })
        .unwrap();
    });
    held.recv().unwrap();
    (let_go, thread)
}

/// The names of the next `count` that were answered, in the order in which they went out: callbacks have threads of their own.
fn names(outcomes: &Receiver<(u32, Outcome)>, count: usize) -> Vec<u32> {
    // The limit only ends a test that has failed.
    let told = || outcomes.recv_timeout(Duration::from_secs(20)).unwrap();
    let mut told: Vec<_> =
        (0..count).map(|_| told()).map(|(name, outcome)| (outcome.unwrap().done.sent, name)).collect();
    told.sort_unstable();
    told.into_iter().map(|(_, name)| name).collect()
}

#[test]
fn every_errand_gets_its_own_answer() {
    let (simulator, bus) = pair();
    let (to, outcomes) = channel();
    for name in 0..500_u32 {
        let unit = unit(1 + u8::try_from(name % 2).unwrap());
        let to = to.clone();
        bus.send(Errand::new(unit.into(), &identify(), CallOptions::default(), move |outcome| {
            to.send((name, outcome)).unwrap();
        }));
    }
    for _ in 0..500 {
        let (_, outcome) = outcomes.recv().unwrap();
        assert_eq!(word(&outcome.unwrap()), 0x01A0);
    }
    assert_eq!(simulator.wire().silence_violations(), 0);
}

#[test]
fn errands_keep_the_order_of_the_queue() {
    let (_simulator, bus) = pair();
    let (to, outcomes) = channel();
    let (let_go, holder) = hold(&bus);
    let urgent = CallOptions::new().priority(Priority::Stop);
    let polled = CallOptions::new().priority(Priority::Poll);
    send(&bus, 1, &identify(), polled, &to);
    send(&bus, 2, &identify(), CallOptions::default(), &to);
    send(&bus, 3, &Request::write(ACCELERATION, 20), CallOptions::default(), &to);
    send(&bus, 4, &identify(), CallOptions::default(), &to);
    send(&bus, 5, &identify(), urgent, &to);
    let_go.send(()).unwrap();
    assert_eq!(names(&outcomes, 5), [5, 3, 2, 4, 1]);
    holder.join().unwrap();
}

/// A stop overtakes what waits. The start that it overtook would follow it.
#[test]
fn a_stop_takes_back_the_start_that_waits_for_the_line() {
    let (simulator, bus) = pair();
    let (to, outcomes) = channel();
    let (let_go, holder) = hold(&bus);
    let (start, stop) = (Request::write(0x2000, 1), Request::write(0x2000, 5));
    let decided = CallOptions::new().halts(bus.halts(unit(1)));
    send(&bus, 1, &start, decided, &to);
    send(&bus, 2, &Request::write(ACCELERATION, 20), CallOptions::new(), &to);
    send(&bus, 3, &stop, CallOptions::new().urgent(&stop), &to);
    // To read urgently is no stop.
    send(&bus, 4, &identify(), CallOptions::new().urgent(&identify()), &to);
    let_go.send(()).unwrap();
    holder.join().unwrap();
    let told = || outcomes.recv_timeout(Duration::from_secs(20)).unwrap();
    let mut told: Vec<_> = (0..4).map(|_| told()).collect();
    told.sort_unstable_by_key(|&(name, _)| name);
    let failed: Vec<_> = told.into_iter().map(|(_, outcome)| outcome.err().map(|error| error.failure)).collect();
    assert_eq!(failed, [Some(Failure::Halted { unit: 1 }), None, None, None]);
    let values: Vec<u16> = simulator.drive(1).unwrap().writes().iter().map(|write| write.value).collect();
    assert_eq!(values, [5, 20]);
}

#[test]
fn what_is_taken_back_is_neither_sent_nor_told() {
    let (simulator, bus) = pair();
    let (to, outcomes) = channel();
    let (let_go, holder) = hold(&bus);
    let first = send(&bus, 1, &Request::write(ACCELERATION, 20), CallOptions::default(), &to).unwrap();
    send(&bus, 2, &identify(), CallOptions::default(), &to);
    first.abandon();
    let_go.send(()).unwrap();
    assert_eq!(names(&outcomes, 1), [2]);
    holder.join().unwrap();
    first.abandon(); // long over
    drop(to);
    assert!(outcomes.try_recv().is_err());
    assert!(simulator.drive(1).unwrap().writes().is_empty());
}

/// Who is told that a request is on the wire, and who says that time may go on.
type Meeting = (Sender<()>, Receiver<()>);

/// A line on which a request can be met: time stands still while it is on the wire.
#[derive(Debug)]
struct Met {
    line: SimLine,
    meeting: Arc<Mutex<Option<Meeting>>>,
}

impl Line for Met {
    fn now(&self) -> Instant {
        self.line.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let sent = self.line.send(bytes);
        if let Some((met, go_on)) = self.meeting.lock().unwrap().take() {
            met.send(()).unwrap();
            go_on.recv().unwrap();
        }
        sent
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
        true
    }
}

#[test]
fn what_is_abandoned_on_the_wire_ends_and_is_not_repeated() {
    let (simulator, meeting) = (simulator(), Arc::default());
    let bus = open(Met { line: simulator.line(), meeting: Arc::clone(&meeting) }, false);
    bus.call(unit(1).into(), &identify(), CallOptions::default(), &mut || false, &mut |_| {}).unwrap();
    simulator.wire().drop_answers(1000);
    let before = simulator.wire().requests();

    let ((met, it_is_met), (go_on, may_go_on)) = (channel(), channel());
    *meeting.lock().unwrap() = Some((met, may_go_on));
    let (to, outcomes) = channel();
    let options = CallOptions::new().retries(50);
    let running = send(&bus, 1, &identify(), options, &to).unwrap();
    it_is_met.recv().unwrap();
    running.abandon();
    go_on.send(()).unwrap();
    let (_, outcome) = outcomes.recv().unwrap();
    assert!(matches!(outcome.unwrap_err().failure, Failure::NoAnswer { .. }), "it was left to end");
    assert_eq!(simulator.wire().requests(), before + 1);
}

#[test]
fn a_slow_callback_holds_up_nobodys_errands() {
    let (simulator, bus) = pair();
    // Its first contact is over: whoever stands by for that goes on otherwise.
    bus.call(unit(1).into(), &identify(), CallOptions::default(), &mut || false, &mut |_| {}).unwrap();
    let ((called, it_is_called), (return_now, may_return)) = (channel(), channel::<()>());
    bus.send(Errand::new(unit(1).into(), &identify(), CallOptions::default(), move |_| {
        called.send(()).unwrap();
        let _ = may_return.recv();
    }));
    it_is_called.recv().unwrap();

    let (to, outcomes) = channel();
    let stop = CallOptions::new().priority(Priority::Stop).in_doubt(true);
    send(&bus, 1, &Request::write(0x2000, 5), stop, &to);
    send(&bus, 2, &identify(), CallOptions::default(), &to);
    assert_eq!(names(&outcomes, 2), [1, 2]);
    assert_eq!(simulator.drive(1).unwrap().writes().len(), 1);
    drop(return_now);
}

#[test]
fn closing_tells_all_who_wait() {
    let (_simulator, bus) = pair();
    let (to, outcomes) = channel();
    let (let_go, holder) = hold(&bus);
    for name in 0..10 {
        send(&bus, name, &identify(), CallOptions::default(), &to);
    }
    let closer = {
        let bus = Arc::clone(&bus);
        std::thread::spawn(move || bus.close())
    };
    for _ in 0..10 {
        assert_eq!(outcomes.recv().unwrap().1.unwrap_err().failure, Failure::Closed);
    }
    let_go.send(()).unwrap();
    closer.join().unwrap();
    holder.join().unwrap();
    assert!(send(&bus, 11, &identify(), CallOptions::default(), &to).is_none());
    assert_eq!(outcomes.recv().unwrap().1.unwrap_err().failure, Failure::Closed);
}

#[test]
fn a_read_only_bus_refuses_before_anything_waits() {
    let bus = open(simulator().line(), true);
    let (to, outcomes) = channel();
    assert!(send(&bus, 1, &Request::write(ACCELERATION, 20), CallOptions::default(), &to).is_none());
    assert!(matches!(outcomes.recv().unwrap().1.unwrap_err().failure, Failure::ReadOnly { function: 6 }));
}

#[test]
fn who_panics_when_told_ends_no_other_errand() {
    let (_simulator, bus) = pair();
    let (to, outcomes) = channel();
    bus.send(Errand::new(unit(1).into(), &identify(), CallOptions::default(), |_| panic!("a test")));
    send(&bus, 1, &identify(), CallOptions::default(), &to);
    assert_eq!(word(&outcomes.recv().unwrap().1.unwrap()), 0x01A0);
}
