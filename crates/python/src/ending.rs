//! The end of the program, for what calls Python's code from here.
//!
//! While the interpreter ends, Python before 3.14 ends each other thread that wants the GIL back, wherever it stands
//! (`pthread_exit`). Where Rust called the code that it stands in, Rust's frames are taken down without the GIL, and the
//! process crashes. A thread that let go of the GIL here is safe: pyo3 lets it wait for ever. So when the last of what the
//! program does at its end is done, nobody may stand in such code any more, but for the thread that ends the program.
//!
//! Without locks, which a forked child might find taken for ever.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How long the end of the program waits for others to come out, and they to be let in again. An object that stands for a
/// port may never come out.
const PATIENCE: Duration = Duration::from_secs(1);
/// How fine the waits here are.
const STEP: Duration = Duration::from_millis(1);

static INSIDE: AtomicUsize = AtomicUsize::new(0);
static OVER: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Whether this thread is the one that ends the program: the interpreter does not end that one.
    static ENDS_IT: Cell<bool> = const { Cell::new(false) };
}

/// Held while Python's code is called that may let go of the GIL.
pub(crate) struct Inside {
    counted: bool,
}

impl Inside {
    /// `None` when it is too late for that.
    pub(crate) fn enter() -> Option<Self> {
        if ENDS_IT.get() {
            return Some(Self { counted: false });
        }
        // In this order: either the end of the program finds this, or this finds the end.
        INSIDE.fetch_add(1, Ordering::SeqCst);
        let inside = Self { counted: true };
        (!is_over()).then_some(inside)
    }

    /// Waits a while where it is too late: the thread that ends the program may still ask the line for something. The
    /// caller must not be attached.
    pub(crate) fn wait() -> Option<Self> {
        let end = Instant::now() + PATIENCE;
        loop {
            let inside = Self::enter();
            if inside.is_some() || Instant::now() >= end {
                return inside;
            }
            thread::sleep(STEP);
        }
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        if self.counted {
            // A child that was forked in here counts anew.
            let _ = INSIDE.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |count| count.checked_sub(1));
        }
    }
}

/// Whether the last of what the program does at its end is done.
pub(crate) fn is_over() -> bool {
    OVER.load(Ordering::SeqCst)
}

/// Does `work` without the GIL. What the thread that ends the program still asks for, others may have to do.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    py.detach(|| {
        let _open = (ENDS_IT.get() && OVER.swap(false, Ordering::SeqCst)).then(|| OpenAgain);
        work()
    })
}

struct OpenAgain;

impl Drop for OpenAgain {
    fn drop(&mut self) {
        close();
    }
}

/// Lets nobody in any more, and waits until those who are inside have come out.
fn close() {
    OVER.store(true, Ordering::SeqCst);
    let end = Instant::now() + PATIENCE;
    while INSIDE.load(Ordering::SeqCst) > 0 && Instant::now() < end {
        thread::sleep(STEP);
    }
}

/// This thread ends the program, and has nothing left to do for that here.
#[pyfunction]
pub(crate) fn end_of_program(py: Python<'_>) {
    ENDS_IT.set(true);
    py.detach(close);
}

/// This is a forked child: nothing of that is so here.
#[pyfunction]
pub(crate) fn begin_of_child() {
    ENDS_IT.set(false);
    INSIDE.store(0, Ordering::SeqCst);
    OVER.store(false, Ordering::SeqCst);
}
