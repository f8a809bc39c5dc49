//! Sockets whose messages come whole, and whose order among threads is the test's to decide. Who waits for one is called.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use crate::system::sync::thread::{self, Thread};
use crate::system::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) use std::net::Shutdown;

/// Two ends, and what is under way to each.
#[derive(Debug, Default)]
struct Wire {
    ends: Mutex<[End; 2]>,
}

#[derive(Debug, Default)]
struct End {
    came: VecDeque<Vec<u8>>,
    /// Nothing more comes here.
    is_over: bool,
    sleepers: Vec<Thread>,
}

impl End {
    fn is_over(&mut self) {
        self.is_over = true;
        self.call();
    }

    fn call(&mut self) {
        self.sleepers.drain(..).for_each(|thread| thread.unpark());
    }
}

/// One end of a connection, which ends when it is dropped.
#[derive(Debug)]
pub(crate) struct Stream {
    wire: Arc<Wire>,
    own: usize,
    /// The number of the program at the other end.
    other: u32,
}

impl Stream {
    pub(crate) fn pair() -> io::Result<(Self, Self)> {
        Ok(Self::between(0, 0))
    }

    fn between(one: u32, other: u32) -> (Self, Self) {
        let wire = Arc::new(Wire::default());
        (Self { wire: Arc::clone(&wire), own: 0, other }, Self { wire, own: 1, other: one })
    }

    pub(crate) fn other(&self) -> u32 {
        self.other
    }

    fn ends(&self) -> MutexGuard<'_, [End; 2]> {
        self.wire.ends.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was sent before is heard all the same.
    pub(crate) fn shutdown(&self, how: Shutdown) -> io::Result<()> {
        let mut ends = self.ends();
        ends[self.own].is_over();
        if how != Shutdown::Read {
            ends[1 - self.own].is_over();
        }
        Ok(())
    }

    pub(crate) fn send(&self, message: Vec<u8>) -> io::Result<()> {
        let far = &mut self.ends()[1 - self.own];
        if far.is_over {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        far.came.push_back(message);
        far.call();
        Ok(())
    }

    /// What has come; `None` where nothing has yet.
    pub(crate) fn receive(&self) -> io::Result<Option<Vec<u8>>> {
        let own = &mut self.ends()[self.own];
        match own.came.pop_front() {
            None if own.is_over => Err(io::ErrorKind::UnexpectedEof.into()),
            came => Ok(came),
        }
    }

    /// Whether the other end may still say something.
    pub(crate) fn is_open(&self) -> bool {
        !self.ends()[self.own].is_over
    }

    /// Whether there is something to receive, or it is over; if not, this thread is called when that is so.
    pub(crate) fn is_ready_or_calls(&self) -> bool {
        let own = &mut self.ends()[self.own];
        let is_ready = own.is_over || !own.came.is_empty();
        if !is_ready {
            own.sleepers.push(thread::current());
        }
        is_ready
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // One that is over already may be so again.
        let _ = self.shutdown(Shutdown::Both);
    }
}

/// Where programs knock.
#[derive(Debug, Default)]
pub(crate) struct Listener(Mutex<Knocks>);

#[derive(Debug, Default)]
struct Knocks {
    waiting: VecDeque<Stream>,
    /// So often the system has no descriptor for who knocks.
    refusals: usize,
    sleepers: Vec<Thread>,
}

impl Listener {
    /// So often the system has nothing left to let anybody in with.
    pub(crate) fn refusing(refusals: usize) -> Self {
        Self(Mutex::new(Knocks { refusals, ..Knocks::default() }))
    }

    fn lock(&self) -> MutexGuard<'_, Knocks> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The program with this number knocks.
    pub(crate) fn connect(&self, number: u32) -> Stream {
        let (own, theirs) = Stream::between(number, 0);
        let mut knocks = self.lock();
        knocks.waiting.push_back(theirs);
        knocks.sleepers.drain(..).for_each(|thread| thread.unpark());
        own
    }

    pub(crate) fn accept(&self) -> io::Result<Stream> {
        let mut knocks = self.lock();
        if !knocks.waiting.is_empty() && knocks.refusals > 0 {
            knocks.refusals -= 1;
            return Err(io::Error::other("too many open files"));
        }
        knocks.waiting.pop_front().ok_or_else(|| io::ErrorKind::WouldBlock.into())
    }

    fn is_ready_or_calls(&self) -> bool {
        let mut knocks = self.lock();
        let is_ready = !knocks.waiting.is_empty();
        if !is_ready {
            knocks.sleepers.push(thread::current());
        }
        is_ready
    }
}

/// What has come to who stands at a door.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Came {
    End,
    Knock,
}

/// As long as it takes; a wait with an end is over at once.
pub(crate) fn wait_for_a_knock<'a>(
    listeners: impl Iterator<Item = &'a Listener>,
    woken: &Stream,
    time: Option<Duration>,
) -> io::Result<Came> {
    let listeners: Vec<_> = listeners.collect();
    loop {
        if woken.is_ready_or_calls() {
            return Ok(Came::End);
        }
        if time.is_some() || listeners.iter().any(|listener| listener.is_ready_or_calls()) {
            thread::yield_now();
            return Ok(Came::Knock);
        }
        thread::park();
    }
}
