//! A cable that is pulled out of one drive's line and comes back in another's, both on one clock.

use std::sync::Arc;
use std::time::Duration;

use drivebus::line::{Line, LineClock, PortError};
use drivebus::sim::{FaultKind, SimLine, Simulator};
use drivebus::{Bus, Instant};

/// A bus to the drive of `here`, whose port is lost at the answer of that number; opened again it leads to that of `there`.
pub(crate) fn lost_at(answer: u64, here: &Simulator, there: &Simulator) -> Bus {
    here.wire().script(&[(answer, FaultKind::Unplug)]);
    let both = [here.clone(), there.clone()];
    let mut lines = both.clone().into_iter();
    Bus::builder()
        .open_with(Box::new(move || {
            let simulator = lines.next().unwrap_or_else(|| both[1].clone());
            keep_in_step(&both);
            Ok(Box::new(Cable { line: simulator.open_line()?, both: both.clone() }))
        }))
        .unwrap()
}

#[derive(Debug)]
struct Cable {
    line: SimLine,
    both: [Simulator; 2],
}

fn now_of(both: &[Simulator; 2]) -> Instant {
    both[0].now().max(both[1].now())
}

fn keep_in_step(both: &[Simulator; 2]) {
    let now = now_of(both);
    for simulator in both {
        simulator.advance(now.saturating_duration_since(simulator.now())).unwrap();
    }
}

impl Line for Cable {
    fn now(&self) -> Instant {
        now_of(&self.both)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        keep_in_step(&self.both);
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        keep_in_step(&self.both);
        self.line.receive(buffer, until)
    }

    fn sleep(&mut self, until: Instant) {
        keep_in_step(&self.both);
        self.line.sleep(until);
    }

    fn name(&self) -> String {
        self.line.name()
    }

    fn char_time(&self) -> Option<Duration> {
        self.line.char_time()
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn chance(&self) -> Option<u64> {
        self.line.chance()
    }

    fn clock(&self) -> Option<LineClock> {
        let both = self.both.clone();
        Some(Arc::new(move || now_of(&both)))
    }
}
