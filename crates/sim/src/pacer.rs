//! The one thread that serves every port of the process in real time, however many lines there are.
//!
//! It sleeps until something arrives or a character is due, and is awake only for the last few µs before an exact
//! moment: the last character of an answer. It starts with the first port and ends with the last.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::process;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant as SystemInstant};

use crate::lateness::Lateness;
use crate::watch::{Key, Watch};

/// What the thread serves: a port, or what ports come from.
pub(crate) trait Served: Send {
    /// Does what is due; `readable` says that its descriptor is. It looks after its own descriptors in `watch`.
    fn serve(&mut self, readable: bool, watch: &Watch, key: Key) -> Next;

    /// Takes its descriptors out of `watch`; it is to be dropped.
    fn leave(&mut self, watch: &Watch);
}

/// What something served waits for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Next {
    /// Until its descriptor is readable.
    Readable,
    /// That, or this moment.
    At(Due),
    /// It is over.
    Gone,
}

/// When something is to be done: not before `at`, and not after `latest` if the machine can help it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Due {
    pub(crate) at: SystemInstant,
    /// The same where the moment is exact.
    pub(crate) latest: SystemInstant,
}

impl Due {
    fn is_exact(self) -> bool {
        self.at == self.latest
    }

    /// When to be awake for it.
    fn wake(self, margin: Duration) -> SystemInstant {
        if self.is_exact() { self.latest.checked_sub(margin).unwrap_or(self.at) } else { self.latest }
    }
}

/// Something served, for as long as this is there.
#[derive(Debug)]
pub(crate) struct Serving {
    pacer: Arc<Pacer>,
    key: Key,
}

impl Serving {
    /// Serves what `make` makes: it is given its name, under which it watches its descriptors.
    pub(crate) fn start(make: impl FnOnce(&Watch, Key) -> io::Result<Box<dyn Served>>) -> io::Result<Self> {
        let mut running = running();
        let (pacer, served) = match running.take() {
            Some((pacer, served)) if pacer.is_ours() => (pacer, served),
            stale => {
                std::mem::forget(stale); // the parent's: its thread is not in this process
                (Pacer::start()?, 0)
            }
        };
        *running = Some((Arc::clone(&pacer), served + 1));
        let key = pacer.next_key.fetch_add(1, Ordering::Relaxed);
        let serving = Self { pacer, key };
        drop(running);
        // From here on the thread ends with `serving`, also where there is nothing to serve.
        let served = make(&serving.pacer.watch, key)?;
        serving.pacer.lock().slots.push(Slot { key, served, due: None });
        serving.pacer.nudge();
        Ok(serving)
    }
}

impl Drop for Serving {
    /// It is closed when this returns.
    fn drop(&mut self) {
        if !self.pacer.is_ours() {
            return; // a forked child leaves the parent's ports alone
        }
        let mut state = self.pacer.lock();
        if let Some(place) = state.slots.iter().position(|slot| slot.key == self.key) {
            state.slots.swap_remove(place).served.leave(&self.pacer.watch);
        }
        drop(state);
        let mut running = running();
        let Some((pacer, served)) = running.as_mut().filter(|(pacer, _)| Arc::ptr_eq(pacer, &self.pacer)) else {
            return;
        };
        *served -= 1;
        if *served == 0 {
            let pacer = Arc::clone(pacer);
            *running = None;
            drop(running);
            pacer.end();
        }
    }
}

/// The pacer of this process and how many are served, while there are any.
type Running = Option<(Arc<Pacer>, usize)>;

fn running() -> MutexGuard<'static, Running> {
    static RUNNING: Mutex<Running> = Mutex::new(None);
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One of those that are served.
struct Slot {
    key: Key,
    served: Box<dyn Served>,
    due: Option<Due>,
}

#[derive(Default)]
struct State {
    slots: Vec<Slot>,
    ended: bool,
    thread: Option<JoinHandle<()>>,
}

/// The thread and what it serves.
struct Pacer {
    watch: Watch,
    /// Writing to it wakes the thread.
    nudge: OwnedFd,
    next_key: AtomicU64,
    state: Mutex<State>,
    /// Where it runs. A forked child inherits this, and no thread.
    process: u32,
}

impl std::fmt::Debug for Pacer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pacer").field("process", &self.process).finish_non_exhaustive()
    }
}

/// Under which the thread watches for nudges.
const NUDGE: Key = 0;

impl Pacer {
    fn start() -> io::Result<Arc<Self>> {
        let (woken, nudge) = io::pipe()?;
        rustix::io::ioctl_fionbio(&woken, true)?;
        rustix::io::ioctl_fionbio(&nudge, true)?;
        let watch = Watch::new()?;
        watch.add(woken.as_fd(), NUDGE)?;
        let pacer = Arc::new(Self {
            watch,
            nudge: nudge.into(),
            next_key: AtomicU64::new(NUDGE + 1),
            state: Mutex::default(),
            process: process::id(),
        });
        let own = Arc::clone(&pacer);
        let thread = thread::Builder::new().name(String::from("drivebus-sim")).spawn(move || {
            sleep_precisely();
            own.run(&woken.into());
        })?;
        pacer.lock().thread = Some(thread);
        Ok(pacer)
    }

    /// Ends the thread and waits for it.
    fn end(&self) {
        let thread = {
            let mut state = self.lock();
            state.ended = true;
            state.thread.take()
        };
        self.nudge();
        if let Some(thread) = thread {
            // A panic in the thread has been reported by the thread.
            let _ = thread.join();
        }
    }

    fn is_ours(&self) -> bool {
        self.process == process::id()
    }

    fn nudge(&self) {
        // It fails where the pipe is full, and then the thread has been nudged enough.
        let _ = rustix::io::write(&self.nudge, &[0]);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self, woken: &OwnedFd) {
        let mut lateness = Lateness::new();
        let mut ready = Vec::new();
        loop {
            if ready.contains(&NUDGE) {
                // However many there were, and if there was none: what they are about is looked at next.
                let _ = rustix::io::read(woken, &mut [0; 64]);
            }
            let next = {
                let mut state = self.lock();
                if state.ended {
                    return;
                }
                self.serve(&mut state, &ready, lateness.margin())
            };
            ready.clear();
            if self.wait(next, &mut lateness, &mut ready).is_err() {
                return; // the system refuses to wait: nothing can be served
            }
        }
    }

    /// Serves what is readable or due; returns what is due next.
    fn serve(&self, state: &mut State, ready: &[Key], margin: Duration) -> Option<Due> {
        let now = SystemInstant::now();
        state.slots.retain_mut(|slot| {
            let readable = ready.contains(&slot.key);
            if readable || slot.due.is_some_and(|due| due.at <= now) {
                slot.due = match slot.served.serve(readable, &self.watch, slot.key) {
                    Next::Readable => None,
                    Next::At(due) => Some(due),
                    Next::Gone => {
                        slot.served.leave(&self.watch);
                        return false;
                    }
                };
            }
            true
        });
        state.slots.iter().filter_map(|slot| slot.due).min_by_key(|due| due.wake(margin))
    }

    /// Until something is readable, which is then in `ready`, or until `next`.
    fn wait(&self, next: Option<Due>, lateness: &mut Lateness, ready: &mut Vec<Key>) -> io::Result<()> {
        let Some(next) = next else { return self.watch.wait(None, ready) };
        let wake = next.wake(lateness.margin());
        let left = wake.saturating_duration_since(SystemInstant::now());
        if !left.is_zero() {
            self.watch.wait(Some(left), ready)?;
            if !ready.is_empty() {
                return Ok(());
            }
            lateness.note(SystemInstant::now().saturating_duration_since(wake));
        }
        // Awake, but not deaf: requests are read at once all the same.
        while ready.is_empty() && next.is_exact() && SystemInstant::now() < next.at {
            self.watch.wait(Some(Duration::ZERO), ready)?;
        }
        Ok(())
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
