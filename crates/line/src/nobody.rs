//! A line on which nobody is, for tests of what is decided beside it.

use drivebus_rtu::{Duration, Instant};

use crate::line::Opener;
use crate::line::{Line, PortError};

/// What the line says of itself.
#[derive(Debug, Default)]
pub(crate) struct Nobody {
    pub(crate) char_time: Option<Duration>,
    pub(crate) latency: Duration,
}

impl Line for Nobody {
    fn now(&self) -> Instant {
        Instant::ZERO
    }

    fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
        Ok(Instant::ZERO)
    }

    fn receive(&mut self, _: &mut [u8], _: Instant) -> Result<usize, PortError> {
        Ok(0)
    }

    fn sleep(&mut self, _: Instant) {}

    fn char_time(&self) -> Option<Duration> {
        self.char_time
    }

    fn latency(&self) -> Duration {
        self.latency
    }

    fn name(&self) -> String {
        "nobody".to_owned()
    }

    /// Its time stands still.
    fn is_virtual(&self) -> bool {
        true
    }
}

/// What opens such a line.
pub(crate) fn opener() -> Opener {
    Box::new(|| Ok(Box::new(Nobody::default())))
}
