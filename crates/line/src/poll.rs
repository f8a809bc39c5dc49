//! Cyclic polling: a bus asks the same again and again by itself, and keeps what came until somebody takes it.
//!
//! On a real line a thread of the poll's own does the asking, so that nothing which takes samples can hold it up. On a line
//! in virtual time there is no such thread, for nobody would stop it: time moves only while somebody waits, so who
//! waits for samples does the asking, and nobody else does.

pub(crate) mod ring;
mod runner;
mod samples;
mod schedule;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::{self, JoinHandle, ThreadId};
use std::time::Duration;

use drivebus_rtu::{BeginError, SerialFormat, UnitAddress};

use crate::bus::Bus;
use crate::error::Failure;
use crate::poll::ring::PollBatch;
use crate::poll::runner::{Progress, Runner};
use crate::poll::samples::Samples;
use crate::system::clock::monotonic;
use crate::system::process::Process;
use crate::turns::queue::LOOK_UP;

/// What is asked of one unit in each cycle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PollTarget {
    /// Who is asked.
    pub unit: UnitAddress,
    /// Address and number of words (1..=125) of each read, in the order in which they are sent.
    pub reads: Vec<(u16, u16)>,
}

/// What a poll did so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PollCounts {
    /// Cycles that are over: in each, every target was asked once.
    pub cycles: u64,
    /// Samples that have no words.
    pub missing: u64,
    /// Beats that were over before the line was free, or, in virtual time, before somebody asked.
    pub late: u64,
    /// Samples that gave way to newer ones before somebody took them.
    pub dropped: u64,
}

/// Why a poll cannot be. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PollError {
    /// There is nothing to ask.
    #[error("{}", unit.map_or_else(|| "there is nobody to poll".to_owned(), |unit| format!("nothing is asked of unit {unit}")))]
    Nothing {
        /// Whom nothing is asked of; `None`: there is nobody.
        unit: Option<UnitAddress>,
    },
    /// A read has no words, or more than a frame holds.
    #[error("unit {unit} cannot be asked for {count} words from {address:04X}H")]
    Read {
        /// Who would be asked.
        unit: UnitAddress,
        /// The first address.
        address: u16,
        /// How many words.
        count: u16,
    },
    /// The wire cannot carry so much so often.
    #[error(
        "an interval of {} s is shorter than the line can carry: at {format} one cycle of this poll ({reads} reads) takes at \
         least {} s",
        interval.as_secs_f64(),
        rounded_up(*shortest)
    )]
    TooFast {
        /// What was asked for.
        interval: Duration,
        /// The shortest there can be.
        shortest: Duration,
        /// How many requests a cycle has.
        reads: usize,
        /// Characters and silence.
        format: SerialFormat,
    },
    /// The bus cannot be used.
    #[error("{0}")]
    Bus(Failure),
    /// So many samples cannot be kept.
    #[error("there is no memory for {size} samples of {words} words; keep fewer")]
    NoRoom {
        /// How many were to be kept.
        size: usize,
        /// The most words of a sample.
        words: usize,
    },
    /// The system gives no thread.
    #[error("the system gives no thread to poll in: {message}")]
    NoThread {
        /// What the system says.
        message: String,
    },
}

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

fn check(targets: &[PollTarget]) -> Result<(), PollError> {
    if targets.is_empty() {
        return Err(PollError::Nothing { unit: None });
    }
    for &PollTarget { unit, ref reads } in targets {
        if reads.is_empty() {
            return Err(PollError::Nothing { unit: Some(unit) });
        }
        let wrong = reads.iter().find(|&&(address, count)| drivebus_rtu::Request::read(address, count).is_err());
        if let Some(&(address, count)) = wrong {
            return Err(PollError::Read { unit, address, count });
        }
    }
    Ok(())
}

/// How long the wire is taken by one cycle, where every unit answers as soon as it may. `silence` is what must come before
/// a request to a unit.
fn shortest_cycle(
    format: &SerialFormat,
    targets: &[PollTarget],
    silence: impl Fn(UnitAddress) -> Duration,
) -> Duration {
    let words = |count: u16| 5 + 2 * u32::from(count);
    let read = |count| format.chars(8) + format.t35() + format.chars(words(count));
    let reads = targets.iter().flat_map(|target| target.reads.iter().map(|&(_, count)| (target.unit, count)));
    reads.fold(Duration::ZERO, |cycle, (unit, count)| cycle.saturating_add(silence(unit)).saturating_add(read(count)))
}

/// Seconds in whole microseconds, no fewer than `time` has.
fn rounded_up(time: Duration) -> f64 {
    let micros = u64::try_from(time.as_nanos().div_ceil(1_000)).unwrap_or(u64::MAX);
    Duration::from_micros(micros).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(unit: u8, reads: &[(u16, u16)]) -> PollTarget {
        PollTarget { unit: UnitAddress::new(unit).unwrap(), reads: reads.to_vec() }
    }

    #[test]
    fn the_shortest_cycle_is_counted_in_characters() {
        // At 19200 8E1 a character takes 11 bits: 8 + 3.5 + 7 + 3.5 = 22 for one word, 52 for 16 words.
        let format = SerialFormat::DEFAULT;
        let targets = [target(1, &[(0x3000, 1)]), target(2, &[(0, 16)])];
        let cycle = shortest_cycle(&format, &targets, |_| format.t35());
        let exact = 74.0 * 11.0 / 19_200.0;
        assert!((cycle.as_secs_f64() - exact).abs() < 1e-7, "{cycle:?} is not {exact}");
        let slow = Duration::from_millis(20);
        let with_gap = shortest_cycle(&format, &targets, |unit| if unit.get() == 2 { slow } else { format.t35() });
        assert_eq!(with_gap + format.t35(), cycle + slow, "a unit that needs a longer gap");
        assert_eq!(shortest_cycle(&format, &targets, |_| Duration::MAX), Duration::MAX, "for ever");
    }

    #[test]
    fn what_cannot_be_asked_is_refused() {
        let unit = UnitAddress::new(2).unwrap();
        assert_eq!(check(&[]), Err(PollError::Nothing { unit: None }));
        assert_eq!(check(&[target(1, &[(0, 1)]), target(2, &[])]), Err(PollError::Nothing { unit: Some(unit) }));
        for (address, count) in [(0, 0), (0, 126), (0xFFFF, 2)] {
            let wrong = check(&[target(2, &[(0, 1), (address, count)])]);
            assert_eq!(wrong, Err(PollError::Read { unit, address, count }));
        }
        assert_eq!(check(&[target(2, &[(0xFFFF, 1), (0, 125)])]), Ok(()));
    }
}
