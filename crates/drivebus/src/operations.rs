//! Operations of drives over a line: tasks of the core, whose wishes are done one after another.
//!
//! An operation is written once, in `drivebus-drive`; here it finds a line, for who waits and for who awaits.

use std::sync::Arc;
use std::time::{Duration, SystemTime};

use drivebus_drive::task::{
    Cause, LineError, Link, Misuse, Outcome, Payload as Words, Read, Seen, Stamped, Step, Task, Wish, Write,
};
use drivebus_drive::{self as drive, Families, Identification, Look, Looks, NotTold};
use drivebus_line::{Done, ErrorKind, Failure};
use drivebus_rtu::{Answer, ExceptionCode, Instant, UnitAddress};

use crate::bus::Bus;
use crate::checks;
use crate::error::Error;
use crate::options::CallOptions;
use crate::payload::Payload;
use crate::replies;

impl LineError for Error {
    fn cause(&self) -> Cause {
        match self.kind() {
            ErrorKind::NoAnswer => Cause::NoAnswer,
            ErrorKind::BadAnswer | ErrorKind::Crc => Cause::BadAnswer,
            ErrorKind::Port => Cause::Port,
            _ if self.call().is_some_and(|call| matches!(call.failure, Failure::Halted { .. })) => Cause::Halted,
            _ => self.code().map(ExceptionCode).map_or(Cause::Other, |code| Cause::Refused(code, code.meaning())),
        }
    }

    fn raw(&self) -> &[u8] {
        Self::raw(self)
    }

    fn was_sent(&self) -> bool {
        self.call().is_some_and(|call| call.sent.is_some())
    }
}

impl From<Misuse> for Error {
    /// What a task wants here is asked, and what it is told fits: only a clock of another kind, or a task of somebody's
    /// own that waits for something else, leads to this.
    fn from(misuse: Misuse) -> Self {
        Self::not_allowed(misuse)
    }
}

impl From<NotTold<Self>> for Error {
    fn from(why: NotTold<Self>) -> Self {
        match why {
            NotTold::Failed(error) => error,
            why @ NotTold::Busy { .. } => Self::of(ErrorKind::BadAnswer, why),
            why => Self::of(ErrorKind::NoAnswer, why),
        }
    }
}

/// What identifies `unit`.
pub(crate) fn identify(unit: UnitAddress) -> Task<Result<Identification, Error>, Error> {
    Task::new(async move |line| Ok(drive::identify(&line, Families::shipped(), unit).await?))
}

/// What looks at `unit`.
pub(crate) fn look(unit: u8, looks: &Arc<Looks>) -> Result<Task<Result<Look, Error>, Error>, Error> {
    let (unit, looks) = (checks::unit(unit)?, Arc::clone(looks));
    Ok(Task::new(move |line| async move { looks.look(&line, unit, false).await }))
}

/// An operation wants what no bus does.
pub(crate) fn unknown(wish: &Wish) -> Error {
    Error::not_allowed(format!("no bus knows how to do {wish}"))
}

/// What a read of an operation wants otherwise than its bus.
pub(crate) fn options_of(read: &Read) -> CallOptions {
    let options = options(read.timeout, read.is_urgent);
    read.retries.map_or(options, |retries| options.retries(retries))
}

/// What a write of an operation carries.
pub(crate) fn payload_of(write: &Write) -> Payload<'_> {
    match &write.payload {
        Words::Word(word) => Payload::from(*word),
        Words::Words(words) => Payload::from(words.as_slice()),
    }
}

/// What a write of an operation wants otherwise than its bus. This bus knows no family of its units, and holds no word back.
pub(crate) fn options_of_write(write: &Write) -> CallOptions {
    let options = options(write.timeout, write.is_urgent);
    let options = write.read_back.map_or(options, |address| options.read_back(address));
    let options = write.connection.map_or(options, |connection| options.connection(connection));
    write.halts.map_or(options, |halts| options.halts(halts))
}

fn options(timeout: Option<Duration>, is_urgent: bool) -> CallOptions {
    let options = timeout.map_or(CallOptions::new(), |timeout| CallOptions::new().timeout(timeout));
    if is_urgent { options.urgent() } else { options }
}

impl Bus {
    /// Finds out what `unit` is: by its identification code, or by which words it answers and which it refuses.
    ///
    /// Only reads. What was found says how sure it is, and prints as a sentence. Known are the shipped families: nothing is
    /// without the feature `builtin-profiles`.
    ///
    /// ```
    /// # #[cfg(feature = "sim")] {
    /// let bus = drivebus::Bus::open("sim://1=gd350,2=vfd500?clock=virtual")?;
    /// let found = bus.identify(1)?;
    /// assert_eq!(found.family(), Some("gd350"));
    /// println!("{found}");
    /// # }
    /// # Ok::<(), drivebus::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error`]: the unit did not say what it is; nothing of it changed.
    pub fn identify(&self, unit: u8) -> Result<Identification, Error> {
        self.carry_out(identify(checks::unit(unit)?))
    }

    /// Looks at `unit`: what its status words say, in the fewest reads. What no document of its family proves is left out,
    /// unless the `looks` trust that.
    ///
    /// ```
    /// use std::sync::Arc;
    ///
    /// use drivebus::drive::Looks;
    /// use drivebus::drives::State;
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = drivebus::Bus::open("sim://gd350?clock=virtual")?;
    /// let looks = Arc::new(Looks::new(&drivebus::Profile::builtin("gd350")?, false));
    /// let look = bus.look(1, &looks)?;
    /// assert_eq!(look.state, State::Stopped);
    /// assert_eq!(look.to_string(), "stopped");
    /// # }
    /// # Ok::<(), drivebus::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error`]: a look changes nothing in a drive, whatever became of it.
    pub fn look(&self, unit: u8, looks: &Arc<Looks>) -> Result<Look, Error> {
        self.carry_out(look(unit, looks)?)
    }

    /// Carries an operation out: does what the `task` wishes for, one thing after another, until it is done.
    ///
    /// # Errors
    ///
    /// Those of the task. [`NotAllowed`](ErrorKind::NotAllowed) also where it wishes for what no bus does.
    pub fn carry_out<T>(&self, mut task: Task<Result<T, Error>, Error>) -> Result<T, Error> {
        let (mut latest, mut outcome) = (Instant::ZERO, None);
        loop {
            let seen = self.seen(&mut latest);
            outcome = Some(match task.step(seen, outcome)? {
                Step::Done(done) => return done,
                Step::Wish(Wish::Sleep(time)) => {
                    self.sleep(time);
                    Outcome::Slept
                }
                Step::Wish(Wish::Read(read)) => self.came_of(&read).unwrap_or_else(Outcome::Failed),
                Step::Wish(Wish::Write(write)) => {
                    let options = options_of_write(&write);
                    let came = self.write_with(write.unit.get(), write.place, payload_of(&write), options);
                    came.map_or_else(Outcome::Failed, |()| Outcome::Written)
                }
                Step::Wish(Wish::Link(unit)) => Outcome::Link(self.link_of(unit)),
                Step::Wish(Wish::Halts(unit)) => Outcome::Halts(Some(self.core.halts(unit))),
                // Nobody keeps or shows here what comes about.
                Step::Wish(Wish::Tell(_)) => Outcome::Heard,
                Step::Wish(wish) => return Err(unknown(&wish)),
            });
        }
    }

    /// The line as it is before a step; its clock does not go back behind the `latest` moment.
    pub(crate) fn seen(&self, latest: &mut Instant) -> Seen {
        *latest = self.now().max(*latest);
        Seen { now: *latest, connection: self.core.reconnects(), is_closed: self.is_closed() }
    }

    /// What `words` are to the operation that asked for them by `read`, which took place as `done` says.
    pub(crate) fn outcome_of(&self, read: &Read, words: Vec<u16>, done: &Done) -> Outcome<Error> {
        if !read.is_stamped {
            return Outcome::Words(words);
        }
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let here = self.now();
        let at = |moment| now.saturating_sub(here.saturating_duration_since(moment));
        Outcome::Stamped(Stamped { words, asked: at(done.sent), answered: at(done.ended) })
    }

    /// How well `unit` could be reached, as operations look at it.
    pub(crate) fn link_of(&self, unit: UnitAddress) -> Link {
        let known = self.core.link(unit);
        Link { good: known.good, asked: known.asked }
    }

    fn came_of(&self, read: &Read) -> Result<Outcome<Error>, Error> {
        let request = checks::read(read.place, read.count)?;
        let options = options_of(read).of(&request)?;
        let mut words = Vec::new();
        let mut take = |answer: Answer<'_>| words = replies::words(&answer);
        let done = self.call(read.unit.into(), &request, options, &mut take)?;
        Ok(self.outcome_of(read, words, &done))
    }
}
