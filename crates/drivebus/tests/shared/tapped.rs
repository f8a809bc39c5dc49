//! A simulated line that shows each frame of the master to a test before it goes out.

use std::fmt;

use drivebus::line::{Line, LineClock, PortError};
use drivebus::sim::{SimLine, Simulator};
use drivebus::{AdapterEcho, Bus, Instant};

struct Tapped<F> {
    line: SimLine,
    tap: F,
}

/// A bus over `simulator`, whose every frame `tap` sees, in the thread that sends it.
pub(crate) fn open(simulator: &Simulator, tap: impl FnMut(&[u8]) + Send + 'static) -> Bus {
    let mut line = Some(Tapped { line: simulator.line(), tap });
    let opener = move || Ok(Box::new(line.take().unwrap()) as Box<dyn Line>);
    Bus::builder().echo(AdapterEcho::Absent).open_with(Box::new(opener)).unwrap()
}

impl<F: FnMut(&[u8]) + Send> Line for Tapped<F> {
    fn now(&self) -> Instant {
        self.line.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        (self.tap)(bytes);
        self.line.send(bytes)
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

    fn clock(&self) -> Option<LineClock> {
        self.line.clock()
    }
}

impl<F> fmt::Debug for Tapped<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tapped").finish_non_exhaustive()
    }
}
