//! Cyclic polling: a bus asks the same again and again by itself, and keeps what came until somebody takes it.
//!
//! On a real line a thread of the poll's own does the asking, so that nothing which takes samples can hold it up. On a line
//! in virtual time there is no such thread, for nobody would stop it: time moves only while somebody waits, so who
//! waits for samples does the asking, and nobody else does.

pub(crate) mod ring;
mod runner;
pub(crate) mod samples;
mod schedule;
pub(crate) mod target;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::{self, JoinHandle, ThreadId};
use std::time::Duration;

use drivebus_rtu::BeginError;

use crate::bus::Bus;
use crate::error::Failure;
use crate::poll::ring::PollBatch;
use crate::poll::runner::{Progress, Runner};
use crate::poll::samples::{PollCounts, Samples};
use crate::poll::target::{PollError, PollTarget, check, shortest_cycle};
use crate::system::clock::{LOOK_UP, monotonic};
use crate::system::process::Process;

/// Reads that go on in cycles until the poll is closed or its bus is.
///
/// Each read is a call of [`Priority::Poll`](crate::Priority::Poll): whoever else wants the line goes before the next one. It is
/// not repeated, for the next cycle asks again; a unit that is dead is not waited for. Several polls of one bus take
/// turns. A port that was lost is opened again, as for every call.
#[derive(Debug)]
pub struct Poll {
    bus: Arc<Bus>,
    samples: Arc<Samples>,
    stop: Arc<AtomicBool>,
    /// In virtual time, for whoever waits.
    runner: Option<Mutex<Runner>>,
    asking: Mutex<Option<ThreadId>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    shortest: Duration,
    opened_by: Process,
}

impl Poll {
    /// Begins to ask `targets` in cycles: at every beat of `interval`, or one cycle right after the other. Of the samples
    /// that nobody takes the latest `size` (at least one) are kept.
    ///
    /// # Errors
    ///
    /// [`PollError`]; nothing was sent.
    pub fn start(
        bus: Arc<Bus>,
        targets: Vec<PollTarget>,
        interval: Option<Duration>,
        size: usize,
    ) -> Result<Self, PollError> {
        check(&targets)?;
        if bus.is_closed() {
            return Err(PollError::Bus(bus.ended()));
        }
        let reads: usize = targets.iter().map(|target| target.reads.len()).sum();
        let format = bus.options().format;
        let silence = |unit| bus.silence_before(unit);
        let shortest = if bus.is_gapless() { Duration::ZERO } else { shortest_cycle(&format, &targets, silence) };
        if let Some(interval) = interval.filter(|interval| interval < &shortest) {
            return Err(PollError::TooFast { interval, shortest, reads, format });
        }
        let (stop, is_virtual) = (Arc::new(AtomicBool::new(false)), bus.is_virtual());
        let runner = Runner::new(Arc::clone(&bus), targets, interval);
        let words = runner.most_words();
        let samples = Arc::new(Samples::new(size, words).ok_or(PollError::NoRoom { size, words })?);
        let (runner, thread) = if is_virtual {
            (Some(Mutex::new(runner)), None)
        } else {
            let thread = runner.spawn(Arc::clone(&samples), Arc::clone(&stop));
            (None, Some(thread.map_err(|error| PollError::NoThread { message: error.to_string() })?))
        };
        let opened_by = Process::current();
        let (asking, thread) = (Mutex::default(), Mutex::new(thread));
        Ok(Self { bus, samples, stop, runner, asking, thread, shortest, opened_by })
    }

    /// How long one cycle takes at least on this line; zero where the line sets no such limit.
    ///
    /// For each read the silence before it, 8 characters, a silence, and an answer of 5 characters and two for each word.
    pub fn shortest(&self) -> Duration {
        self.shortest
    }

    /// Waits until `count` samples are there, for `timeout` of the line's clock at most, and tells how many are there.
    ///
    /// Fewer also when the poll has ended; more than it keeps are never there, so that it is the end which is waited for.
    /// `give_up` is asked about every 50 ms, and ends the wait.
    ///
    /// # Errors
    ///
    /// [`Failure::Forked`]: the poll belongs to the parent of this process. [`Failure::NotBegun`]: in virtual time, from
    /// inside a `give_up` of the same thread.
    pub fn wait(
        &self,
        count: usize,
        timeout: Option<Duration>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<usize, Failure> {
        if !self.opened_by.is_current() {
            return Err(Failure::Forked);
        }
        let Some(runner) = &self.runner else {
            return Ok(self.samples.wait(count, timeout, give_up));
        };
        let deadline = timeout.map(|timeout| self.bus.now() + timeout);
        let mut look_up = monotonic() + LOOK_UP;
        loop {
            let there = self.samples.len();
            let is_late = deadline.is_some_and(|deadline| self.bus.now() >= deadline);
            if there >= count || is_late || self.samples.are_over() {
                return Ok(there);
            }
            let runner = match runner.try_lock() {
                Ok(runner) => Some(runner),
                // Whoever panicked did so in a question of its own; what the runner knows is whole.
                Err(TryLockError::Poisoned(broken)) => Some(broken.into_inner()),
                Err(TryLockError::WouldBlock) => None,
            };
            if let Some(mut runner) = runner {
                *self.asking() = Some(thread::current().id());
                let progress = runner.go_on(&self.samples, deadline, &mut || self.stops() || give_up());
                *self.asking() = None;
                match progress {
                    Progress::Asked => {}
                    Progress::GivenUp => return Ok(self.samples.len()),
                    Progress::Over => self.samples.end(),
                }
            } else if *self.asking() == Some(thread::current().id()) {
                // Inside a `give_up` of its own, which may run a signal handler: it would wait for itself.
                return Err(Failure::NotBegun(BeginError::OutOfTurn));
            } else {
                // Somebody else does the asking.
                self.samples.wait(count, Some(LOOK_UP), &mut || false);
            }
            if monotonic() >= look_up {
                look_up = monotonic() + LOOK_UP;
                if self.stops() || give_up() {
                    return Ok(self.samples.len());
                }
            }
        }
    }

    /// Takes the oldest samples that are there, `max` at most, without waiting.
    pub fn take(&self, max: usize) -> PollBatch {
        if self.opened_by.is_current() { self.samples.take(max) } else { PollBatch::default() }
    }

    /// What was done so far.
    pub fn counts(&self) -> PollCounts {
        if self.opened_by.is_current() { self.samples.counts() } else { PollCounts::default() }
    }

    /// Whether nothing is asked any more. Samples may still be there.
    pub fn is_over(&self) -> bool {
        !self.opened_by.is_current() || self.samples.are_over()
    }

    /// Ends the poll, and waits until its thread has ended: for the exchange that is under way, 50 ms at most. Closing
    /// again does nothing.
    pub fn close(&self) {
        self.stop();
        if !self.opened_by.is_current() {
            return;
        }
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            // What it may have panicked with was printed.
            let _ = thread.join();
        }
    }

    /// Ends the poll without waiting for its thread.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Release);
        // What a thread of the parent held when this child was forked, nobody here lets go.
        if self.opened_by.is_current() {
            self.samples.end();
        }
    }

    /// Has `notify` called, once, when `count` samples are there or the poll has ended: at once, or by the thread that
    /// asks, which it must not keep. Not, once it is no longer `wanted`. That is for event loops, which cannot
    /// [`wait`](Self::wait); in virtual time somebody has to, all the same.
    pub fn call_when(&self, count: usize, wanted: Arc<AtomicBool>, notify: impl FnOnce() + Send + 'static) {
        if self.opened_by.is_current() {
            self.samples.call_when(count, wanted, Box::new(notify));
        } else {
            notify();
        }
    }

    /// Who does the asking in virtual time.
    fn asking(&self) -> MutexGuard<'_, Option<ThreadId>> {
        self.asking.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stops(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }
}

impl Drop for Poll {
    fn drop(&mut self) {
        self.stop();
    }
}
