//! Where the threads of the core leave what is meant for an event loop, and how they wake it without the GIL.
//!
//! One byte on a socket says that there is something; the loop watches that socket as it watches any other, and takes
//! everything that has come by then in one go.

use std::io::{Read, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;

#[cfg(unix)]
type Stream = std::os::unix::net::UnixStream;
#[cfg(not(unix))]
type Stream = std::net::TcpStream;

/// Made where it is taken: in the thread of the event loop, with the GIL.
type Letter = Box<dyn for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send>;

/// A number, and what was made: the value, or else the exception.
type Delivered<'py> = (u64, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

/// What is meant for one event loop.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Mailbox {
    pub(crate) inbox: Arc<Inbox>,
}

/// The side of the threads that leave something.
pub(crate) struct Inbox {
    letters: Mutex<Vec<(u64, Letter)>>,
    numbers: AtomicU64,
    bell: Stream,
    /// Kept open for as long as somebody may ring: a socket that nobody reads raises a signal.
    heard: Stream,
}

impl std::fmt::Debug for Inbox {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Inbox").finish_non_exhaustive()
    }
}

impl Inbox {
    /// A number under which something will be left.
    pub(crate) fn number(&self) -> u64 {
        self.numbers.fetch_add(1, Ordering::Relaxed)
    }

    /// Leaves `letter` under `number`. From any thread, without the GIL.
    pub(crate) fn post(
        &self,
        number: u64,
        letter: impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    ) {
        let mut letters = self.letters.lock().unwrap_or_else(PoisonError::into_inner);
        let ring = letters.is_empty();
        letters.push((number, Box::new(letter)));
        drop(letters);
        if ring {
            // A socket that takes no more has not been heard yet, and will be.
            let _ = (&self.bell).write(&[1]);
        }
    }
}

#[pymethods]
impl Mailbox {
    #[new]
    fn new() -> PyResult<Self> {
        let (bell, heard) = pair()?;
        bell.set_nonblocking(true)?;
        heard.set_nonblocking(true)?;
        let inbox = Inbox { letters: Mutex::default(), numbers: AtomicU64::new(0), bell, heard };
        Ok(Self { inbox: Arc::new(inbox) })
    }

    #[cfg(unix)]
    fn fileno(&self) -> std::os::fd::RawFd {
        use std::os::fd::AsRawFd;
        self.inbox.heard.as_raw_fd()
    }

    #[cfg(windows)]
    fn fileno(&self) -> std::os::windows::io::RawSocket {
        use std::os::windows::io::AsRawSocket;
        self.inbox.heard.as_raw_socket()
    }

    #[cfg(unix)]
    fn detach_socket(&self) -> PyResult<std::os::fd::RawFd> {
        use std::os::fd::IntoRawFd;
        Ok(self.inbox.heard.try_clone()?.into_raw_fd())
    }

    #[cfg(windows)]
    fn detach_socket(&self) -> PyResult<std::os::windows::io::RawSocket> {
        use std::os::windows::io::IntoRawSocket;
        Ok(self.inbox.heard.try_clone()?.into_raw_socket())
    }

    fn take<'py>(&self, py: Python<'py>) -> Vec<Delivered<'py>> {
        // First the bell, then the letters: what comes in between rings again.
        while (&self.inbox.heard).read(&mut [0; 64]).is_ok_and(|count| count > 0) {}
        let letters = std::mem::take(&mut *self.inbox.letters.lock().unwrap_or_else(PoisonError::into_inner));
        letters
            .into_iter()
            .map(|(number, letter)| match letter(py) {
                Ok(value) => (number, Some(value), None),
                Err(error) => (number, None, Some(error.into_value(py).into_bound(py).into_any())),
            })
            .collect()
    }
}

#[cfg(unix)]
fn pair() -> std::io::Result<(Stream, Stream)> {
    Stream::pair()
}

/// The two ends of a connection with ourselves.
#[cfg(not(unix))]
fn pair() -> std::io::Result<(Stream, Stream)> {
    let server = std::net::TcpListener::bind((std::net::Ipv4Addr::LOCALHOST, 0))?;
    let bell = Stream::connect(server.local_addr()?)?;
    loop {
        let (heard, from) = server.accept()?;
        // Anybody on this machine may connect.
        if from == bell.local_addr()? {
            bell.set_nodelay(true)?;
            return Ok((bell, heard));
        }
    }
}
