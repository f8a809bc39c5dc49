//! A motor that turns for as long as a value lives, and is stopped whatever happens.

use std::ops::Deref;

use drivebus_drive::Start;
use drivebus_drives::Command;

use crate::driving::Drive;
use crate::error::Error;

/// A motor that runs, and is stopped when this is dropped. It is its [`Drive`] as well.
///
/// ```
/// use drivebus::{Bus, Profile};
///
/// # #[cfg(feature = "sim")] {
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
/// drive.prepare()?;
/// let running = drive.running(10.0)?;
/// running.set_frequency(20.0)?; // an error here, or a panic, stops the motor
/// println!("{}", running.status()?);
/// running.stop()?; // so does this, and says whether it is proved
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The drive is told to stop until it takes that, ten seconds long, each fourth time to coast; one that takes it and does
/// not show it is told to coast in the end. Dropped, it does that in this thread, which waits for as long, and no error
/// comes of it.
///
/// What ends a process without dropping its values stops no motor: a signal such as Ctrl-C that nobody handles,
/// [`std::process::exit`], `panic = "abort"`, a loss of power. The example `run_and_stop` handles Ctrl-C. Nor does a bus that
/// was [closed](crate::Bus::close) before.
#[derive(Debug)]
#[must_use = "the motor is stopped when this is dropped"]
pub struct Running {
    drive: Drive,
    end: Command,
    /// How often the unit had been started before.
    starts: u64,
    is_over: bool,
}

impl Drive {
    /// Starts the motor as [`run`](Self::run) does, for as long as what it returns lives: a motor that is started so is
    /// stopped whatever happens, also by a `?` and by a panic.
    ///
    /// # Errors
    ///
    /// Those of [`run`](Self::run). Where the motor may turn, it was stopped before this returns; what came of that, the
    /// message says last.
    pub fn running(&self, hz: impl Into<Option<f64>>) -> Result<Running, Error> {
        self.running_with(&Start::run(false, hz.into()))
    }

    /// As [`running`](Self::running), in whatever way `start` says. A jog is ended by the jog's own ramp, in a family that has
    /// a command for that.
    ///
    /// # Errors
    ///
    /// Those of [`running`](Self::running).
    pub fn running_with(&self, start: &Start) -> Result<Running, Error> {
        let running = Running::before(self, start);
        match self.run_with(start) {
            Ok(()) => Ok(running),
            Err(error) if error.may_have_acted() => Err(Running::after(error, running.stop())),
            Err(error) => {
                running.leave();
                Err(error)
            }
        }
    }
}

impl Running {
    /// The motor that `start` is to start.
    pub(crate) fn before(drive: &Drive, start: &Start) -> Self {
        let named = drive.named();
        Self { drive: drive.clone(), end: named.end_of(start), starts: named.starts(), is_over: false }
    }

    /// Stops the motor, and proves it.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::halt`]: the motor may still turn. It is not told again when this is dropped.
    pub fn stop(mut self) -> Result<(), Error> {
        let ended = self.end();
        self.is_over = true;
        ended
    }

    /// Lets the motor do what it does.
    pub(crate) fn leave(mut self) {
        self.is_over = true;
    }

    /// What came of a start that may have acted, and of the `end` that followed.
    pub(crate) fn after(started: Error, end: Result<(), Error>) -> Error {
        match end {
            Ok(()) => started.saying_last("It was stopped then"),
            Err(error) => started.saying_last(format_args!("It could not be stopped either: {error}")),
        }
    }

    pub(crate) fn end_command(&self) -> Command {
        self.end
    }

    fn end(&self) -> Result<(), Error> {
        self.drive.bus().carry_out(self.drive.named().end(self.end))
    }
}

impl Deref for Running {
    type Target = Drive;

    fn deref(&self) -> &Drive {
        &self.drive
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A start that was not about to be sent leaves alone what somebody else may run.
        if !self.is_over && self.drive.named().starts() > self.starts {
            // Nobody is left to tell it to.
            let _ = self.end();
        }
    }
}
