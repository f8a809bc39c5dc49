//! Commands that move a motor, and the proof that they did. A halt is [`Halt`](crate::Halt).
//!
//! Three rules hold for every command. What can be checked is checked before anything is sent. The command is sent once, and
//! never repeated. Success is what the drive's own state says afterwards; if that cannot be learnt, the caller is told so.

mod lead_up;
mod not_commanded;
mod sent;

use std::time::Duration;

use drivebus_drives::{Command, Place, State};

pub use not_commanded::{NotCommanded, NotLedUp, WhyNotCommanded, WhyNotLedUp};

use crate::families::Families;
use crate::look::Look;
use crate::ready::NotReady;
use crate::task::{LineError, Mailbox, Notice, Payload};
use crate::unit::Unit;
use crate::writing::{NotWritten, Words};
use sent::Shown;

type Why<E> = WhyNotCommanded<E>;

/// How a motor is to be started.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Start {
    /// Whether it turns the other way.
    pub is_reverse: bool,
    /// Whether it jogs, at the drive's own jog frequency, until it is halted.
    pub jogs: bool,
    /// Its frequency in Hz, 0 to the drive's own maximum; `None` is what the drive has.
    pub hz: Option<f64>,
    /// How long the state is looked at until it shows it; zero does not look. So too for each of the words that some families
    /// want before; those are looked at once in any case.
    pub confirm: Duration,
    /// Whether it starts although the link is bad. Then it may be impossible to stop the motor over the bus.
    pub is_forced: bool,
}

impl Start {
    /// A run at `hz`, or at the frequency that the drive has, looked at for one second.
    pub const fn run(is_reverse: bool, hz: Option<f64>) -> Self {
        Self { is_reverse, jogs: false, hz, confirm: Duration::from_secs(1), is_forced: false }
    }

    /// A jog, looked at for one second.
    pub const fn jog(is_reverse: bool) -> Self {
        Self { jogs: true, ..Self::run(is_reverse, None) }
    }

    /// What is sent.
    pub const fn command(&self) -> Command {
        match (self.jogs, self.is_reverse) {
            (false, false) => Command::RunForward,
            (false, true) => Command::RunReverse,
            (true, false) => Command::JogForward,
            (true, true) => Command::JogReverse,
        }
    }

    const fn wanted(&self) -> State {
        if self.is_reverse { State::Reverse } else { State::Forward }
    }
}

impl Unit {
    /// Starts the motor, or gives one that runs another speed or direction. Returns when the state shows it running.
    ///
    /// A halt wins over it: once the unit was told to halt, by whomever on this line, what is under way here is not sent.
    ///
    /// # Errors
    ///
    /// [`NotCommanded`]: [`may_have_acted`](WhyNotCommanded::may_have_acted) says whether the motor may turn.
    pub async fn start<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        start: &Start,
    ) -> Result<(), NotCommanded<E>> {
        let started = self.checked_start(line, families, start).await;
        started.map_err(|why| self.not_commanded(line, Some(start.command()), why))
    }

    /// Resets a fault after its cause is gone. Sends nothing if there is no fault. Looks for the time `confirm`; zero does not.
    ///
    /// # Errors
    ///
    /// [`NotCommanded`].
    pub async fn reset_fault<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        confirm: Duration,
    ) -> Result<(), NotCommanded<E>> {
        let not_reset = |found, why| NotCommanded {
            unit: self.address(),
            command: Some(Command::ResetFault),
            parts: self.parts(),
            found,
            why,
        };
        let shown = match self.send_reset(line, families).await {
            Ok(true) => self.confirm(line, Shown::NoFault, confirm).await,
            Ok(false) => return Ok(()),
            Err(why) => return Err(not_reset(line.now(), why)),
        };
        let Err(why) = shown else { return Ok(()) };
        let found = line.now();
        if !matches!(why, Why::Unshown(_) | Why::PortLost(_)) {
            return Err(not_reset(found, why));
        }
        match self.ignores_commands(line).await {
            Ok(wrong) if wrong.is_empty() => Err(not_reset(found, why)),
            Ok(wrong) => Err(not_reset(found, Why::Ignored { wrong, unshown: Box::new(why) })),
            Err(error) => Err(not_reset(found, Why::Unseen(error))),
        }
    }

    /// Writes a word that can move the motor, once, to a drive that was found ready.
    ///
    /// # Errors
    ///
    /// [`NotCommanded`].
    pub async fn write_moving<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        place: Place,
        word: u16,
    ) -> Result<(), NotCommanded<E>> {
        let is_unverified = self.rule().trusts_all();
        self.record().note(|sent| sent.started_unverified |= is_unverified);
        let words = Words::once(place, Payload::Word(word));
        self.send_moving(line, families, &words).await.map_err(|why| self.not_commanded(line, None, why))
    }

    fn not_commanded<E>(&self, line: &Mailbox<E>, command: Option<Command>, why: Why<E>) -> NotCommanded<E> {
        NotCommanded { unit: self.address(), command, parts: self.parts(), found: line.now(), why }
    }

    async fn checked_start<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        start: &Start,
    ) -> Result<(), Why<E>> {
        self.may_start(start.command()).map_err(Why::NotReady)?;
        let mut unit = self.unless_halted(line).await.map_err(Why::Failed)?;
        if !start.is_forced {
            unit.prove_link(line).await.map_err(Why::NotReady)?;
        }
        let mut word = None;
        if let Some(hz) = start.hz {
            unit = unit.counting_frequency(line).await.map_err(Why::NotSet)?;
            word = Some(unit.frequency_word(line, hz).await.map_err(Why::NotSet)?);
        }
        let before = unit.ready(line, true).await.map_err(Why::NotReady)?;
        if start.jogs && before.state.is_running() {
            return Err(Why::NotReady(NotReady::Turning(before)));
        }
        if start.hz.is_some() {
            unit.takes_speed(line).await.map_err(Why::NotReady)?;
        }
        unit.send_start(line, families, start, word, &before).await
    }

    async fn send_start<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        start: &Start,
        frequency: Option<u16>,
        before: &Look,
    ) -> Result<(), Why<E>> {
        let (command, wanted) = (start.command(), start.wanted());
        let (was_running, was_wanted) = (before.state.is_running(), before.state.shows(wanted));
        let shown = if was_running && !was_wanted {
            Shown::TurnsRound { wanted, from: self.output(line).await.map_err(Why::Failed)? }
        } else {
            Shown::Turns(wanted)
        };
        let is_unverified = self.rule().trusts_all();
        // Who started it so must not be kept from stopping it.
        self.record().note(|sent| sent.started_unverified |= is_unverified);
        // Before it is sent: whoever is interrupted from here on has to end it.
        line.taken_for(self.address(), self.family()).tell(Notice::Starts(command)).await;
        self.record().note(|sent| {
            sent.starts += 1;
            sent.started_as = Some(if start.jogs { State::Unknown } else { wanted });
        });
        let Some((place, code)) = self.profile().command(command) else {
            return Err(Why::NotReady(NotReady::MayNot(crate::rule::WhyNot::NoCommand.to_string())));
        };
        let payload = self.with_frequency(line, families, (place, code), frequency).await?;
        if !was_running {
            self.lead_up(line, families, place, start.confirm).await?;
        }
        let parts = self.parts();
        match self.give(line, families, command, (place, payload)).await {
            Err(Why::NotWritten(NotWritten::Failed(error))) if error.cause().is_refusal() && !was_running => {
                return Err(self.refused(line, error).await);
            }
            // It took the word that says which way, and runs.
            Err(Why::NotWritten(NotWritten::Failed(last))) if was_running && self.parts() > parts => {
                return Err(Why::Unanswered { last, after: self.after(line).await? });
            }
            Err(Why::NotWritten(why)) if was_running && self.parts() > parts => return Err(Why::HalfWritten(why)),
            given => given?,
        }
        self.confirm(line, shown, start.confirm).await
    }

    /// What goes where the command goes: the frequency behind it, where the drive has both side by side and takes them
    /// together. Where it has not, the frequency is sent now.
    async fn with_frequency<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        (place, code): (Place, u16),
        frequency: Option<u16>,
    ) -> Result<Payload, Why<E>> {
        let Some(frequency) = frequency else { return Ok(Payload::Word(code)) };
        let register = self.frequency_register().and_then(drivebus_drives::Entry::place);
        let is_next = register.is_some_and(|register| register.number() == place.number() + 1);
        if is_next && self.profile().requests().writes_two() {
            return Ok(Payload::Words(vec![code, frequency]));
        }
        let written = self.write_frequency(line, families, frequency).await;
        written.map_err(|why| Why::NotSet(crate::setpoint::NotSet::NotWritten(why)))?;
        Ok(Payload::Word(code))
    }

    /// A drive that refuses a start may have taken it: one look tells, where it can be read.
    async fn refused<E: LineError>(&self, line: &Mailbox<E>, last: E) -> Why<E> {
        match self.look(line).await {
            Ok(look) if look.state.is_running() => Why::RefusedAndTurns { last, look },
            Ok(_) => Why::NotWritten(NotWritten::Failed(last)),
            Err(error) => match Why::unless_of_the_unit(error) {
                Ok(_) => Why::NotWritten(NotWritten::Failed(last)),
                Err(why) => why,
            },
        }
    }

    /// Sends a reset, if there is a fault or nobody can tell. Whether it was sent.
    async fn send_reset<E: LineError>(&self, line: &Mailbox<E>, families: &Families) -> Result<bool, Why<E>> {
        let command = Command::ResetFault;
        self.rule().command(command).map_err(|why| Why::NotReady(NotReady::MayNot(why.to_string())))?;
        let Some((place, code)) = self.profile().command(command) else { return Ok(false) };
        let unit = self.unless_halted(line).await.map_err(Why::Failed)?;
        let before = unit.look(line).await.map_err(Why::Failed)?;
        let is_untold = before.word.is_none() && before.fault.is_none();
        if !before.is_tripped() && !is_untold {
            return Ok(false);
        }
        unit.give(line, families, command, (place, Payload::Word(code))).await?;
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
