//! A drive that acts by itself when it hears nothing, kept from it by a thread.

use std::fmt;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use drivebus_drive::task::Task;
use drivebus_drive::{BusTimeout, Families, NotGivenBack, OnSilence};

use crate::driving::Drive;
use crate::error::Error;
use crate::named::{Named, Work};

/// A drive's own time-out of the bus, which is set until this is closed or dropped, and kept from running out by a thread.
///
/// For what no program can look after: a process that is killed, a computer that hangs, a cable that is cut. Each request of
/// anybody to the drive keeps it from acting, and the thread asks for its state four times within the time-out.
///
/// ```
/// use std::time::Duration;
///
/// use drivebus::{Bus, OnSilence, Profile};
///
/// # #[cfg(feature = "sim")] {
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?.unverified(); // its manual prints no time-out
/// drive.prepare()?;
/// let watchdog = drive.watchdog(Duration::from_secs(2), OnSilence::Coast)?;
/// let running = drive.running(10.0)?; // if this process is killed now, the drive coasts after 2 s
/// running.stop()?;
/// watchdog.close()?; // waits until the motor stands
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The thread keeps real time: on a line in virtual time it does not keep up with a [`sleep`](crate::Bus::sleep). A drive that
/// was switched off meanwhile has forgotten its time-out.
///
/// Dropped, it does what [`close`](Self::close) does in this thread, which waits for as long, and no error comes of it. What
/// ends a process without dropping its values leaves the drive to act.
#[must_use = "the drive is given back what it had when this is dropped"]
pub struct Watchdog {
    drive: Drive,
    timeout: BusTimeout,
    keeper: Option<Keeper>,
    error: Arc<Mutex<Option<Error>>>,
    is_over: bool,
}

/// The thread that keeps the line busy. It ends when nobody may tell it to any more.
struct Keeper {
    over: Sender<()>,
    thread: JoinHandle<()>,
}

impl Drive {
    /// Has the drive act by itself after `timeout` without a request to it, for as long as what this returns lives.
    ///
    /// The drive's own parameters of that are set in RAM, and read back. `timeout` is in the range and the steps of the drive's
    /// own (GD350: 0.1 to 60 s, in tenths), and longer than the time-out of the bus, or one lost answer is enough.
    /// [`OnSilence::Coast`] takes the voltage off the motor and trips a fault. [`Stop`](OnSilence::Stop) stops it as the drive
    /// is set to. [`Trip`](OnSilence::Trip) is all that some families can: it may leave the motor running.
    ///
    /// # Errors
    ///
    /// Where [`may_have_acted`](Error::may_have_acted) says so, the drive may have the time-out, or some of it, and acts when
    /// it is over. Else the drive has what it had: also where it took a part, which was given back.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | the family has no such time-out, no document prints it, it cannot be written to RAM alone, or `timeout` or `action` is not among what it takes |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take it |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer) | the line failed |
    /// | [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | it was written, and is not shown |
    pub fn watchdog(&self, timeout: Duration, action: OnSilence) -> Result<Watchdog, Error> {
        let watchdog = Watchdog::before(self, timeout, action)?;
        match self.bus().carry_out(watchdog.set()) {
            Ok(()) => watchdog.keeping_busy(),
            Err(error) => Err(watchdog.left(error)),
        }
    }
}

impl Watchdog {
    /// What is to be set in `drive`. Nothing is sent.
    pub(crate) fn before(drive: &Drive, timeout: Duration, action: OnSilence) -> Result<Self, Error> {
        let timeout = drive.named().bus_timeout(timeout, action)?;
        Ok(Self { drive: drive.clone(), timeout, keeper: None, error: Arc::default(), is_over: false })
    }

    /// What sets it.
    pub(crate) fn set(&self) -> Work<()> {
        self.drive.named().set_timeout(&self.timeout)
    }

    /// What ends it: of one that was not set to the end, what gives back what the drive had.
    pub(crate) fn end(&self) -> Work<()> {
        let named = self.drive.named();
        if self.timeout.is_armed() { named.give_back(&self.timeout) } else { named.put_back(&self.timeout) }
    }

    /// The same, whose thread keeps the line busy from now on.
    pub(crate) fn keeping_busy(mut self) -> Result<Self, Error> {
        let (over, told) = channel();
        let (drive, timeout, error) = (self.drive.clone(), self.timeout.clone(), Arc::clone(&self.error));
        let keep_busy = move || {
            while told.recv_timeout(timeout.interval()) == Err(RecvTimeoutError::Timeout) {
                let Err(failed) = drive.bus().carry_out(drive.named().ask(&timeout)) else { continue };
                *error.lock().unwrap_or_else(PoisonError::into_inner) = Some(failed);
                if drive.bus().is_closed() {
                    return;
                }
            }
        };
        let named = thread::Builder::new().name(format!("drivebus-watchdog-{}", self.drive.unit()));
        let spawned = named.spawn(keep_busy);
        let thread = spawned.map_err(|error| Error::not_allowed(format!("the system gives no thread: {error}")))?;
        self.keeper = Some(Keeper { over, thread });
        Ok(self)
    }

    /// The time without a request after which the drive acts.
    pub fn timeout(&self) -> Duration {
        Duration::try_from_secs_f64(self.timeout.seconds()).unwrap_or(Duration::MAX)
    }

    /// What the drive then does.
    pub fn action(&self) -> OnSilence {
        self.timeout.action()
    }

    /// Whether the drive acts by itself when it hears nothing.
    pub fn armed(&self) -> bool {
        self.timeout.is_armed()
    }

    /// What the last question came to that failed; `None` where none did. The thread goes on asking, unless the bus was closed.
    pub fn error(&self) -> Option<Error> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits while the motor slows down, and gives the drive back what it had, once it is at rest. The line is kept busy
    /// meanwhile. A frequency that has not fallen for a second ends that wait.
    ///
    /// # Errors
    ///
    /// The drive keeps the time-out, and acts when nobody asks it any more. Unless [`may_have_acted`](Error::may_have_acted)
    /// says so, it has all of it.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | the motor goes on turning, or its state may not be used |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take what it had |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer), [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | the line failed |
    pub fn close(mut self) -> Result<(), Error> {
        let ended = self.drive.bus().carry_out(self.end());
        self.is_over = true;
        ended
    }

    /// Leaves the drive what it has.
    pub(crate) fn leave(mut self) {
        self.is_over = true;
    }

    /// The `error` that setting it came to. What the drive took was given back, or could not be.
    pub(crate) fn left(self, error: Error) -> Error {
        self.leave();
        error
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        if !self.is_over && self.timeout.may_be_set() {
            // Nobody is left to tell it to.
            let _ = self.drive.bus().carry_out(self.end());
        }
        if let Some(Keeper { over, thread }) = self.keeper.take() {
            drop(over);
            // It panics only where it was told to.
            let _ = thread.join();
        }
    }
}

impl fmt::Debug for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("Watchdog");
        shown.field("unit", &self.drive.unit()).field("timeout", &self.timeout()).field("action", &self.action());
        shown.field("armed", &self.armed()).field("error", &self.error()).finish_non_exhaustive()
    }
}

impl Named {
    fn bus_timeout(&self, timeout: Duration, action: OnSilence) -> Result<BusTimeout, Error> {
        let timeout = BusTimeout::new(self.rule(), timeout.as_secs_f64(), action);
        timeout.map_err(|why| self.tell("watchdog", Error::not_allowed(why)))
    }

    fn set_timeout(&self, timeout: &BusTimeout) -> Work<()> {
        let (named, timeout) = (self.clone(), timeout.clone());
        Task::new(async move |line| Ok(timeout.set(&named.call(&line), &line, Families::shipped()).await?))
    }

    fn put_back(&self, timeout: &BusTimeout) -> Work<()> {
        let (named, timeout) = (self.clone(), timeout.clone());
        Task::new(async move |line| Ok(timeout.put_back(&named.call(&line), &line, Families::shipped()).await?))
    }

    fn give_back(&self, timeout: &BusTimeout) -> Work<()> {
        let (named, timeout) = (self.clone(), timeout.clone());
        Task::new(async move |line| {
            let why = match timeout.give_back(&named.call(&line), &line, Families::shipped()).await {
                Ok(true) => return Ok(()),
                Ok(false) => Error::not_allowed("its motor goes on turning"),
                Err(NotGivenBack::NotKept(why)) => why.into(),
                Err(NotGivenBack::Failed(error)) => error.having_acted(false),
                Err(why) => Error::not_allowed(why),
            };
            let (seconds, action) = (timeout.seconds(), timeout.action().name());
            let keeps = format_args!("It keeps its time-out: after {seconds} s without a request it will {action}");
            Err(named.tell("watchdog", why).saying_last(keeps))
        })
    }

    fn ask(&self, timeout: &BusTimeout) -> Work<()> {
        let (named, timeout) = (self.clone(), timeout.clone());
        Task::new(async move |line| {
            let asked = timeout.ask(&named.call(&line), &line).await;
            asked.map_err(|error| match error.why {
                Some(failed) => failed,
                None => named.tell("watchdog", Error::not_allowed(error)),
            })
        })
    }
}
