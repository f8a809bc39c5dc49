//! Hearing a line without asking anything: noise while nobody speaks, another master at work, or all that there is.

use std::time::Duration;

use drivebus_rtu::Instant;

use crate::bus::Bus;
use crate::bus::port::Port;
use crate::error::Failure;
use crate::owner::Owner;
use crate::system::clock::LOOK_UP;
use crate::trace::{Direction, Overheard};
use crate::turns::order::Priority;

/// For so long at a time the line is listened to while it could be used.
const EACH: Duration = Duration::from_millis(10);
/// After a request of ours, for so long nobody needs to listen besides: who asks hears it all.
const OWN: Duration = Duration::from_millis(500);

impl Bus {
    /// Gives `hear` all that goes over the line within `time`, as it comes: what others say, what is asked by anybody on
    /// this bus, and what comes of it. Nothing is sent for it. Where nothing comes, `hear` is called every 50 ms with no
    /// bytes, so that it knows the time.
    ///
    /// Where another program has the port, that one hears it.
    ///
    /// # Errors
    ///
    /// As [`listen`](Self::listen).
    pub fn overhear(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Overheard),
    ) -> Result<(), Failure> {
        if self.is_closed() {
            return Err(Failure::Closed);
        }
        let result = self.shared.overhear(time, give_up, hear);
        if self.is_shut() {
            self.close();
        }
        result
    }

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

impl Port {
    pub(super) fn listen(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Instant, &[u8]),
    ) -> Result<(), Failure> {
        let end = self.now() + time;
        loop {
            let turn = self.queue.turn((Priority::Poll, None), give_up).map_err(|why| self.no_turn(why))?;
            let mut owner = self.lock();
            owner.prepare(give_up)?;
            let now = self.now_of(&owner);
            if now >= end {
                return Ok(());
            }
            let mut pieces = Vec::new();
            let heard = owner.hear(end.min(now + LOOK_UP), &mut |at, bytes| pieces.push((at, bytes.to_vec())));
            drop(owner);
            drop(turn);
            // However long that takes, others use the line meanwhile.
            for (at, bytes) in &pieces {
                hear(*at, bytes);
            }
            heard?;
            if self.is_shut() || give_up() {
                return Err(self.given_up());
            }
        }
    }

    pub(super) fn overhear(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Overheard),
    ) -> Result<(), Failure> {
        let ear = self.trace.ear();
        self.show();
        let end = self.now() + time;
        let (mut own, mut told) = (None, self.now());
        while self.now() < end {
            let is_ours = own.is_some_and(|sent: Instant| self.now() < sent + OWN);
            if !is_ours || self.is_virtual() {
                let _turn = self.queue.turn((Priority::Poll, None), give_up).map_err(|why| self.no_turn(why))?;
                let mut owner = self.lock();
                owner.prepare(give_up)?;
                let now = self.now_of(&owner);
                owner.hear(end.min(now + EACH), &mut |_, _| {})?;
            }
            let pieces = ear.take(if is_ours { EACH } else { Duration::ZERO });
            let now = self.now();
            if pieces.is_empty() && now >= told + LOOK_UP {
                told = now;
                hear(Overheard { at: now, direction: Direction::Heard, bytes: Vec::new() });
            }
            for piece in pieces {
                told = piece.at;
                own = own.max((piece.direction == Direction::Sent).then_some(piece.at));
                hear(piece);
            }
            if self.is_shut() || give_up() {
                return Err(self.given_up());
            }
        }
        Ok(())
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
