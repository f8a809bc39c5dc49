//! The time of a virtual line that has no clock of its own, asked for from inside of what the line calls.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Direction, Failure, Line, PortError};
use drivebus_rtu::{Instant, Request, SerialFormat, UnitAddress};

/// Ends a test that has failed.
const LONG: Duration = Duration::from_secs(20);

/// A line on which nobody answers. Its time passes while it is waited on, and only it tells the time.
#[derive(Debug)]
struct Silent(Instant);

impl Line for Silent {
    fn now(&self) -> Instant {
        self.0
    }

    fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
        Ok(self.0 + Duration::from_millis(5))
    }

    fn receive(&mut self, _: &mut [u8], until: Instant) -> Result<usize, PortError> {
        self.0 = self.0.max(until);
        Ok(0)
    }

    fn sleep(&mut self, until: Instant) {
        self.0 = self.0.max(until);
    }

    fn name(&self) -> String {
        "silent".to_owned()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

#[test]
fn who_watches_and_who_is_asked_whether_to_go_on_may_ask_for_the_time() {
    let (done, ends) = channel();
    let test = thread::spawn(move || {
        let start = Instant::ZERO + Duration::from_secs(5);
        let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent);
        let open = Box::new(move || Ok(Box::new(Silent(start)) as Box<dyn Line>));
        let bus = Arc::new(Bus::open(open, options, &mut || false).unwrap());
        let seen = Arc::new(Mutex::new(Vec::new()));
        let (watching, moments) = (Arc::clone(&bus), Arc::clone(&seen));
        bus.watch(Some(Arc::new(move |traced| {
            if traced.direction == Direction::Sent {
                moments.lock().unwrap().push((traced.at, watching.now()));
            }
        })));
        let mut asked = Vec::new();
        let request = Request::read(0, 1).unwrap();
        let unit = UnitAddress::new(1).unwrap().into();
        let call = CallOptions::new().timeout(Duration::from_millis(500)).retries(0);
        let mut give_up = || {
            asked.push(bus.now());
            false
        };
        let error = bus.call(unit, &request, call, &mut give_up, &mut |_| ()).unwrap_err();
        assert!(matches!(error.failure, Failure::NoAnswer { .. }), "{error}");
        let seen = seen.lock().unwrap().clone();
        assert!(!seen.is_empty() && seen.iter().all(|(at, now)| at == now), "{seen:?}");
        assert!(
            asked.is_sorted() && asked.first() >= Some(&start) && asked.last() <= error.ended.as_ref(),
            "{asked:?}"
        );
        bus.watch(None);
        assert_eq!(Some(bus.now()), error.ended);
        done.send(()).unwrap();
    });
    assert_ne!(ends.recv_timeout(LONG), Err(RecvTimeoutError::Timeout), "it waits for itself");
    test.join().unwrap();
}
