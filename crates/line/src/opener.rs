//! Opens a line, at first and again, without keeping its caller: opening may block in the system for seconds.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::error::Failure;
use crate::queue::LOOK_UP;
use crate::{Line, PortError, PortErrorKind};

/// Opens the line, at first and again after it was lost.
pub type Opener = Box<dyn FnMut() -> Result<Box<dyn Line>, PortError> + Send>;

type Opened = Result<Box<dyn Line>, PortError>;

/// What opens the line, in a thread of its own.
pub(crate) struct LineOpener {
    opener: Arc<Mutex<Opener>>,
    /// An opening that is under way; who asks next waits for the same.
    coming: Option<Receiver<Opened>>,
}

impl LineOpener {
    pub(crate) fn new(opener: Opener) -> Self {
        Self { opener: Arc::new(Mutex::new(opener)), coming: None }
    }

    /// Opens the line, unless `give_up`, asked every 50 ms, says so first. The opening then goes on, and the next call
    /// gets what becomes of it.
    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<Box<dyn Line>, Failure> {
        let coming = match self.coming.take() {
            Some(coming) => coming,
            None => self.start().map_err(|error| failed(&error.to_string()))?,
        };
        loop {
            match coming.recv_timeout(LOOK_UP) {
                Ok(opened) => return opened.map_err(Failure::Port),
                Err(RecvTimeoutError::Disconnected) => return Err(failed("the thread that opens it ended")),
                Err(RecvTimeoutError::Timeout) if give_up() => {
                    self.coming = Some(coming);
                    return Err(Failure::Interrupted);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    fn start(&self) -> std::io::Result<Receiver<Opened>> {
        let (done, coming) = channel();
        let opener = Arc::clone(&self.opener);
        thread::Builder::new().name(String::from("drivebus-open")).spawn(move || {
            // An opener that panicked before may well work now.
            let result = opener.lock().unwrap_or_else(PoisonError::into_inner)();
            // Nobody takes the line any more where the bus is gone: it is closed again.
            let _ = done.send(result);
        })?;
        Ok(coming)
    }
}

fn failed(why: &str) -> Failure {
    let message = format!("it could not be opened: {why}; make a new bus");
    Failure::Port(PortError::new(PortErrorKind::Other, "port", message))
}
