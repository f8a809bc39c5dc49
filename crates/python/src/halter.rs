//! Units of programs and clients that are gone, halted by what their families know: `Halt` over the line that others are
//! kept from.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::{
    Cause, LineError, Mailbox, Notice, Outcome, Payload, Read, Seen, Stamped, Step, Task, Wish, Write,
};
use drivebus_drive::{Besides, Families, Halt, Looks, NotHalted, Order, Record, SameUnit, Speeds, Taken, Why};
use drivebus_drives::{self as drives, Command, Place};
use drivebus_line::{CallError, CallOptions, ErrorKind, Failure, HaltLine, Halted, Halter, Named};
use drivebus_rtu::huanyang::{Huanyang, Protocol};
use drivebus_rtu::{Answer, Instant, Meaning, Request, Table, UnitAddress};
use pyo3::prelude::*;

use crate::clock::unix_time;
use crate::profile::Profile;

/// How long a unit is looked at for a proof.
const CONFIRM: Duration = Duration::from_secs(1);

/// Halts units of the shipped families.
#[derive(Debug)]
pub(crate) struct ByFamily;

impl Halter for ByFamily {
    fn halt(&self, unit: UnitAddress, named: &Named, within: Duration, line: &mut dyn HaltLine) -> Halted {
        let families = Families::shipped();
        let commands: Option<Vec<Command>> = named.commands.iter().map(|name| name.parse().ok()).collect();
        let (Some(family), Some([command, others @ ..])) = (families.named(&named.family), commands.as_deref()) else {
            return Halted::Unknown;
        };
        let besides = others.first().map_or(Besides::Nothing, |&other| Besides::InTurns(other));
        let order = Order { command: *command, besides, within, confirm: CONFIRM };
        let (profile, record) = (family.profile(), Record::default());
        let looks = Arc::new(Looks::new(profile, named.is_unverified));
        let speeds = Arc::new(Speeds::new(profile, named.is_unverified));
        let identity = record.identity(family.name(), line.reconnects());
        let unit = Taken::as_named(SameUnit::new(unit, family, &identity, named.is_trusted), &looks, &speeds);
        let mut halt = Halt::new(unit, &record, order, families, line.now());
        let task = Task::new(async move |line: Mailbox<Failed>| {
            let done = halt.carry_out(&line, families).await;
            (halt.taken_as().clone(), done)
        });
        let Some(((taken_as, done), was_told)) = driven(task, line, family.protocol()) else { return Halted::Unknown };
        let as_what = if taken_as.same().family().name() == named.family {
            String::new()
        } else {
            format!(
                "By what it shows it is another drive ({}), and was halted as that. ",
                taken_as.same().family().profile().title()
            )
        };
        match done {
            Ok(()) if taken_as.tells_its_state() => Halted::Took(format!("{as_what}Its state proves the halt")),
            Ok(()) => Halted::Took(format!("{as_what}It has no state that may be used for a proof")),
            Err(NotHalted { why, .. }) => match why {
                Why::MayNot(_) => Halted::Unknown,
                Why::Undecided { .. } | Why::SetOtherwise { .. } => Halted::Another,
                Why::Failed(_) => Halted::GivenUp,
                Why::Unsaid | Why::NotSent(_) | Why::Refused { .. } | Why::Unanswered { .. } if !was_told => {
                    Halted::NotTaken
                }
                why => Halted::Took(format!("{as_what}It is not proved: {why}")),
            },
        }
    }
}

/// A profile, the commands that halt, whether its name is trusted, and whether what no document proves is.
pub(crate) type GivenName<'py> = (PyRef<'py, Profile>, Vec<String>, bool, bool);

/// As what a will names its unit: nothing where that is no shipped family.
pub(crate) fn as_named(given: Option<GivenName<'_>>) -> Option<Named> {
    let (profile, commands, is_trusted, is_unverified) = given?;
    let profile = profile.core();
    let shipped = drives::Profile::builtin(profile.name()).ok().filter(|shipped| Arc::ptr_eq(shipped, &profile))?;
    Some(Named::new(shipped.name(), commands).trusted(is_trusted).unverified(is_unverified))
}

/// Does what a halt wishes for. What came of it, and whether others may ask the unit since; `None`: it cannot be done here.
fn driven<T>(mut task: Task<T, Failed>, line: &mut dyn HaltLine, protocol: Protocol) -> Option<(T, bool)> {
    let (mut latest, mut outcome) = (Instant::ZERO, None);
    let (mut is_taken, mut was_told) = (false, false);
    loop {
        latest = line.now().max(latest);
        let seen = Seen { now: latest, connection: line.reconnects(), is_closed: line.is_closed() };
        outcome = Some(match task.step(seen, outcome).ok()? {
            Step::Done(done) => return Some((done, was_told)),
            Step::Wish(Wish::Sleep(time)) => {
                line.sleep(time);
                Outcome::Slept
            }
            Step::Wish(Wish::Read(read)) => {
                let request = Request::read_of(table_of(read.place)?, read.place.address, read.count).ok()?;
                let mut words = Vec::new();
                let mut take = |answer: Answer<'_>| {
                    if let Answer::Read { words: came, .. } = answer {
                        words = came.iter().collect();
                    }
                };
                let asked = unix_time();
                match said(line, protocol, &request, options_of(&read), &mut take) {
                    Ok(()) if read.is_stamped => Outcome::Stamped(Stamped { words, asked, answered: unix_time() }),
                    Ok(()) => Outcome::Words(words),
                    Err(error) => Outcome::Failed(Failed::of(error, &task)),
                }
            }
            Step::Wish(Wish::Write(write)) => {
                is_taken = false;
                let came = said(line, protocol, &request_of(&write)?, options_of_write(&write), &mut |_| ());
                came.map_or_else(|error| Outcome::Failed(Failed::of(error, &task)), |()| Outcome::Written)
            }
            Step::Wish(Wish::Tell(notice)) => {
                match notice {
                    Notice::Took(_) => is_taken = true,
                    // It is looked at once it said nothing against what it was halted as: before, it may be told again.
                    Notice::Saw(_) if is_taken => {
                        line.took();
                        was_told = true;
                    }
                    _ => {}
                }
                Outcome::Heard
            }
            Step::Wish(_) => return None,
        });
    }
}

/// Asks in the protocol of the family, which the line itself may not know.
fn said(
    line: &mut dyn HaltLine,
    protocol: Protocol,
    request: &Request<'_>,
    options: CallOptions,
    take: &mut dyn FnMut(Answer<'_>),
) -> Result<(), Box<CallError>> {
    match Huanyang::of(request).filter(|_| protocol == Protocol::Huanyang) {
        Some(asked) => line.ask(&Request::Huanyang(asked), options, &mut |answer| {
            take(asked.as_answered(answer, request, &mut [0]));
        }),
        None => line.ask(request, options, take),
    }
}

fn table_of(place: Place) -> Option<Table> {
    Table::of_function(place.table.function())
}

fn request_of(write: &Write) -> Option<Request<'_>> {
    let address = write.place.address;
    match (table_of(write.place)?, &write.payload) {
        (Table::Holding, Payload::Word(word)) => Some(Request::write(address, *word)),
        (Table::Holding, Payload::Words(words)) => Request::write_many(address, words).ok(),
        (Table::Coil, Payload::Word(word)) => Some(Request::write_coil(address, *word == 1)),
        _ => None,
    }
}

fn options_of(read: &Read) -> CallOptions {
    CallOptions::new().timeout(read.timeout).retries(read.retries)
}

fn options_of_write(write: &Write) -> CallOptions {
    CallOptions::new().timeout(write.timeout).read_back(write.read_back).connection(write.connection)
}

/// An error of the line, and what a refusal means to the family that the unit is taken for.
#[derive(Debug)]
struct Failed {
    call: Box<CallError>,
    means: Option<Meaning>,
}

impl Failed {
    fn of<T>(call: Box<CallError>, task: &Task<T, Self>) -> Self {
        let means = match call.failure {
            Failure::Refused { code, .. } => task.taken_for().map(|(_, family)| family.meaning_of(code)),
            _ => None,
        };
        Self { call, means }
    }
}

impl LineError for Failed {
    fn cause(&self) -> Cause {
        match (self.call.kind(), &self.call.failure) {
            (ErrorKind::NoAnswer, _) => Cause::NoAnswer,
            (ErrorKind::BadAnswer | ErrorKind::Crc, _) => Cause::BadAnswer,
            (ErrorKind::Port, _) => Cause::Port,
            (_, &Failure::Refused { code, .. }) => Cause::Refused(code, self.means.unwrap_or_else(|| code.meaning())),
            (_, Failure::Halted { .. }) => Cause::Halted,
            _ => Cause::Other,
        }
    }

    fn raw(&self) -> &[u8] {
        &self.call.raw
    }

    fn was_sent(&self) -> bool {
        self.call.sent.is_some()
    }
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.call.fmt(f)
    }
}
