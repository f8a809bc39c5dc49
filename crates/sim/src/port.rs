//! The simulated line behind one file descriptor, in real time.
//!
//! What arrives is laid on the wire from the moment of its arrival. Answers are written as a UART hands them over: when
//! its FIFO has filled so far that it interrupts, and when a run of characters is over.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;

use drivebus_rtu::{Instant, SerialFormat};
use rustix::io::Errno;

use crate::pacer::{Due, Next};
use crate::shared::Shared;
use crate::watch::{Key, Watch};
use crate::wire::{Listener, at_speed};

/// A master behind a descriptor.
#[derive(Debug)]
pub(crate) struct Port {
    shared: Arc<Shared>,
    /// Does not block.
    descriptor: OwnedFd,
    listener: Listener,
    /// What the program at the other side has set, looked up when it sends.
    looks_up: Option<LookUp>,
}

/// The speed that a program has set its side of a descriptor to, in bit/s.
type LookUp = fn(&OwnedFd) -> Option<u32>;

/// The other side is gone.
struct Disconnected;

impl Port {
    /// `descriptor` must not block. It is set as the simulation began; where `looks_up` tells a speed, that counts.
    pub(crate) fn new(
        shared: Arc<Shared>,
        descriptor: OwnedFd,
        looks_up: Option<LookUp>,
        watch: &Watch,
        key: Key,
    ) -> std::io::Result<Self> {
        watch.add(descriptor.as_fd(), key)?;
        let mut world = shared.lock();
        let listener = world.attach();
        world.set_adapter(listener, shared.began_as);
        drop(world);
        Ok(Self { shared, descriptor, listener, looks_up })
    }

    pub(crate) fn leave(&self, watch: &Watch) {
        watch.remove(self.descriptor.as_fd());
    }

    /// Takes what has arrived, hands over what is due.
    pub(crate) fn serve(&self, readable: bool) -> Next {
        let mut buffer = [0; 4_096];
        if readable && self.read(&mut buffer).is_err() {
            return Next::Gone;
        }
        loop {
            let (count, next, char_time) = {
                let mut world = self.shared.present();
                let count = world.hand_over(self.listener, &mut buffer, self.shared.fifo);
                (count, world.next_hand_over(self.listener, self.shared.fifo), world.wire.format().char_time())
            };
            if count > 0 && self.write(&buffer[..count]).is_err() {
                return Next::Gone;
            }
            if count < buffer.len() {
                let due = next.and_then(|wakeup| {
                    let at = self.shared.clock.system(wakeup.at)?;
                    // Nobody waits for what is not the end of a run.
                    let latest = if wakeup.exact { at } else { at + char_time / 2 };
                    Some(Due { at, latest })
                });
                return due.map_or(Next::Readable, Next::At);
            }
        }
    }

    /// Lays what arrived on the wire.
    fn read(&self, buffer: &mut [u8]) -> Result<(), Disconnected> {
        let arrived = self.shared.clock.now(Instant::ZERO);
        match rustix::io::read(self.descriptor.as_fd(), &mut *buffer) {
            Ok(0) => Err(Disconnected),
            Ok(count) => {
                let mut world = self.shared.lock();
                if let Some(adapter) = self.looked_up(world.wire.format()) {
                    world.set_adapter(self.listener, adapter);
                }
                world.transmit(self.listener, arrived, &buffer[..count]);
                Ok(())
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(()),
            Err(_) => Err(Disconnected),
        }
    }

    /// What a program has set its side to: a speed, and for the rest what the units are set to.
    fn looked_up(&self, units: &SerialFormat) -> Option<SerialFormat> {
        at_speed(self.looks_up.and_then(|look_up| look_up(&self.descriptor))?, units)
    }

    /// Hands `bytes` to the other side. What it has no room for is lost, as on a wire.
    fn write(&self, bytes: &[u8]) -> Result<(), Disconnected> {
        match rustix::io::write(self.descriptor.as_fd(), bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR) => Ok(()),
            Err(_) => Err(Disconnected),
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.shared.lock().detach(self.listener);
    }
}
