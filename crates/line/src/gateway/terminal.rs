//! A pseudo-terminal as a connection: a program of this computer that takes it for a serial port. Linux only.

use std::io::{self, ErrorKind};
use std::os::fd::{AsFd as _, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd};
use rustix::io::Errno;

use crate::gateway::stream::{HURRY, Stream};
use crate::system::clock::{monotonic, wait_for, wait_for_any};
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
    over: Bell,
    /// Whether it is over. Held where bytes are taken or given, so that none of this program's is another's.
    is_over: Mutex<bool>,
    was_left: AtomicBool,
}

impl Terminal {
    pub(super) fn new(ours: Arc<Kept<OwnedFd>>) -> io::Result<Self> {
        Ok(Self { ours, over: Bell::new()?, is_over: Mutex::default(), was_left: AtomicBool::default() })
    }

    /// Heard when it is over.
    pub(super) fn over(&self) -> PollFd<'_> {
        self.over.waiting()
    }

    /// Whether its program has closed it.
    pub(super) fn was_left(&self) -> bool {
        self.was_left.load(Ordering::Acquire)
    }

    fn is_over(&self) -> MutexGuard<'_, bool> {
        self.is_over.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the terminal is ready for `events`, or has been left, or it is over.
    fn wait(&self, events: PollFlags, within: Duration) -> io::Result<()> {
        let ours = PollFd::from_borrowed_fd(self.ours.as_fd(), events);
        let ready = wait_for_any(&mut [ours, self.over.waiting()], monotonic() + within)?;
        ready.map(drop).ok_or_else(|| ErrorKind::TimedOut.into())
    }
}

impl Stream for Terminal {
    fn read(&self, bytes: &mut [u8], within: Duration) -> io::Result<usize> {
        self.wait(PollFlags::IN, within)?;
        let is_over = self.is_over();
        if *is_over {
            return Ok(0);
        }
        match rustix::io::read(&**self.ours, bytes) {
            // Nobody has it open any more.
            Err(Errno::IO) => {
                self.was_left.store(true, Ordering::Release);
                Ok(0)
            }
            read => Ok(read?),
        }
    }

    fn write(&self, mut bytes: &[u8]) -> io::Result<()> {
        let until = monotonic() + HURRY;
        while !bytes.is_empty() {
            self.wait(PollFlags::OUT, until.saturating_duration_since(monotonic()))?;
            let is_over = self.is_over();
            if *is_over {
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
        let left = wait_for(self.ours.as_fd(), PollFlags::HUP, monotonic());
        *self.is_over() || left.is_ok_and(|ready| ready.is_some_and(|ready| ready.contains(PollFlags::HUP)))
    }

    /// Nobody else waits for it.
    fn idle(&self) -> Option<Duration> {
        None
    }
}
