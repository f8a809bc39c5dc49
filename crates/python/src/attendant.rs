//! A thread in which an object of Python is used that stands for a port.
//!
//! Python runs signal handlers in the main thread, wherever that is: in the middle of what such an object does, if it is
//! used there. What a handler raised would look like the object's own failure, some objects make theirs of it, and a read
//! that is torn so loses bytes. In a thread of its own the object fails by itself only, and handlers run where the
//! binding looks for them.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::ending::Inside;

type Job = Box<dyn FnOnce() + Send>;

/// The thread. It ends with this.
#[derive(Debug)]
pub(crate) struct Attendant {
    jobs: Sender<Job>,
    /// A forked child has no such thread, only what tells of it.
    process: u32,
}

/// Why nothing was done, or nothing is known of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unattended {
    /// The interpreter ends, or this is a forked child.
    Over,
    /// It takes longer than it was given.
    Late,
}

impl Attendant {
    /// # Errors
    ///
    /// The system gives no thread.
    pub(crate) fn new() -> std::io::Result<Self> {
        let (jobs, todo) = channel::<Job>();
        thread::Builder::new()
            .name(String::from("drivebus-port"))
            .spawn(move || todo.into_iter().for_each(|job| job()))?;
        Ok(Self { jobs, process: std::process::id() })
    }

    /// Does `work` there, attached to the interpreter, and waits for it as long as `patience`; the caller must not be
    /// attached.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        patience: Duration,
        work: impl FnOnce(Python<'_>) -> T + Send + 'static,
    ) -> Result<T, Unattended> {
        if self.process != std::process::id() {
            return Err(Unattended::Over);
        }
        let (tell, told) = channel();
        let job = move || {
            let inside = Inside::wait();
            // Nobody listens any more where it was late.
            let _ = tell.send(inside.and_then(|_inside| Python::try_attach(work)));
        };
        self.jobs.send(Box::new(job)).map_err(|_| Unattended::Over)?;
        match told.recv_timeout(patience) {
            Ok(Some(done)) => Ok(done),
            Ok(None) | Err(RecvTimeoutError::Disconnected) => Err(Unattended::Over),
            Err(RecvTimeoutError::Timeout) => Err(Unattended::Late),
        }
    }
}
