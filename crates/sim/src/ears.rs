//! What overhears a simulated wire: pseudo-terminals to which time hands over what came. Linux only.

use std::os::fd::OwnedFd;
use std::sync::{Mutex, MutexGuard, PoisonError};

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{QueueSelector, tcflush};

use crate::wire::{Listener, at_speed};
use crate::world::World;
use drivebus_line::pty::speed;

/// Every ear on one wire. They are locked after the world.
#[derive(Debug, Default)]
pub(crate) struct Ears(Mutex<Vec<Ear>>);

impl Ears {
    /// Lets everything happen that is due until `to`, and hands over what was overheard.
    pub(crate) fn advance(&self, world: &mut World, to: Instant, fifo: usize) {
        let ears = self.lock();
        for ear in &*ears {
            if let Some(adapter) = speed(&ear.ours).and_then(|speed| at_speed(speed, world.wire.format())) {
                world.set_adapter(ear.listener, adapter);
            }
        }
        world.advance(to);
        let mut buffer = [0; 1_024];
        for ear in &*ears {
            while let count @ 1.. = world.hand_over(ear.listener, &mut buffer, fifo) {
                ear.hand_out(&buffer[..count]);
            }
        }
    }

    /// One more overhears.
    pub(crate) fn add(&self, ear: Ear) {
        self.lock().push(ear);
    }

    /// The one of this name overhears nothing any more.
    pub(crate) fn remove(&self, listener: Listener) {
        self.lock().retain(|ear| ear.listener != listener);
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Ear>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Our side of one ear.
#[derive(Debug)]
pub(crate) struct Ear {
    pub(crate) listener: Listener,
    /// Does not block.
    pub(crate) ours: OwnedFd,
}

impl Ear {
    /// Gives `bytes` to who has it open. What nobody has room for is lost.
    fn hand_out(&self, bytes: &[u8]) {
        // What was said there goes nowhere; it is taken, so that who says it does not wait for ever.
        while let Ok(1..) = rustix::io::read(&self.ours, &mut [0; 64]) {}
        if self.is_open() {
            let _ = rustix::io::write(&self.ours, bytes);
        } else {
            // Nor shall the next one get what the last one left.
            let _ = tcflush(&self.ours, QueueSelector::OFlush);
        }
    }

    /// Whether a program has it open.
    fn is_open(&self) -> bool {
        let mut ours = [PollFd::new(&self.ours, PollFlags::OUT)];
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        poll(&mut ours, Some(&at_once)).is_ok() && !ours[0].revents().contains(PollFlags::HUP)
    }
}
