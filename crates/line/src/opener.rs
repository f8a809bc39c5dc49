//! Opens a lost line again without keeping its caller: opening may block in the system for seconds.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::owner::Opener;
use crate::queue::LOOK_UP;
use crate::{Line, PortError, PortErrorKind};

type Opened = Result<Box<dyn Line>, PortError>;

/// What opens the line again, in a thread of its own.
pub(crate) struct Reopen {
    opener: Arc<Mutex<Opener>>,
    /// An opening that is under way; who asks next waits for the same.
    coming: Option<Receiver<Opened>>,
}

impl Reopen {
    pub(crate) fn new(opener: Opener) -> Self {
        Self { opener: Arc::new(Mutex::new(opener)), coming: None }
    }

    /// Opens the line, or returns `None` when `give_up`, asked every 50 ms, says so first. The opening then goes on, and
    /// the next call gets what becomes of it.
    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Option<Opened> {
        let coming = match self.coming.take() {
            Some(coming) => coming,
            None => match self.start() {
                Ok(coming) => coming,
                Err(error) => return Some(Err(failed(&error.to_string()))),
            },
        };
        loop {
            match coming.recv_timeout(LOOK_UP) {
                Ok(opened) => return Some(opened),
                Err(RecvTimeoutError::Disconnected) => return Some(Err(failed("the thread that opens it ended"))),
                Err(RecvTimeoutError::Timeout) if give_up() => {
                    self.coming = Some(coming);
                    return None;
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

fn failed(why: &str) -> PortError {
    PortError::new(PortErrorKind::Other, "port", format!("it could not be opened again: {why}; make a new bus"))
}
