//! The simulated line as a [`Line`]: a master in the same process.

use std::sync::Arc;

use drivebus_line::{Line, PortError};
use drivebus_rtu::Instant;

use crate::simulator::Shared;
use crate::world::Listener;

/// A master's connection to a simulated line. Waiting on it makes virtual time jump.
#[derive(Debug)]
pub struct SimLine {
    shared: Arc<Shared>,
    listener: Listener,
}

impl SimLine {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        let listener = shared.lock().attach();
        Self { shared, listener }
    }

    /// Lets time pass until `until`, or until bytes arrive if `buffer` has room for them; returns how many did.
    fn wait(&mut self, buffer: &mut [u8], until: Instant) -> usize {
        loop {
            let mut world = self.shared.present();
            let count = world.take(self.listener, buffer);
            if count > 0 || world.now() >= until {
                return count;
            }
            let wakeup = world.next_wakeup().filter(|wakeup| wakeup.at < until);
            let next = wakeup.map_or(until, |wakeup| wakeup.at);
            if self.shared.clock.is_real() {
                drop(world);
                // The end of a wait is exact because the caller counts silence with it.
                self.shared.clock.wait(next, wakeup.is_none_or(|wakeup| wakeup.exact));
            } else {
                world.advance(next);
            }
        }
    }
}

impl Line for SimLine {
    fn now(&self) -> Instant {
        self.shared.clock.now(self.shared.lock().now())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut world = self.shared.present();
        let now = world.now();
        Ok(world.transmit(now, bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        Ok(self.wait(buffer, until))
    }

    fn sleep(&mut self, until: Instant) {
        self.wait(&mut [], until);
    }

    fn name(&self) -> String {
        self.shared.name.clone()
    }

    fn is_virtual(&self) -> bool {
        !self.shared.clock.is_real()
    }
}

impl Drop for SimLine {
    fn drop(&mut self) {
        self.shared.lock().detach(self.listener);
    }
}
