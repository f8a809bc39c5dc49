//! One command to one unit: sent once, and proved by what its own state says afterwards.
//!
//! Where the family has no state that may be used, the confirmation of the command is the proof, and its fault number is
//! looked at.

use std::time::Duration;

use drivebus_drives::{Command, Place, State};
use drivebus_rtu::Instant;

use super::not_commanded::WhyNotCommanded;
use crate::families::Families;
use crate::halt::{After, LastLook};
use crate::look::{Look, POLL_INTERVAL, counts_for};
use crate::task::{Cause, LineError, Mailbox, Notice, Payload};
use crate::unit::Unit;
use crate::writing::{NotWritten, Words};

type Why<E> = WhyNotCommanded<E>;

/// What shows a command.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shown {
    /// The motor turns this way.
    Turns(State),
    /// The same of one that turned the other way, `from` Hz where it tells that: it must slow down first, and its state
    /// follows at zero.
    TurnsRound { wanted: State, from: Option<f64> },
    /// There is no fault any more.
    NoFault,
}

impl Shown {
    /// Whether a look alone shows it.
    fn is_shown_by(self, look: &Look) -> bool {
        let is_untold = look.word.is_none();
        match self {
            Self::NoFault => !look.is_tripped() && (is_untold || look.state != State::Unknown),
            Self::Turns(_) | Self::TurnsRound { .. } if is_untold => !look.has_fault(),
            Self::Turns(wanted) | Self::TurnsRound { wanted, .. } => look.state.shows(wanted),
        }
    }
}

impl Unit {
    /// Sends `command` as `payload` to `place`, once. Where another word says which way the motor turns, that goes out first,
    /// once too.
    pub(super) async fn give<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        command: Command,
        (place, payload): (Place, Payload),
    ) -> Result<(), Why<E>> {
        let words = |place, payload| Words {
            // Whether a drive gets out of a fault shall not depend on a name: it has shown that fault in the words of its
            // profile.
            is_judged: command != Command::ResetFault,
            ..Words::once(place, payload)
        };
        let command_words = words(place, payload);
        if let Some((place, word)) = self.profile().command_first(command) {
            let halts = self.record().sent().halts_begun;
            self.send_moving(line, families, &words(place, Payload::Word(word))).await?;
            if self.record().sent().halts_begun != halts {
                return Err(Why::HaltedBetween(None));
            }
            match self.send_moving(line, families, &command_words).await {
                Err(Why::Halted(error)) => return Err(Why::HaltedBetween(Some(error))),
                given => given?,
            }
        } else {
            self.send_moving(line, families, &command_words).await?;
        }
        line.taken_for(self.address(), self.family()).tell(Notice::Took(command)).await;
        Ok(())
    }

    /// Sends what may move the motor, once.
    pub(super) async fn send_moving<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        words: &Words,
    ) -> Result<(), Why<E>> {
        match self.write(line, families, words).await {
            Ok(()) => Ok(()),
            Err(NotWritten::Failed(error)) => match error.cause() {
                Cause::Halted => Err(Why::Halted(error)),
                cause if cause.is_of_the_line() && error.was_sent() => {
                    Err(Why::Unanswered { last: error, after: self.after(line).await? })
                }
                _ => Err(Why::NotWritten(NotWritten::Failed(error))),
            },
            Err(why) => Err(Why::NotWritten(why)),
        }
    }

    /// What the unit does after a command of which nothing is known.
    pub(super) async fn after<E: LineError>(&self, line: &Mailbox<E>) -> Result<After<E>, Why<E>> {
        match self.look(line).await {
            Ok(look) => Ok(After::Seen(look)),
            Err(error) => Why::unless_of_the_unit(error).map(After::Unread),
        }
    }

    /// Looks until the drive shows a command, for the time `within`; zero does not look.
    pub(super) async fn confirm<E: LineError>(
        &self,
        line: &Mailbox<E>,
        shown: Shown,
        within: Duration,
    ) -> Result<(), Why<E>> {
        if within.is_zero() || self.is_blind() {
            return Ok(());
        }
        let deadline = line.now() + within;
        while !self.is_shown(line, shown, deadline).await? {
            line.sleep(POLL_INTERVAL).await.map_err(Why::Unseen)?;
        }
        Ok(())
    }

    /// Whether one look shows the command; an error where it does not, and another one is not worth it.
    async fn is_shown<E: LineError>(&self, line: &Mailbox<E>, shown: Shown, deadline: Instant) -> Result<bool, Why<E>> {
        let began = line.now();
        let (last, is_over, looked_at) = match self.look_for(line, shown).await {
            Ok((_, true)) => return Ok(true),
            Ok((look, false)) => {
                let is_over = look.has_fault() && !matches!(shown, Shown::NoFault);
                (LastLook::Seen { look, hz: None }, is_over, counts_for(began, line.now()))
            }
            Err(error) => match error.cause() {
                Cause::Port => return Err(Why::PortLost(error)),
                Cause::Other | Cause::Halted => return Err(Why::Unseen(error)),
                // A refusal here is one of a read: it says nothing about the command.
                Cause::NoAnswer | Cause::BadAnswer | Cause::Refused(..) => (LastLook::Unread(error), false, line.now()),
            },
        };
        if !is_over && looked_at < deadline { Ok(false) } else { Err(Why::Unshown(last)) }
    }

    async fn look_for<E: LineError>(&self, line: &Mailbox<E>, shown: Shown) -> Result<(Look, bool), E> {
        let look = self.look(line).await?;
        match shown {
            Shown::TurnsRound { from: Some(from), .. } if !shown.is_shown_by(&look) && comes_round(&look) => {
                if self.output(line).await?.is_none_or(|now| now >= from) {
                    return Ok((look, false));
                }
                // What trips, or is told to stop by somebody else, slows down as well.
                let again = self.look(line).await?;
                let is_shown = shown.is_shown_by(&again) || comes_round(&again);
                Ok((again, is_shown))
            }
            _ => {
                let is_shown = shown.is_shown_by(&look);
                Ok((look, is_shown))
            }
        }
    }
}

/// Whether a motor that slows down may do so to turn the other way.
fn comes_round(look: &Look) -> bool {
    look.state.is_running() && !look.is_tripped()
}
