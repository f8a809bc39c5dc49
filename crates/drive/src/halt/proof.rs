//! The looks at one unit until it shows a halt that it took.

use std::time::Duration;

use drivebus_drives::{Command, State};
use drivebus_rtu::Instant;

use super::not_halted::{LastLook, Why};
use crate::fall::{Fall, Glimpse};
use crate::look::{Look, POLL_INTERVAL, counts_for};
use crate::record::Record;
use crate::speed::Ramp;
use crate::taken::Taken;
use crate::task::{Cause, LineError, Mailbox};

/// The same, where it takes longer than it was given. Each look goes before all who wait, as the halt did.
const LONGER_INTERVAL: Duration = Duration::from_millis(100);

/// What is seen of one unit that took a halt.
#[derive(Debug)]
pub(super) struct Proof {
    is_asked: bool,
    deadline: Instant,
    fall: Fall,
    by_ramp: bool,
    ramp: Option<Ramp>,
}

impl Proof {
    /// The looks that prove a `command`, `sent` and `confirmed` at these moments, for `within` from `now` on: what the unit
    /// was looked at before does not count.
    pub(super) fn new(
        unit: &Taken,
        command: Command,
        (sent, confirmed): (Instant, Instant),
        within: Duration,
        now: Instant,
    ) -> Self {
        Self {
            // Where the confirmation is all there is, nothing is left to be proved.
            is_asked: unit.tells_its_state() && !within.is_zero() && !unit.is_blind(),
            deadline: now + if unit.tells_its_state() { within } else { Duration::ZERO },
            fall: Fall::new(sent, confirmed, now.saturating_duration_since(confirmed) + within),
            // What coasts has no ramp, and what jogs is not at its setpoint.
            by_ramp: command == Command::Stop,
            ramp: None,
        }
    }

    /// For `time` others were looked at: that does not count.
    pub(super) fn wait(&mut self, time: Duration) {
        self.deadline = self.deadline + time;
        self.fall.wait(time);
    }

    /// Time to the next look: what takes longer than it was given leaves others the line in between.
    pub(super) fn pause(&self, now: Instant) -> Duration {
        if now <= self.deadline { POLL_INTERVAL } else { LONGER_INTERVAL }
    }

    /// Looks once. Whether nothing is left to be proved.
    ///
    /// # Errors
    ///
    /// [`Why::Unshown`]: it is not proved, and not worth another look. [`Why::PortLost`].
    pub(super) async fn look<E: LineError>(
        &mut self,
        line: &Mailbox<E>,
        unit: &Taken,
        record: &Record,
    ) -> Result<bool, Why<E>> {
        if !self.is_asked {
            return Ok(true);
        }
        let began = line.now();
        let (last, looked_at) = match self.see(line, unit, record).await {
            Ok((_, true)) => return Ok(true),
            Ok((look, false)) => (LastLook::Seen { look, hz: self.fall.frequency() }, counts_for(began, line.now())),
            // A refusal here is one of a read: it says nothing about the command.
            Err(error) => match error.cause() {
                Cause::NoAnswer | Cause::BadAnswer | Cause::Refused(..) => (LastLook::Unread(error), line.now()),
                Cause::Port => return Err(Why::PortLost(error)),
                Cause::Other | Cause::Halted => return Err(Why::Failed(error)),
            },
        };
        if looked_at < self.fall.until() { Ok(false) } else { Err(Why::Unshown(last)) }
    }

    /// What is seen now, and whether that proves it.
    async fn see<E: LineError>(&mut self, line: &Mailbox<E>, unit: &Taken, record: &Record) -> Result<(Look, bool), E> {
        let look = unit.look(line, true).await?;
        let is_shown = self.is_shown_by(&look, line, unit, record).await?;
        Ok((look, is_shown))
    }

    async fn is_shown_by<E: LineError>(
        &mut self,
        look: &Look,
        line: &Mailbox<E>,
        unit: &Taken,
        record: &Record,
    ) -> Result<bool, E> {
        let (speeds, address) = (unit.speeds(), unit.same().unit());
        let line = &line.taken_for(address, unit.same().family());
        let asked = line.now();
        let turns = speeds.turns_in_spite_of(look.state, line, address, true).await?;
        if look.state.is_at_rest() && !turns {
            return Ok(self.fall.rests(asked));
        }
        self.fall.goes_on();
        if !look.state.is_running() && !turns {
            return Ok(false);
        }
        let Some(frequencies) = speeds.frequencies(line, address, true).await? else { return Ok(false) };
        let setpoint = frequencies.setpoint.unwrap_or(f64::INFINITY);
        self.fall.see(Glimpse { asked, answered: line.now(), hz: frequencies.output, setpoint });
        self.by_ramp &= look.other_source().is_none() && turns_as_started(record, look.state);
        if self.ramp.is_none() && self.fall.is_worth_asking() {
            self.ramp = Some(speeds.ramp(line, address, true).await?);
            // One that is slow to say nothing of it has still been falling meanwhile.
            self.fall.wait(line.now().saturating_duration_since(self.fall.seen_at()));
        }
        let Some(Ramp { slope: Some(slope), only_by_bus }) = self.ramp else { return Ok(false) };
        Ok(self.fall.goes_along(slope) && only_by_bus && self.by_ramp)
    }
}

/// Whether it turns as it was started here last, if it was: not the other way still, nor maybe in a jog.
fn turns_as_started(record: &Record, seen: State) -> bool {
    record.sent().started_as.is_none_or(|started| started == seen)
}
