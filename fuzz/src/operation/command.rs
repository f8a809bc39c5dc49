//! Starts and resets: what they may write, and what they say of it.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::{Cause, LineError, Payload, Task, Write};
use drivebus_drive::{Families, Family, Looks, NotCommanded, Record, SameUnit, Speeds, Start, Taken, Unit};
use drivebus_drives::{Command, Entry, Place, StartWord};
use drivebus_rtu::Meaning;

use super::{Fault, Line};

/// Starts the unit that is named so, or resets a fault.
pub(super) fn command(line: &mut Line<'_>, same: SameUnit, kind: u8, confirm: Duration) {
    let (families, profile, record) = (Families::shipped(), Arc::clone(same.family().profile()), Record::default());
    let (looks, speeds) = (Arc::new(Looks::new(&profile, true)), Arc::new(Speeds::new(&profile, true)));
    let is_blind = looks.is_blind();
    let unit = Unit::new(Taken::as_named(same, &looks, &speeds), &record);
    let (is_reset, is_reverse) = (kind & 0x07 == 7, kind & 0x01 != 0);
    let hz = (kind & 0x04 != 0).then(|| f64::from(line.input.byte()));
    let mut start = if kind & 0x02 != 0 { Start::jog(is_reverse) } else { Start::run(is_reverse, hz) };
    (start.confirm, start.is_forced) = (confirm, kind & 0x08 != 0);
    let command = if is_reset { Command::ResetFault } else { start.command() };
    let own = profile.command(command);
    let first = profile.command_first(command);
    let frequency = profile.role("setpoints.frequency").and_then(Entry::place);
    line.commands = Some(Commands {
        own,
        first,
        frequency,
        leads: profile.start_sequence().to_vec(),
        given: 0,
        acted: false,
        is_tripped: false,
    });
    let done: Result<(), NotCommanded<Fault>> = line.carry_out(Task::new(async move |line| {
        if is_reset {
            unit.reset_fault(&line, families, confirm).await
        } else {
            unit.start(&line, families, &start).await
        }
    }));
    let Some(commands) = line.commands.take() else { unreachable!("it was there") };
    assert!(commands.given <= 1, "it was sent {} times", commands.given);
    match done {
        Ok(()) if is_reset => {}
        Ok(()) => {
            assert!(commands.acted, "it is said to be started, and nothing was taken");
            assert_eq!(record.sent().starts, 1);
            assert!(confirm.is_zero() || is_blind || line.looks > 1, "it is proved by nothing");
        }
        Err(error) => {
            assert!(error.why.may_have_acted() || !commands.acted, "{error}");
            assert!(!error.to_string().is_empty());
        }
    }
}

/// What a start or a reset may write, and what became of it.
pub(super) struct Commands {
    own: Option<(Place, u16)>,
    first: Option<(Place, u16)>,
    frequency: Option<Place>,
    leads: Vec<StartWord>,
    /// How often the command went out.
    given: usize,
    /// Whether the unit may have taken it.
    acted: bool,
    /// Whether the last look showed a fault.
    pub(super) is_tripped: bool,
}

impl Commands {
    /// Whether `write` is the command itself. It is one of the words that belong to it, in any case.
    fn is_own(&self, write: &Write) -> bool {
        let words = match &write.payload {
            Payload::Word(word) => vec![*word],
            Payload::Words(words) => words.clone(),
        };
        let at = |(place, word): (Place, u16)| write.place == place && words.first() == Some(&word);
        let is_own = self.own.is_some_and(at);
        let is_lead = self.own.is_some_and(|(place, _)| self.leads.iter().any(|lead| at((place, lead.word))));
        let is_frequency = self.frequency == Some(write.place) && words.len() == 1;
        assert!(is_own || is_lead || is_frequency || self.first.is_some_and(at), "{write} is no part of it");
        is_own
    }
}

impl Line<'_> {
    /// What becomes of a write of a start or a reset. Now and then the unit is told to halt before.
    pub(super) fn command(&mut self, write: &Write, family: &Family) -> Result<(), Fault> {
        let Some(commands) = &mut self.commands else { unreachable!("it was there") };
        let is_own = commands.is_own(write);
        let is_reset = family.profile().command(Command::ResetFault) == commands.own;
        assert!(!is_own || is_reset || !commands.is_tripped, "it is started in fault");
        assert!(!write.is_urgent && write.halts.is_some() && write.connection.is_some(), "{write}");
        self.halts += u64::from(self.input.byte() == 0xFF);
        if write.halts != Some(self.halts) {
            return Err(Fault { cause: Cause::Halted, raw: Vec::new(), was_sent: false });
        }
        let came = self.fate(true).map(drop);
        let went_out = came.as_ref().map_or_else(LineError::was_sent, |()| true);
        let is_refused = matches!(&came, Err(Fault { cause: Cause::Refused(code, _), .. })
            if family.meaning_of(*code) != Meaning::Taken);
        if let Some(commands) = self.commands.as_mut().filter(|_| is_own) {
            commands.given += usize::from(went_out);
            commands.acted |= went_out && !is_refused;
        }
        came
    }
}
