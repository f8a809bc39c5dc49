//! A pseudo-terminal that overhears the wire: every character of either side, and nothing can be said there. Linux only.
//!
//! It has no thread. Whoever lets time pass in the simulation hands over what came, as its FIFO would.

use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{QueueSelector, tcflush};

use crate::link::Link;
use crate::port::at_speed;
use crate::pty;
use crate::simulator::Shared;
use crate::world::{Listener, World};

/// An ear on the wire, for another program to open, until this is dropped.
#[derive(Debug)]
pub struct EarServer {
    shared: Arc<Shared>,
    listener: Listener,
    path: PathBuf,
    _link: Option<Link>,
}

impl EarServer {
    pub(crate) fn start(shared: Arc<Shared>, link: Option<PathBuf>) -> io::Result<Self> {
        // Nobody holds the programs' side: our side shows whether one of them has it open.
        let (ours, _, path) = pty::open_raw(shared.began_as.baud_rate())?;
        let link = link.map(|link| Link::new(link, &path)).transpose()?;
        let mut world = shared.lock();
        let listener = world.attach_ear();
        shared.ears.lock().push(Ear { listener, ours });
        drop(world);
        Ok(Self { shared, listener, path, _link: link })
    }

    /// What to open: `/dev/pts/N`.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for EarServer {
    fn drop(&mut self) {
        let mut world = self.shared.lock();
        world.detach(self.listener);
        self.shared.ears.lock().retain(|ear| ear.listener != self.listener);
    }
}

/// Every ear on one wire. They are locked after the world.
#[derive(Debug, Default)]
pub(crate) struct Ears(Mutex<Vec<Ear>>);

impl Ears {
    /// Lets everything happen that is due until `to`, and hands over what was overheard.
    pub(crate) fn advance(&self, world: &mut World, to: Instant, fifo: usize) {
        let ears = self.lock();
        for ear in &*ears {
            if let Some(adapter) = pty::speed(&ear.ours).and_then(|speed| at_speed(speed, world.wire.format())) {
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

    fn lock(&self) -> MutexGuard<'_, Vec<Ear>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Our side of one ear.
#[derive(Debug)]
struct Ear {
    listener: Listener,
    /// Does not block.
    ours: OwnedFd,
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
