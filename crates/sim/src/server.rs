//! Serves the simulated line to one file descriptor in real time: the thread behind a pseudo-terminal or a socket.
//!
//! What arrives is laid on the wire from the moment of its arrival; answers are written as their characters complete.
//! The thread sleeps in `poll` whenever nothing is due, and waits awake only for the last character of an answer.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::process;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::clock::WAKE_EARLY;
use crate::simulator::Shared;
use crate::world::Listener;

/// Why serving ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    /// The server is to stop.
    Stopped,
    /// The other side is gone.
    Disconnected,
}

/// A thread that can be told to stop, and is when this is dropped.
#[derive(Debug)]
pub(crate) struct Worker {
    /// Closing it makes the other end readable (hung up), which wakes the thread.
    stop: Option<OwnedFd>,
    thread: Option<JoinHandle<()>>,
    /// The process it runs in. A forked child inherits this, and no thread.
    process: u32,
}

impl Worker {
    /// Runs `work`; it must return soon after the descriptor it is given becomes readable.
    pub(crate) fn start(name: &str, work: impl FnOnce(OwnedFd) + Send + 'static) -> io::Result<Self> {
        let (woken, stop) = io::pipe()?;
        let thread = thread::Builder::new().name(name.to_owned()).spawn(move || {
            sleep_precisely();
            work(woken.into());
        })?;
        Ok(Self { stop: Some(stop.into()), thread: Some(thread), process: process::id() })
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            if self.process != process::id() {
                std::mem::forget(thread); // there is nothing to wait for, nor to let go
                return;
            }
            // A panic in the thread has been reported by the thread.
            let _ = thread.join();
        }
    }
}

/// Asks for wake-ups on time; Linux otherwise adds up to 50 µs to each.
fn sleep_precisely() {
    #[cfg(target_os = "linux")]
    {
        // Without it everything works, a little later.
        let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    }
}

/// Waits until one of two descriptors has something; `None` means for ever. Returns which of them have.
pub(crate) fn wait_for(
    first: BorrowedFd<'_>,
    second: BorrowedFd<'_>,
    timeout: Option<Duration>,
) -> io::Result<(bool, bool)> {
    // Rounded down to the system's idea of time; one too long for it is as good as for ever.
    let timeout = timeout.and_then(|timeout| Timespec::try_from(timeout).ok());
    let mut descriptors =
        [PollFd::from_borrowed_fd(first, PollFlags::IN), PollFd::from_borrowed_fd(second, PollFlags::IN)];
    match poll(&mut descriptors, timeout.as_ref()) {
        Ok(_) | Err(Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    let [first, second] = descriptors;
    Ok((!first.revents().is_empty(), !second.revents().is_empty()))
}

/// Serves `port`, which does not block, until `stop` is readable or the other side is gone.
pub(crate) fn serve(shared: &Arc<Shared>, port: BorrowedFd<'_>, stop: BorrowedFd<'_>) -> io::Result<Ended> {
    let listener = shared.lock().attach();
    let ended = Session { shared, port, listener }.run(stop);
    shared.lock().detach(listener);
    ended
}

struct Session<'a> {
    shared: &'a Shared,
    port: BorrowedFd<'a>,
    listener: Listener,
}

impl Session<'_> {
    fn run(&self, stop: BorrowedFd<'_>) -> io::Result<Ended> {
        let mut buffer = [0; 4_096];
        loop {
            let (count, now, wakeup) = {
                let mut world = self.shared.present();
                (world.take(self.listener, &mut buffer), world.now(), world.next_wakeup())
            };
            if count > 0 {
                if self.write(&buffer[..count])? == Ended::Disconnected {
                    return Ok(Ended::Disconnected);
                }
                continue;
            }
            let timeout = wakeup.map(|wakeup| {
                let left = wakeup.at.saturating_duration_since(now);
                if wakeup.exact { left.saturating_sub(WAKE_EARLY) } else { left }
            });
            let (stopped, readable) = match timeout {
                // Too close to sleep: wait awake, so that the character is there on time and not before.
                Some(Duration::ZERO) => {
                    self.shared.clock.wait(wakeup.map_or(now, |wakeup| wakeup.at), true);
                    (false, false)
                }
                timeout => wait_for(stop, self.port, timeout)?,
            };
            if stopped {
                return Ok(Ended::Stopped);
            }
            if readable && self.read(&mut buffer)? == Ended::Disconnected {
                return Ok(Ended::Disconnected);
            }
        }
    }

    /// Lays what arrived on the wire. `Stopped` means that nothing ended.
    fn read(&self, buffer: &mut [u8]) -> io::Result<Ended> {
        let arrived: Instant = self.shared.clock.now(Instant::ZERO);
        match rustix::io::read(self.port.as_fd(), &mut *buffer) {
            Ok(0) | Err(Errno::CONNRESET | Errno::PIPE) => Ok(Ended::Disconnected),
            Ok(count) => {
                self.shared.lock().transmit(self.listener, arrived, &buffer[..count]);
                Ok(Ended::Stopped)
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(Ended::Stopped),
            Err(error) => Err(error.into()),
        }
    }

    /// Hands `bytes` to the other side. What it has no room for is lost, as on a wire.
    fn write(&self, bytes: &[u8]) -> io::Result<Ended> {
        match rustix::io::write(self.port.as_fd(), bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR) => Ok(Ended::Stopped),
            Err(Errno::CONNRESET | Errno::PIPE) => Ok(Ended::Disconnected),
            Err(error) => Err(error.into()),
        }
    }
}
