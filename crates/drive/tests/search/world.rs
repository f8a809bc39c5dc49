//! The line of one run, with a drive behind it: what becomes of each wish, by the faults that were placed.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::Family;
use drivebus_drive::task::{Cause, LineError, Link, Outcome, Payload, Read, Seen, Stamped, Wish, Write};
use drivebus_rtu::{ExceptionCode, Instant};

use crate::drives::{Drive, TAKES, Took};
use crate::judge::Judge;

/// Something that goes wrong, before a wish or with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Somebody else tells the unit to halt, before this wish.
    Halted,
    /// The drive trips before.
    Trips,
    /// The port is lost and opened again before, unseen; another drive may be behind it then.
    Reopened(bool),
    /// The answer comes as late as answers are waited for.
    Late,
    /// The request is lost.
    Lost,
    /// Its answer is: the drive has done it.
    Unheard,
    /// So it has, and its answer came damaged.
    Damaged,
    /// The drive refuses it.
    Refused(u8),
    /// It says that it is at it, and is.
    Acknowledged,
    /// It says so, and nothing comes of it.
    Ignored,
    /// The port was lost before anything was sent; another drive may be behind it where it is opened again.
    NoPort(bool),
    /// The port was lost when it had been sent, and the drive has done it.
    PortGone(bool),
    /// The unit could hardly be reached lately.
    BadLink,
}

impl Fault {
    /// Whether it comes before the wish, and not of it.
    pub(crate) const fn is_before(self) -> bool {
        matches!(self, Self::Halted | Self::Trips | Self::Reopened(_) | Self::Late)
    }
}

/// Faults before a wish for which somebody has to wait.
const BEFORE: [Fault; 4] = [Fault::Halted, Fault::Trips, Fault::Reopened(false), Fault::Reopened(true)];
const OF_READS: [Fault; 7] = [
    Fault::Late,
    Fault::Lost,
    Fault::Damaged,
    Fault::Refused(0x06),
    Fault::Refused(0x02),
    Fault::PortGone(false),
    Fault::PortGone(true),
];
const OF_WRITES: [Fault; 12] = [
    Fault::Late,
    Fault::Lost,
    Fault::Unheard,
    Fault::Damaged,
    Fault::Refused(0x06),
    Fault::Refused(0x02),
    Fault::Acknowledged,
    Fault::Ignored,
    Fault::NoPort(false),
    Fault::NoPort(true),
    Fault::PortGone(false),
    Fault::PortGone(true),
];

/// The faults that a wish may meet.
pub(crate) fn faults_of(wish: &Wish) -> Vec<Fault> {
    let of: &[Fault] = match wish {
        Wish::Read(_) => &OF_READS,
        Wish::Write(_) => &OF_WRITES,
        Wish::Link(_) => return vec![Fault::BadLink],
        // What comes before the next one is tried there.
        _ => return Vec::new(),
    };
    [&BEFORE, of].concat()
}

/// What the line made of a wish.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Failed {
    cause: Cause,
    was_sent: bool,
}

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}, {}", self.cause, if self.was_sent { "sent" } else { "not sent" })
    }
}

impl LineError for Failed {
    fn cause(&self) -> Cause {
        self.cause
    }

    fn raw(&self) -> &[u8] {
        &[]
    }

    fn was_sent(&self) -> bool {
        self.was_sent
    }
}

const fn failed(cause: Cause) -> Failed {
    Failed { cause, was_sent: true }
}

/// The line, its time, and who answers.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) now: Instant,
    pub(crate) connection: u64,
    pub(crate) halts: u64,
    pub(crate) drive: Drive,
    /// Who may be there when the port is opened again.
    other: Option<Drive>,
    /// The port is lost, and opened by the next request; another drive may be there then.
    is_lost: Option<bool>,
    pub(crate) judge: Judge,
}

impl World {
    pub(crate) fn new(drive: Drive, other: Option<Drive>, judge: Judge) -> Self {
        Self { now: Instant::ZERO, connection: 0, halts: 0, drive, other, is_lost: None, judge }
    }

    pub(crate) fn seen(&self) -> Seen {
        Seen { now: self.now, connection: self.connection, is_closed: false }
    }

    /// What comes of `wish`, of a unit that is taken for one of `family`.
    pub(crate) fn outcome_of(
        &mut self,
        wish: &Wish,
        family: Option<&Arc<Family>>,
        faults: &[Fault],
    ) -> Outcome<Failed> {
        for &fault in faults {
            match fault {
                Fault::Halted => {
                    self.halts += 1;
                    self.drive.stop(self.now);
                }
                Fault::Trips => self.drive.trip(),
                Fault::Reopened(by_another) => self.is_lost = Some(by_another),
                _ => {}
            }
        }
        if faults.iter().any(|fault| matches!(fault, Fault::Reopened(_))) {
            self.open();
        }
        let fault = faults.iter().copied().find(|fault| !fault.is_before());
        let takes = if faults.contains(&Fault::Late) { Duration::from_secs(11) } else { TAKES };
        match wish {
            Wish::Read(read) => self.read(read, fault, takes).unwrap_or_else(Outcome::Failed),
            Wish::Write(write) => {
                self.write(write, family, fault, takes).map_or_else(Outcome::Failed, |()| Outcome::Written)
            }
            Wish::Sleep(time) => {
                self.now = self.now + *time;
                Outcome::Slept
            }
            Wish::Link(_) => {
                let good = if fault.is_some() { 5 } else { 10 };
                self.judge.linked(good);
                Outcome::Link(Link { good, asked: 10 })
            }
            Wish::Halts(_) => {
                self.judge.decided(self.halts);
                Outcome::Halts(Some(self.halts))
            }
            Wish::Tell(_) => Outcome::Heard,
            wish => panic!("nobody knows {wish}"),
        }
    }

    /// The next request opens a port that was lost.
    fn open(&mut self) {
        let Some(by_another) = self.is_lost.take() else { return };
        self.connection += 1;
        let other = self.other.take_if(|_| by_another);
        self.judge.opened(other.is_some());
        self.drive = other.unwrap_or_else(|| self.drive.clone());
    }

    fn read(&mut self, read: &Read, fault: Option<Fault>, takes: Duration) -> Result<Outcome<Failed>, Failed> {
        self.open();
        self.judge.asked(read.place);
        let asked = self.now;
        match fault {
            None => self.now = self.now + takes,
            Some(Fault::Refused(code)) => {
                self.now = self.now + takes;
                self.judge.spoke();
                if code == 0x02 && self.drive.words(read.place, read.count, self.now).is_ok() {
                    self.judge.denied();
                }
                return Err(refused(code));
            }
            Some(fault) => {
                self.now = self.now + read.timeout.unwrap_or(Duration::from_millis(500));
                return Err(failed(match fault {
                    Fault::Lost => Cause::NoAnswer,
                    Fault::Damaged => Cause::BadAnswer,
                    Fault::PortGone(by_another) => {
                        self.is_lost = Some(by_another);
                        Cause::Port
                    }
                    fault => panic!("no read meets {fault:?}"),
                }));
            }
        }
        self.judge.spoke();
        let words = self.drive.words(read.place, read.count, self.now).map_err(refused)?;
        self.judge.read(read, &words, &self.drive, self.now);
        let since = |moment: Instant| moment.saturating_duration_since(Instant::ZERO);
        if !read.is_stamped {
            return Ok(Outcome::Words(words));
        }
        Ok(Outcome::Stamped(Stamped { words, asked: since(asked), answered: since(self.now) }))
    }

    fn write(
        &mut self,
        write: &Write,
        family: Option<&Arc<Family>>,
        fault: Option<Fault>,
        takes: Duration,
    ) -> Result<(), Failed> {
        let not_sent = |cause| Failed { cause, was_sent: false };
        if write.halts.is_some_and(|halts| halts != self.halts) {
            return Err(not_sent(Cause::Halted));
        }
        self.open();
        if write.connection.is_some_and(|connection| connection != self.connection) {
            return Err(not_sent(Cause::Port));
        }
        let fault = match fault {
            Some(Fault::Acknowledged | Fault::Ignored) if !self.drive.model.acknowledges() => {
                Some(Fault::Refused(0x05))
            }
            fault => fault,
        };
        if let Some(Fault::NoPort(by_another)) = fault {
            self.is_lost = Some(by_another);
            return Err(not_sent(Cause::Port));
        }
        let words = match &write.payload {
            Payload::Word(word) => vec![*word],
            Payload::Words(words) => words.clone(),
        };
        let is_heard = !matches!(fault, Some(Fault::Lost | Fault::PortGone(_) | Fault::Unheard | Fault::Damaged));
        self.now = self.now + if is_heard { takes } else { write.timeout.unwrap_or(Duration::from_millis(500)) };
        let is_done = !matches!(fault, Some(Fault::Lost | Fault::Refused(_) | Fault::Ignored));
        let took = if is_done { self.drive.take(write.place, &words, self.now) } else { Ok(Vec::new()) };
        let done: &[Took] = took.as_deref().unwrap_or_default();
        self.judge.sent(write, family, (&self.drive, self.halts), (fault, done));
        let took = took.map(drop).map_err(refused);
        match fault {
            None => took,
            Some(Fault::Lost | Fault::Unheard) => Err(failed(Cause::NoAnswer)),
            Some(Fault::Damaged) => Err(failed(Cause::BadAnswer)),
            Some(Fault::Refused(code)) => Err(refused(code)),
            // Another answer than its own it does not give.
            Some(Fault::Acknowledged | Fault::Ignored) => took.and(Err(refused(0x05))),
            Some(Fault::PortGone(by_another)) => {
                self.is_lost = Some(by_another);
                Err(failed(Cause::Port))
            }
            Some(fault) => panic!("no write meets {fault:?}"),
        }
    }
}

fn refused(code: u8) -> Failed {
    let code = ExceptionCode(code);
    failed(Cause::Refused(code, code.meaning()))
}
