//! Opens a line, at first and again, without keeping its caller: opening may block in the system for seconds.
//!
//! And not too often: who polls a port that is unplugged would otherwise do nothing but try to open it.

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use drivebus_rtu::Instant;

use crate::error::Failure;
use crate::line::{Line, Opener, PortError, PortErrorKind};
use crate::system::clock::{LOOK_UP, monotonic};

type Opened = Result<Box<dyn Line>, PortError>;

/// What opens the line, in a thread of its own.
pub(crate) struct LineOpener {
    opener: Arc<Mutex<Opener>>,
    /// An opening that is under way; who asks next waits for the same.
    coming: Option<Receiver<Opened>>,
    backoff: Backoff,
    /// How long a call waits while a line that was lost is being opened.
    patience: Duration,
    before: Option<Before>,
}

/// What is known of the line that was opened last.
struct Before {
    name: String,
    /// Whether it had a simulation's clock: nothing waits in real time for such a line.
    is_virtual: bool,
}

impl LineOpener {
    pub(crate) fn new(opener: Opener) -> Self {
        let (opener, backoff) = (Arc::new(Mutex::new(opener)), Backoff::default());
        Self { opener, coming: None, backoff, patience: Duration::from_secs(1), before: None }
    }

    /// Opens the line, unless `give_up`, asked every 50 ms, says so first. The opening then goes on, and the next call
    /// gets the line that comes of it.
    ///
    /// It is tried once, as soon as the last try is long enough ago: at most 250 ms from now. What becomes of it is
    /// waited for, at first for as long as it takes, of a lost line for a second: a connection may take much longer.
    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<Box<dyn Line>, Failure> {
        let coming = match self.coming.take().map(|coming| (coming.try_recv(), coming)) {
            Some((Ok(Ok(line)), _)) => return Ok(self.opened(line)),
            Some((Err(TryRecvError::Empty), coming)) => coming,
            // One that failed meanwhile says nothing about now.
            None | Some(_) => {
                self.wait(give_up)?;
                self.start().map_err(|error| failed(&error.to_string()))?
            }
        };
        let give_in = monotonic() + self.patience;
        let opened = loop {
            match coming.recv_timeout(LOOK_UP) {
                Ok(opened) => break opened.map_err(Failure::Port),
                Err(RecvTimeoutError::Disconnected) => break Err(failed("the thread that opens it ended")),
                Err(RecvTimeoutError::Timeout) if give_up() => {
                    self.coming = Some(coming);
                    return Err(Failure::Interrupted);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Some(Before { name, .. }) = &self.before
                && monotonic() >= give_in
            {
                self.coming = Some(coming);
                let message = "it was lost and is still being opened; the next call looks again";
                return Err(Failure::Port(PortError::new(PortErrorKind::NotFound, name, message)));
            }
        };
        self.backoff.tried(monotonic());
        opened.map(|line| self.opened(line))
    }

    fn opened(&mut self, line: Box<dyn Line>) -> Box<dyn Line> {
        self.before = Some(Before { name: line.name(), is_virtual: line.is_virtual() });
        line
    }

    /// A unit has answered over the line that was opened last: when it is lost, that is a new loss.
    pub(crate) fn answered(&mut self) {
        self.backoff = Backoff::default();
    }

    /// Waits until it may be tried again.
    fn wait(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        if self.before.as_ref().is_some_and(|before| before.is_virtual) {
            return Ok(());
        }
        let due = self.backoff.due(monotonic());
        loop {
            let left = due.saturating_duration_since(monotonic());
            if left.is_zero() {
                return Ok(());
            }
            thread::sleep(left.min(LOOK_UP));
            if give_up() {
                return Err(Failure::Interrupted);
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

/// How soon it may be tried again: 10 ms after the first try, then twice as long each time, at most 250 ms.
///
/// A try that succeeds counts like one that fails, until a unit has answered: a server that is taken accepts a
/// connection only to close it.
#[derive(Debug)]
struct Backoff {
    /// The earliest moment of the next try.
    next: Instant,
    /// How long it is waited after that one.
    step: Duration,
}

impl Backoff {
    const FIRST: Duration = Duration::from_millis(10);
    const LONGEST: Duration = Duration::from_millis(250);

    /// When it may be tried by somebody who asks at `now`.
    fn due(&self, now: Instant) -> Instant {
        self.next.max(now)
    }

    /// It was tried, until `now`.
    fn tried(&mut self, now: Instant) {
        self.next = now + self.step;
        self.step = (2 * self.step).min(Self::LONGEST);
    }
}

impl Default for Backoff {
    /// The first try is at once.
    fn default() -> Self {
        Self { next: Instant::ZERO, step: Self::FIRST }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn the_first_try_is_at_once_and_the_others_ever_later() {
        let mut backoff = Backoff::default();
        let mut now = at(0);
        let mut moments = Vec::new();
        for _ in 0..9 {
            now = backoff.due(now);
            moments.push(now);
            backoff.tried(now);
        }
        assert_eq!(moments, [0, 10, 30, 70, 150, 310, 560, 810, 1_060].map(at));
    }

    #[test]
    fn who_comes_late_enough_does_not_wait() {
        let mut backoff = Backoff::default();
        for millis in [0, 10, 30] {
            assert_eq!(backoff.due(at(millis)), at(millis));
            backoff.tried(at(millis));
        }
        for (now, due) in [(31, 70), (69, 70), (70, 70), (400, 400)] {
            assert_eq!(backoff.due(at(now)), at(due), "{now}");
        }
    }

    #[test]
    fn a_try_counts_from_its_end() {
        let mut backoff = Backoff::default();
        backoff.tried(at(3_000)); // nobody accepted for three seconds
        assert_eq!(backoff.due(at(3_000)), at(3_010));
    }

    /// An opener of a line that is not there, with a pause of an hour before its next try; and how often it tried.
    fn waiting() -> (LineOpener, Arc<Mutex<u32>>) {
        let tries = Arc::new(Mutex::new(0));
        let counted = Arc::clone(&tries);
        let mut opener = LineOpener::new(Box::new(move || {
            *counted.lock().unwrap() += 1;
            Err(PortError::new(PortErrorKind::NotFound, "port", "it is not there"))
        }));
        opener.backoff.next = monotonic() + Duration::from_secs(3_600);
        (opener, tries)
    }

    #[test]
    fn a_pause_is_ended_by_who_gives_up_and_nothing_is_tried() {
        let (mut opener, tries) = waiting();
        assert!(matches!(opener.open(&mut || true), Err(Failure::Interrupted)));
        assert_eq!(*tries.lock().unwrap(), 0);
    }

    #[test]
    fn after_an_answer_the_next_try_is_the_first_again() {
        let (mut opener, tries) = waiting();
        opener.answered();
        assert!(matches!(opener.open(&mut || false), Err(Failure::Port(_))));
        assert_eq!((*tries.lock().unwrap(), opener.backoff.step), (1, 2 * Backoff::FIRST));
    }

    #[test]
    fn a_line_of_a_simulation_is_opened_without_a_pause() {
        let (mut opener, tries) = waiting();
        opener.before = Some(Before { name: "simulation".to_owned(), is_virtual: true });
        let mut asked = 0;
        let mut give_up = || {
            asked += 1;
            asked > 100 // five seconds of 3 600; opening takes none of it
        };
        for count in 1..=20 {
            assert!(matches!(opener.open(&mut give_up), Err(Failure::Port(_))));
            assert_eq!(*tries.lock().unwrap(), count);
        }
    }

    #[test]
    fn an_opening_that_takes_long_keeps_only_the_first_call() {
        let (let_go, wait) = channel::<()>();
        let mut opener = LineOpener::new(Box::new(move || {
            wait.recv().unwrap();
            Err(PortError::new(PortErrorKind::NotFound, "tcp://gateway:502", "nobody answers"))
        }));
        let message = |result: Result<_, Failure>| result.map(drop).unwrap_err().to_string();
        let before = Before { name: "tcp://gateway:502".to_owned(), is_virtual: false };
        opener.patience = Duration::ZERO;
        opener.before = Some(before);
        for _ in 0..2 {
            let said = message(opener.open(&mut || false));
            assert!(said.starts_with("tcp://gateway:502: it was lost and is still being opened"), "{said}");
        }
        // The one that is under way, and another if that has failed by now.
        let_go.send(()).unwrap();
        let_go.send(()).unwrap();
        opener.before = None;
        assert_eq!(message(opener.open(&mut || false)), "tcp://gateway:502: nobody answers");
    }
}
