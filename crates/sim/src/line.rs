//! The simulated line as a [`Line`]: a master in the same process.

use std::sync::Arc;
use std::time::Duration;

use drivebus_line::{Line, LineClock, PortError, PortErrorKind};
use drivebus_rtu::Instant;

use crate::shared::Shared;
use crate::wire::Listener;
use crate::world::World;

/// A master's connection to a simulated line. Waiting on it makes virtual time jump.
#[derive(Debug)]
pub struct SimLine {
    shared: Arc<Shared>,
    listener: Listener,
    /// How often the adapter had been pulled out when this was opened.
    pulls: u64,
    /// Its own, as two masters on one line must not do the same in step.
    chance: u64,
}

impl SimLine {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        let mut world = shared.present();
        let (listener, pulls) = (world.attach(), world.pulls());
        let chance = listener.chance(world.seed());
        drop(world);
        Self { shared, listener, pulls, chance }
    }

    /// Whether the adapter that this was opened on is still plugged in.
    fn check(&self, world: &World) -> Result<(), PortError> {
        if world.is_plugged() && world.pulls() == self.pulls {
            return Ok(());
        }
        let message = "the simulated adapter was unplugged; open the line again when it is back";
        Err(PortError::new(PortErrorKind::Lost, &self.shared.name, message))
    }

    /// Lets time pass until `until`, or until bytes arrive if `buffer` has room for them; returns how many did.
    fn wait(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut world = self.shared.present();
        loop {
            self.check(&world)?;
            let count = world.take(self.listener, buffer);
            if count > 0 || world.now() >= until {
                return Ok(count);
            }
            let wakeup = world.next_wakeup().filter(|wakeup| wakeup.at < until);
            let next = wakeup.map_or(until, |wakeup| wakeup.at);
            if self.shared.clock.is_real() {
                drop(world);
                // The end of a wait is exact because the caller counts silence with it.
                self.shared.clock.wait(next, wakeup.is_none_or(|wakeup| wakeup.exact));
                world = self.shared.present();
            } else {
                world.advance(next);
            }
        }
    }
}

impl Line for SimLine {
    fn now(&self) -> Instant {
        self.shared.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut world = self.shared.present();
        self.check(&world)?;
        let now = world.now();
        Ok(world.transmit(self.listener, now, bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        self.wait(buffer, until)
    }

    fn sleep(&mut self, until: Instant) {
        // In virtual time nobody has to be awake for what happens meanwhile; time goes on without the adapter too.
        if self.is_virtual() || self.wait(&mut [], until).is_err() {
            self.shared.pass(until);
        }
    }

    fn name(&self) -> String {
        self.shared.name.clone()
    }

    /// In virtual time nobody minds waking up for each character, and each is told by its moment.
    fn char_time(&self) -> Option<Duration> {
        self.shared.clock.is_real().then(|| self.shared.present().wire.format().char_time())
    }

    /// Adapters do, and this one may be told to.
    fn may_echo(&self) -> bool {
        true
    }

    fn is_virtual(&self) -> bool {
        !self.shared.clock.is_real()
    }

    /// From the simulation's seed: the same simulation is asked the same.
    fn chance(&self) -> Option<u64> {
        Some(self.chance)
    }

    /// The simulation's, which goes on while the adapter is pulled out.
    fn clock(&self) -> Option<LineClock> {
        let shared = Arc::clone(&self.shared);
        Some(Arc::new(move || shared.now()))
    }
}

impl Drop for SimLine {
    fn drop(&mut self) {
        self.shared.lock().detach(self.listener);
    }
}
