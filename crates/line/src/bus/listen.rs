//! Hearing a line without asking anything: noise while nobody speaks, or another master at work.

use std::time::Duration;

use drivebus_rtu::Instant;

use crate::bus::Bus;
use crate::bus::shared::Shared;
use crate::error::Failure;
use crate::owner::Owner;
use crate::system::clock::LOOK_UP;
use crate::turns::order::Priority;

impl Bus {
    /// Gives `hear` what comes within `time`, each piece with the moment it was handed over. Nothing is sent.
    ///
    /// Others may ask in between, and wait 50 ms at most; the answers to their requests are theirs and are not heard here.
    /// What is heard belongs to no request of ours, and is counted so.
    ///
    /// # Errors
    ///
    /// [`Failure::Port`]: the line is lost. [`Failure::Interrupted`]: `give_up`, asked about every 50 ms, said so.
    /// [`Failure::Closed`]. [`Failure::NotBegun`]: from inside a `give_up` of the same thread.
    pub fn listen(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Instant, &[u8]),
    ) -> Result<(), Failure> {
        if self.is_closed() {
            return Err(Failure::Closed);
        }
        let result = self.shared.listen(time, give_up, hear);
        // Closed from inside `give_up`, where it could not wait for itself.
        if self.is_shut() {
            self.close();
        }
        result
    }
}

impl Shared {
    pub(super) fn listen_here(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Instant, &[u8]),
    ) -> Result<(), Failure> {
        let end = self.now() + time;
        loop {
            let _turn = self.queue.turn((Priority::Poll, None), give_up).map_err(|why| self.no_turn(why))?;
            let mut owner = self.lock();
            owner.prepare(give_up)?;
            let now = self.now_of(&owner);
            if now >= end {
                return Ok(());
            }
            owner.hear(end.min(now + LOOK_UP), hear)?;
            drop(owner);
            if self.is_shut() || give_up() {
                return Err(self.given_up());
            }
        }
    }
}

impl Owner {
    /// What comes until `until`, as strays: nothing is in flight.
    fn hear(&mut self, until: Instant, hear: &mut dyn FnMut(Instant, &[u8])) -> Result<(), Failure> {
        let mut buffer = [0; 256];
        while self.now() < until {
            let received = match self.line() {
                Some(line) => line.receive(&mut buffer, until),
                None => return Err(Failure::Closed),
            };
            let count = received.map_err(|error| {
                self.close(); // the next call opens it again
                Failure::Port(error)
            })?;
            let now = self.now();
            if count > 0 {
                hear(now, &buffer[..count]);
            }
            self.stray(now, &buffer[..count]);
        }
        Ok(())
    }
}
