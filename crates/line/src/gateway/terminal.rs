//! A pseudo-terminal as a connection: a program of this computer that takes it for a serial port. Linux only.

use std::io::{self, ErrorKind};
use std::os::fd::{AsFd as _, OwnedFd};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd};
use rustix::io::Errno;

use crate::gateway::openings::Openings;
use crate::gateway::stream::{HURRY, Stream};
use crate::system::clock::{monotonic, wait_for_any};
use crate::system::inherited::Kept;

/// Once rung, it is heard by all who wait, and for good.
#[derive(Debug)]
pub(super) struct Bell(Kept<OwnedFd>);

impl Bell {
    pub(super) fn new() -> io::Result<Self> {
        Ok(Self(Kept::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?)))
    }

    pub(super) fn ring(&self) {
        // It is full after 2⁶⁴ times, and rings then as well.
        let _ = rustix::io::write(&*self.0, &1_u64.to_ne_bytes());
    }

    pub(super) fn waiting(&self) -> PollFd<'_> {
        PollFd::from_borrowed_fd(self.0.as_fd(), PollFlags::IN)
    }
}

/// One program that has the pseudo-terminal open, until it closes it.
#[derive(Debug)]
pub(super) struct Terminal {
    ours: Arc<Kept<OwnedFd>>,
    openings: Arc<Openings>,
    /// How often it had been closed when this program had it.
    closed: u64,
    over: Bell,
    /// Whether it is over. Held where bytes are taken or given, so that none of this program's is another's.
    is_over: Mutex<bool>,
}

impl Terminal {
    /// Of who has it since it had been `closed` so often.
    pub(super) fn new(ours: Arc<Kept<OwnedFd>>, openings: Arc<Openings>, closed: u64) -> io::Result<Self> {
        Ok(Self { ours, openings, closed, over: Bell::new()?, is_over: Mutex::default() })
    }

    /// Heard when it is over.
    pub(super) fn over(&self) -> PollFd<'_> {
        self.over.waiting()
    }

    /// Whether its program has closed it.
    pub(super) fn was_left(&self) -> bool {
        self.openings.closed() != self.closed
    }

    fn is_over(&self) -> MutexGuard<'_, bool> {
        self.is_over.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the terminal is ready for `events`, somebody opened or closed it, or it is over.
    fn wait(&self, events: PollFlags, until: Instant) -> io::Result<()> {
        let ours = PollFd::from_borrowed_fd(self.ours.as_fd(), events);
        let ready = wait_for_any(&mut [ours, self.openings.waiting(), self.over.waiting()], until)?;
        ready.map(drop).ok_or_else(|| ErrorKind::TimedOut.into())
    }
}

impl Stream for Terminal {
    fn read(&self, bytes: &mut [u8], within: Duration) -> io::Result<usize> {
        let until = monotonic() + within;
        loop {
            self.wait(PollFlags::IN, until)?;
            let is_over = self.is_over();
            if *is_over || self.was_left() {
                return Ok(0);
            }
            match rustix::io::read(&**self.ours, &mut *bytes) {
                // Somebody opened it.
                Err(Errno::AGAIN) => {}
                // Nobody has it open any more.
                Err(Errno::IO) => return Ok(0),
                // They may be the next program's, and nothing tells: it asks again.
                Ok(_) if self.was_left() => return Ok(0),
                read => return Ok(read?),
            }
        }
    }

    fn write(&self, mut bytes: &[u8]) -> io::Result<()> {
        let until = monotonic() + HURRY;
        while !bytes.is_empty() {
            self.wait(PollFlags::OUT, until)?;
            let is_over = self.is_over();
            if *is_over || self.was_left() {
                return Err(ErrorKind::BrokenPipe.into());
            }
            match rustix::io::write(&**self.ours, bytes) {
                Ok(taken) => bytes = &bytes[taken..],
                Err(Errno::AGAIN) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn end(&self) {
        *self.is_over() = true;
        self.over.ring();
    }

    fn has_hung_up(&self) -> bool {
        *self.is_over() || self.was_left()
    }

    /// Nobody else waits for it.
    fn idle(&self) -> Option<Duration> {
        None
    }
}
