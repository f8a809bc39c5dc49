//! The samples of a poll between who puts them there and who waits for them.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;

use crate::bus::Bus;
use crate::poll::ring::{PollBatch, PollSample, Ring};
use crate::poll::schedule::Schedule;
use crate::system::clock::{LOOK_UP, monotonic, sleep_until};

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

/// How long before a beat the poll's thread stops looking whether it is to end, and only waits.
const NEAR: Duration = Duration::from_millis(1);

/// What is called when samples are there.
pub(crate) type Notify = Box<dyn FnOnce() + Send>;

/// Who is called, at how many samples, and whether it still wants to be.
struct Call {
    count: usize,
    wanted: Arc<AtomicBool>,
    notify: Notify,
}

/// The samples of a poll, and who waits for them.
#[derive(Debug)]
pub(crate) struct Samples {
    state: Mutex<State>,
    /// Samples are there that somebody waits for, or it is over.
    there: Condvar,
    /// It is over.
    ended: Condvar,
}

struct State {
    ring: Ring,
    cycles: u64,
    late: u64,
    missing: u64,
    over: bool,
    /// The least number of samples that somebody waits for. A wake-up costs as much as an exchange: none for nobody.
    wanted: usize,
    calls: Vec<Call>,
}

impl Call {
    fn make(self) {
        if self.wanted.load(Ordering::Acquire) {
            (self.notify)();
        }
    }
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("State").field("samples", &self.ring.len()).field("over", &self.over).finish_non_exhaustive()
    }
}

impl State {
    /// Those of the calls that are to be made now.
    fn due(&mut self) -> Vec<Call> {
        let there = if self.over { usize::MAX } else { self.ring.len() };
        let (due, later) = std::mem::take(&mut self.calls).into_iter().partition(|call| call.count <= there);
        self.calls = later;
        self.wanted = self.calls.iter().map(|call| call.count).min().unwrap_or(usize::MAX);
        due
    }
}

impl Samples {
    /// `None` where there is no room for them.
    pub(crate) fn new(size: usize, stride: usize) -> Option<Self> {
        let ring = Ring::new(size, stride)?;
        let state = State { ring, cycles: 0, late: 0, missing: 0, over: false, wanted: usize::MAX, calls: Vec::new() };
        Some(Self { state: Mutex::new(state), there: Condvar::new(), ended: Condvar::new() })
    }

    /// Adds one, as counted by `schedule`; not once it is over, for who ended it may have counted already.
    pub(crate) fn put(&self, sample: PollSample, words: &[u16], schedule: &Schedule) {
        let mut state = self.lock();
        if state.over {
            return;
        }
        state.missing += u64::from(sample.missing.is_some());
        (state.cycles, state.late) = (schedule.cycles(), schedule.late());
        state.ring.push(sample, words);
        if state.ring.len() >= state.wanted {
            let due = state.due();
            drop(state);
            self.there.notify_all();
            for call in due {
                call.make();
            }
        }
    }

    /// Has `notify` called, once, when `count` are there or it is over: now, or by who puts them there. Not, once it is no
    /// longer `wanted`.
    pub(crate) fn call_when(&self, count: usize, wanted: Arc<AtomicBool>, notify: Notify) {
        let mut state = self.lock();
        if state.over || state.ring.len() >= count {
            drop(state);
            return notify();
        }
        state.calls.retain(|call| call.wanted.load(Ordering::Acquire));
        state.calls.push(Call { count, wanted, notify });
        state.wanted = state.wanted.min(count);
    }

    /// Waits in real time until `count` are there, for `timeout` at most, and tells how many are there.
    pub(crate) fn wait(&self, count: usize, timeout: Option<Duration>, give_up: &mut dyn FnMut() -> bool) -> usize {
        let deadline = timeout.map(|timeout| monotonic() + timeout);
        let mut look_up = monotonic() + LOOK_UP;
        let mut state = self.lock();
        while state.ring.len() < count && !state.over {
            let now = monotonic();
            if deadline.is_some_and(|deadline| now >= deadline) {
                break;
            }
            if now >= look_up {
                // Without the lock: the caller may need time or locks of its own to answer.
                drop(state);
                if give_up() {
                    return self.len();
                }
                look_up = monotonic() + LOOK_UP;
                state = self.lock();
                continue;
            }
            let until = deadline.map_or(look_up, |deadline| deadline.min(look_up));
            state.wanted = state.wanted.min(count);
            let left = until.saturating_duration_since(now);
            state = self.there.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        state.ring.len()
    }

    /// Waits in real time for `until` on the clock of `bus`, or until it is over.
    pub(crate) fn pause(&self, bus: &Bus, until: Instant) {
        let mut state = self.lock();
        while !state.over && !bus.is_shut() {
            let left = until.saturating_duration_since(bus.now());
            if left <= NEAR {
                drop(state);
                sleep_until(monotonic() + left);
                return;
            }
            let wait = left.saturating_sub(NEAR).min(LOOK_UP);
            state = self.ended.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    pub(crate) fn take(&self, max: usize) -> PollBatch {
        self.lock().ring.take(max)
    }

    pub(crate) fn len(&self) -> usize {
        self.lock().ring.len()
    }

    pub(crate) fn counts(&self) -> PollCounts {
        let state = self.lock();
        PollCounts { cycles: state.cycles, missing: state.missing, late: state.late, dropped: state.ring.dropped() }
    }

    pub(crate) fn are_over(&self) -> bool {
        self.lock().over
    }

    /// No more samples come.
    pub(crate) fn end(&self) {
        let mut state = self.lock();
        state.over = true;
        let due = state.due();
        drop(state);
        for call in due {
            call.make();
        }
        self.there.notify_all();
        self.ended.notify_all();
    }

    /// Nothing is done under the lock that can panic.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
