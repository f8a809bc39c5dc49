//! What is looked at before a motor is started: the link, the drive, and that it can be stopped again.
//!
//! Every start goes through here. A new reason against a start is a check here, and a line in docs/developers/guarantees.md.

use drivebus_drives::{Command, Control, Setpoint, State};
use thiserror::Error;

use crate::look::Look;
use crate::settings::Setting;
use crate::task::{LineError, Link, Mailbox};
use crate::unit::Unit;
use crate::wanted::{needs_of, wanted_always, wanted_of_commands};

/// Of the last ten exchanges with a unit. One answer in ten may be lost on a line that works, to a burst of noise. Where two
/// are, the next may be the one that stops the motor.
const FAILURES_ALLOWED: u32 = 1;

/// Looks at the state that prove a link in doubt: as many as a [`Link`] counts, so that the old ones count no more.
const LOOKS_TO_PROVE: u32 = 10;

/// Why a motor may not be started. Nothing that moves it was sent. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotReady<E> {
    /// The command may not be given; with the reason.
    #[error("{0}")]
    MayNot(String),
    /// The drive is started by several words, and its state may not be read between them; with the reason.
    #[error("it is started by several words, and its state must be seen between them: {0}")]
    Unseen(String),
    /// What it starts could not be stopped; with the reasons.
    #[error("what it starts could not be stopped (stop: {stop}; coast: {coast})")]
    Unstoppable {
        /// Why it may not be told to stop.
        stop: String,
        /// And why not to coast.
        coast: String,
    },
    /// Its stop might be lost as well.
    #[error("the link is bad: {link}, and {lost} of {looks} looks at its state failed")]
    BadLink {
        /// How well it was reached lately.
        link: Link,
        /// How many of the looks failed.
        lost: u32,
        /// How many there were.
        looks: u32,
    },
    /// The drive is set otherwise, and so does this.
    #[error("{then}: {}", told(.wrong))]
    Settings {
        /// What it does so.
        then: Ignores,
        /// What is set otherwise.
        wrong: Vec<Setting>,
    },
    /// It is in fault.
    #[error("it is in fault: {0}")]
    InFault(Look),
    /// It has no voltage on its DC bus.
    #[error("it has no voltage on its DC bus")]
    NoVoltage(Look),
    /// Its state word is none that its family has: it may be another drive, or do what nobody knows.
    #[error("its state word {:04X}H is none of its family", .0.word.unwrap_or_default())]
    UnknownState(Look),
    /// It takes its commands from elsewhere, as it says.
    #[error("it takes its commands from the {}, not from the bus", .0.other_source().unwrap_or_default())]
    OtherSource(Look),
    /// The motor turns already: a jog could not be told from what it does.
    #[error("it turns already: {0}")]
    Turning(Look),
    /// The line failed, or the unit refused to be read.
    #[error("{0}")]
    Failed(E),
}

/// What a drive does that is set otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Ignores {
    /// It has its words elsewhere.
    #[error("it has its words elsewhere")]
    Words,
    /// It does not take its commands from the bus.
    #[error("it does not take its commands from the bus")]
    Commands,
    /// It would not take its speed from the bus.
    #[error("it would not take its speed from the bus")]
    Speed,
}

fn told(settings: &[Setting]) -> String {
    settings.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

impl Unit {
    /// Whether `command` may be given, and what it starts could be stopped again.
    pub(crate) fn may_start<E>(&self, command: Command) -> Result<(), NotReady<E>> {
        self.rule().command(command).map_err(|why| NotReady::MayNot(why.to_string()))?;
        if !self.profile().start_sequence().is_empty() {
            self.rule().state().map_err(|why| NotReady::Unseen(why.to_string()))?;
        }
        self.can_be_stopped()
    }

    /// Whether a motor that turns could be stopped over the bus.
    ///
    /// # Errors
    ///
    /// [`NotReady::Unstoppable`].
    pub fn can_be_stopped<E>(&self) -> Result<(), NotReady<E>> {
        let reason = |halt| self.rule().command(halt).err().map(|why| why.to_string());
        match (reason(Command::Stop), reason(Command::Coast)) {
            (Some(stop), Some(coast)) => Err(NotReady::Unstoppable { stop, coast }),
            _ => Ok(()),
        }
    }

    /// No motor starts on a link that may not carry its stop. Sends nothing where the last exchanges went well.
    ///
    /// # Errors
    ///
    /// [`NotReady::BadLink`], [`NotReady::Failed`].
    pub async fn prove_link<E: LineError>(&self, line: &Mailbox<E>) -> Result<(), NotReady<E>> {
        let before = line.link(self.address()).await.map_err(NotReady::Failed)?;
        if before.failed() <= FAILURES_ALLOWED {
            return Ok(());
        }
        let (mut lost, mut looks) = (0, 0);
        while looks < LOOKS_TO_PROVE && lost <= FAILURES_ALLOWED {
            looks += 1;
            match self.ping(line).await {
                Ok(_) => {}
                Err(error) if error.cause().is_refusal() => {}
                Err(error) if error.cause().is_no_answer() => lost += 1,
                Err(error) => return Err(NotReady::Failed(error)),
            }
        }
        let after = line.link(self.address()).await.map_err(NotReady::Failed)?;
        if lost > FAILURES_ALLOWED || after.failed() > FAILURES_ALLOWED {
            return Err(NotReady::BadLink { link: after, lost, looks });
        }
        Ok(())
    }

    /// How the drive stands that is to start, and where `by_bus` to obey the bus.
    ///
    /// # Errors
    ///
    /// [`NotReady`]: it would not start, or not obey.
    pub async fn ready<E: LineError>(&self, line: &Mailbox<E>, by_bus: bool) -> Result<Look, NotReady<E>> {
        self.require_words(line).await?;
        let look = self.look(line).await.map_err(NotReady::Failed)?;
        if look.is_tripped() {
            return Err(NotReady::InFault(look));
        }
        if look.state == State::PowerOff {
            return Err(NotReady::NoVoltage(look));
        }
        if look.state == State::Unknown && look.word.is_some() {
            return Err(NotReady::UnknownState(look));
        }
        if by_bus && look.other_source().is_some() {
            return Err(NotReady::OtherSource(look));
        }
        if by_bus && !look.tells_source() {
            let mut wanted = wanted_of_commands(self.profile());
            wanted.retain(|row| !row.always);
            self.require(line, wanted, Ignores::Commands).await?;
        }
        Ok(look)
    }

    /// Whether the drive has its words where the profile has them, and they mean what it says.
    async fn require_words<E: LineError>(&self, line: &Mailbox<E>) -> Result<(), NotReady<E>> {
        let (wanted, opened, identity) = (wanted_always(self.profile()), line.connection(), self.same().identity());
        let decides = |row: &&Control| row.decides_words();
        let is_asked = |row: &Control| {
            self.is_sure(row) && self.profile().find(&row.code).is_ok_and(|e| self.rule().read(e).is_ok())
        };
        let tells_words = wanted.iter().filter(decides).all(is_asked);
        let required = self.require(line, wanted, Ignores::Words).await;
        match &required {
            Ok(()) if tells_words && line.connection() == opened => identity.found_own_words(opened),
            Err(NotReady::Settings { .. }) => identity.forget_words(),
            _ => {}
        }
        required
    }

    /// Whether the drive takes its speed from the bus.
    pub(crate) async fn takes_speed<E: LineError>(&self, line: &Mailbox<E>) -> Result<(), NotReady<E>> {
        let wanted = needs_of(self.profile(), Setpoint::Frequency).to_vec();
        self.require(line, wanted, Ignores::Speed).await
    }

    async fn require<E: LineError>(
        &self,
        line: &Mailbox<E>,
        wanted: Vec<Control>,
        then: Ignores,
    ) -> Result<(), NotReady<E>> {
        let wrong = self.wrong(line, wanted).await.map_err(NotReady::Failed)?;
        if wrong.is_empty() { Ok(()) } else { Err(NotReady::Settings { then, wrong }) }
    }
}
