//! Errands and callers at a bus, and how it ends: whoever left something is told of it once, and nobody waits for ever.

use std::sync::{Arc, Mutex, PoisonError};

use drivebus_rtu::{Duration, Instant, Request, SerialFormat, UnitAddress};
use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::mpsc::{Receiver, Sender, channel};
use shuttle::thread;

use super::{Line as Used, join};
use crate::bus::Bus;
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::bus::workers::Running;
use crate::error::Failure;
use crate::line::{Line, PortError};
use crate::options::{BusOptions, CallOptions};
use crate::system::clock;
use crate::turns::order::Priority;

/// What went over a line, by the address that each request has.
pub(super) type Sent = Arc<Mutex<Vec<u16>>>;

/// A line that notices when two have it, and keeps what was sent.
#[derive(Debug)]
struct Noticing {
    used: Arc<Used>,
    sent: Sent,
}

impl Line for Noticing {
    fn now(&self) -> Instant {
        clock::monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        self.used.is_used();
        let address = u16::from_be_bytes([bytes[2], bytes[3]]);
        self.sent.lock().unwrap_or_else(PoisonError::into_inner).push(address);
        Ok(clock::monotonic())
    }

    fn receive(&mut self, _: &mut [u8], _: Instant) -> Result<usize, PortError> {
        Ok(0)
    }

    fn sleep(&mut self, _: Instant) {}

    fn name(&self) -> String {
        String::from("a line")
    }
}

/// A bus, and what goes over its line.
pub(super) fn open() -> (Arc<Bus>, Sent) {
    clock::set(false);
    let (used, sent) = (Arc::<Used>::default(), Sent::default());
    let lines = Arc::clone(&sent);
    let opener = move || {
        let line: Box<dyn Line> = Box::new(Noticing { used: Arc::clone(&used), sent: Arc::clone(&lines) });
        Ok(line)
    };
    #[expect(clippy::unwrap_used, reason = "a scenario is a test")]
    let bus = Bus::open(Box::new(opener), BusOptions::new(SerialFormat::DEFAULT)).unwrap();
    (Arc::new(bus), sent)
}

pub(super) fn sent_by(sent: &Sent) -> Vec<u16> {
    sent.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// What is told of errands: which one, and whether it was carried out.
type Told = (u16, Result<(), Failure>);

fn options(priority: Priority) -> CallOptions {
    CallOptions { priority: Some(priority), ..CallOptions::default() }
}

/// Leaves a write to `address` of unit 1.
fn leave(bus: &Arc<Bus>, address: u16, priority: Priority, tell: &Sender<Told>) -> Option<Running> {
    leave_with(bus, address, options(priority), tell)
}

fn leave_with(bus: &Arc<Bus>, address: u16, options: CallOptions, tell: &Sender<Told>) -> Option<Running> {
    let tell = tell.clone();
    let errand = Errand::new(UnitAddress::MIN.into(), &Request::write(address, 1), options, move |outcome| {
        // Who left it may not want to know any more.
        let _ = tell.send((address, outcome.map(drop).map_err(|error| error.failure)));
    });
    bus.send(errand)
}

/// A caller in its own thread: as `Bus::call` does.
pub(super) fn call(
    bus: &Bus,
    address: u16,
    priority: Priority,
    give_up: &mut dyn FnMut() -> bool,
) -> Result<(), Failure> {
    call_with(bus, address, options(priority), give_up)
}

fn call_with(bus: &Bus, address: u16, options: CallOptions, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
    let request = Request::write(address, 1);
    let ask = bus.port().ask(UnitAddress::MIN.into(), &request, &options);
    let mut give_up = || bus.is_shut() || give_up();
    let result = Call::new(bus.port(), ask, options).run(&mut give_up, &mut |_| {});
    if bus.is_shut() {
        bus.close();
    }
    result.map(drop).map_err(|error| error.failure)
}

/// Until so many wait.
pub(super) fn wait_for(bus: &Bus, count: usize) {
    while bus.queue().lock().order.len() < count {
        thread::yield_now();
    }
}

/// What is told by now, and by all who still will.
fn all(told: &Receiver<Told>) -> Vec<Told> {
    let mut all: Vec<_> = std::iter::from_fn(|| told.recv().ok()).collect();
    all.sort_unstable_by_key(|(address, _)| *address);
    all
}

fn was_done_or_closed(outcome: &Result<(), Failure>) -> bool {
    matches!(outcome, Ok(()) | Err(Failure::Closed))
}

/// Errands of two threads, and a caller that waits in its own: all are carried out and told of.
pub(super) fn errands_and_callers() {
    let (bus, sent) = open();
    let (tell, told) = channel();
    let leaves = [1, 3].map(|first| {
        let (bus, tell) = (Arc::clone(&bus), tell.clone());
        thread::spawn(move || {
            for address in [first, first + 1] {
                assert!(leave(&bus, address, Priority::Write, &tell).is_some());
            }
        })
    });
    assert_eq!(call(&bus, 9, Priority::Read, &mut || false), Ok(()));
    join(leaves);
    let mut done: Vec<_> = (0..4).map(|_| told.recv()).collect();
    done.sort_unstable_by_key(|told| told.as_ref().map_or(0, |(address, _)| *address));
    assert_eq!(done, [1, 2, 3, 4].map(|address| Ok((address, Ok(())))));
    let mut sent = sent_by(&sent);
    sent.sort_unstable();
    assert_eq!(sent, [1, 2, 3, 4, 9]);
    bus.close();
    drop(tell);
    assert!(told.recv().is_err(), "told once");
}

/// An errand that nobody wants any more is sent once or not at all, told of once or not at all, and what waits behind it has
/// its turn.
pub(super) fn an_errand_is_abandoned() {
    let (bus, sent) = open();
    let (tell, told) = channel();
    let first = leave(&bus, 1, Priority::Write, &tell);
    let second = leave(&bus, 2, Priority::Write, &tell);
    drop(tell);
    let gives_up = thread::spawn(move || {
        if let Some(running) = first {
            running.abandon();
        }
    });
    assert_eq!(call(&bus, 9, Priority::Read, &mut || false), Ok(()));
    join([gives_up]);
    assert!(second.is_some());
    let told = all(&told);
    let mut sent = sent_by(&sent);
    sent.sort_unstable();
    assert!(sent == [1, 2, 9] || sent == [2, 9], "{sent:?}");
    assert_eq!(told.last(), Some(&(2, Ok(()))));
    let first = &told[..told.len() - 1];
    // It was on its way, and was sent or not; or nobody is told.
    assert!(first.len() <= 1 && first.iter().all(|(_, outcome)| outcome.is_ok() == sent.contains(&1)), "{first:?}");
    bus.close();
}

/// A stop among errands is next where it waits when the line comes free.
pub(super) fn an_urgent_errand_is_next() {
    let (bus, sent) = open();
    let (tell, told) = channel();
    let turn = bus.queue().turn((Priority::Read, None), &mut || false);
    assert!(turn.is_ok(), "it is free");
    let leaves = [(1, Priority::Poll), (2, Priority::Stop), (3, Priority::Write)].map(|(address, priority)| {
        let (bus, tell) = (Arc::clone(&bus), tell.clone());
        thread::spawn(move || assert!(leave(&bus, address, priority, &tell).is_some()))
    });
    join(leaves);
    drop(turn);
    drop(tell);
    assert_eq!(all(&told), [1, 2, 3].map(|address| (address, Ok(()))));
    assert_eq!(sent_by(&sent), [2, 3, 1]);
    bus.close();
}

/// Two starts that were decided on before a stop is told, one left and one called: none of them is sent behind it.
pub(super) fn no_start_follows_a_stop() {
    const STOP: u16 = 9;
    let (bus, sent) = open();
    let (tell, told) = channel();
    let start = options(Priority::Write).halts(bus.halts(UnitAddress::MIN));
    let calls = {
        let (bus, tell) = (Arc::clone(&bus), tell.clone());
        thread::spawn(move || {
            let outcome = call_with(&bus, 1, start, &mut || false);
            assert!(tell.send((1, outcome)).is_ok());
        })
    };
    let leaves = {
        let (bus, tell) = (Arc::clone(&bus), tell.clone());
        thread::spawn(move || assert!(leave_with(&bus, 2, start, &tell).is_some()))
    };
    assert_eq!(call(&bus, STOP, Priority::Stop, &mut || false), Ok(()));
    drop(tell);
    join([calls, leaves]);
    let (told, sent) = (all(&told), sent_by(&sent));
    assert_eq!(sent.last(), Some(&STOP), "{sent:?}");
    for (address, outcome) in told {
        let wanted = if sent.contains(&address) { Ok(()) } else { Err(Failure::Halted { unit: 1 }) };
        assert_eq!(outcome, wanted, "{sent:?}");
    }
    bus.close();
}

/// A bus that is closed while it is at work: every errand is told of once, callers come to their end, and behind that nothing
/// is sent.
pub(super) fn a_bus_is_closed() {
    let (bus, sent) = open();
    let (tell, told) = channel();
    let leaves = {
        let (bus, tell) = (Arc::clone(&bus), tell.clone());
        thread::spawn(move || {
            for address in [1, 2] {
                drop(leave(&bus, address, Priority::Write, &tell));
            }
        })
    };
    let calls = {
        let bus = Arc::clone(&bus);
        thread::spawn(move || {
            assert!(was_done_or_closed(&call(&bus, 9, Priority::Read, &mut || false)));
        })
    };
    bus.close();
    let by_then = sent_by(&sent);
    assert!(leave(&bus, 3, Priority::Stop, &tell).is_none());
    drop(tell);
    join([leaves, calls]);
    let told = all(&told);
    assert_eq!(told.iter().map(|(address, _)| *address).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(told.iter().all(|(_, outcome)| was_done_or_closed(outcome)), "{told:?}");
    assert_eq!(told[2].1, Err(Failure::Closed));
    assert_eq!(sent_by(&sent), by_then, "nothing is sent behind the close");
}

/// A bus that is closed inside of what a caller is asked while it waits: the caller closes the line when it ends.
pub(super) fn a_bus_is_closed_by_who_waits() {
    let (bus, _) = open();
    clock::set(true);
    let (tell, told) = channel();
    let calls = {
        let bus = Arc::clone(&bus);
        thread::spawn(move || {
            let result = call(&bus, 9, Priority::Write, &mut || {
                if thread_rng().r#gen() {
                    bus.port().close();
                }
                false
            });
            assert!(was_done_or_closed(&result), "{result:?}");
        })
    };
    drop(leave(&bus, 1, Priority::Write, &tell));
    drop(tell);
    let told = all(&told);
    assert!(matches!(&told[..], [(1, outcome)] if was_done_or_closed(outcome)), "{told:?}");
    join([calls]);
    bus.close();
}

/// A bus that nobody has any more while it is at work: every errand is told of once, and its threads end.
pub(super) fn a_bus_is_dropped() {
    let (bus, sent) = open();
    let (tell, told) = channel();
    for address in [1, 2] {
        assert!(leave(&bus, address, Priority::Write, &tell).is_some());
    }
    drop((bus, tell));
    let told = all(&told);
    assert_eq!(told.iter().map(|(address, _)| *address).collect::<Vec<_>>(), [1, 2]);
    for (address, outcome) in told {
        assert!(was_done_or_closed(&outcome), "{outcome:?}");
        assert_eq!(outcome.is_ok(), sent_by(&sent).contains(&address));
    }
    // As long as a call under way takes at most.
    assert!(clock::monotonic() < Instant::ZERO + Duration::from_secs(1));
}
