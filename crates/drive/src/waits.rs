//! Waiting until a motor has reached its speed, or stands.

use std::time::Duration;

use drivebus_drives::State;
use drivebus_rtu::Instant;
use thiserror::Error;

use crate::look::POLL_INTERVAL;
use crate::speed::STANDSTILL;
use crate::status::Status;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;
use crate::values::NotRead;

/// Hundredths of a hertz are what drives count in: a difference of binary floats must not turn 0.1 into a miss.
const ROUNDING: f64 = 1e-9;

/// Why a motor is not known to be as it was waited for. The drive was only asked: it goes on as it was. `E` is the error of
/// whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotReached<E> {
    /// The state of the drive may not be used; with the reason. Nothing was sent.
    #[error("its state must be seen: {0}")]
    Unseen(String),
    /// What must be known of the drive may not be read; with the reason. Nothing was sent.
    #[error("its {role} must be seen: {}", .why.as_deref().unwrap_or("no such register is known"))]
    Untold {
        /// As what it is needed: `frequency` or `setpoint`.
        role: &'static str,
        /// Why it may not be read; `None`: the family has no register of it that is known.
        why: Option<String>,
    },
    /// It tripped; or it was `before` the first look.
    #[error("it tripped {}: {status}", if *.before { "before the wait" } else { "while waiting" })]
    Tripped {
        /// What it did then.
        status: Status,
        /// Whether the first look showed that.
        before: bool,
    },
    /// The time is over.
    #[error("the time is over, and it is {0}")]
    Late(Status),
    /// It was not read.
    #[error("{0}")]
    NotRead(NotRead<E>),
}

impl Unit {
    /// Waits for the time `within` until the motor runs at `hz`, or no more than `tolerance` Hz off it; `None` is the setpoint
    /// in force. Where the drive tells which way it turns, that is the way it was started last: a motor that is reversed runs
    /// through its new speed before it turns round. Who did not start it waits for either way.
    ///
    /// # Errors
    ///
    /// [`NotReached`]: the motor goes on as it was.
    pub async fn wait_for_speed<E: LineError>(
        &self,
        line: &Mailbox<E>,
        hz: Option<f64>,
        tolerance: f64,
        within: Duration,
    ) -> Result<Status, NotReached<E>> {
        self.must_tell(if hz.is_some() { &["frequency"] } else { &["frequency", "setpoint"] })?;
        let turns_round = |now: State| match self.record().sent().started_as {
            Some(State::Forward) => now == State::Reverse,
            Some(State::Reverse) => now == State::Forward,
            _ => false,
        };
        let is_reached = |status: &Status| {
            let off =
                status.frequency.zip(hz.or(status.setpoint)).map(|(frequency, wanted)| (frequency - wanted).abs());
            let state = status.look.state;
            state.is_running() && !turns_round(state) && off.is_some_and(|off| off <= tolerance + ROUNDING)
        };
        self.wait_until(line, is_reached, line.now() + within).await
    }

    /// Waits for the time `within` until the drive is at rest, and its output frequency is zero where it tells that.
    ///
    /// A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.
    ///
    /// # Errors
    ///
    /// [`NotReached`]: the motor goes on as it was.
    pub async fn wait_until_stopped<E: LineError>(
        &self,
        line: &Mailbox<E>,
        within: Duration,
    ) -> Result<Status, NotReached<E>> {
        self.must_tell(&[])?;
        let stands = |status: &Status| {
            status.look.state.is_at_rest() && status.frequency.is_none_or(|frequency| frequency <= STANDSTILL)
        };
        self.wait_until(line, stands, line.now() + within).await
    }

    /// Whether the drive tells its state, and what it has in these `roles`.
    fn must_tell<E>(&self, roles: &[&'static str]) -> Result<(), NotReached<E>> {
        self.rule().state().map_err(|why| NotReached::Unseen(why.to_string()))?;
        for &role in roles {
            let untold = |why| NotReached::Untold { role, why };
            let entry = self.profile().role(role).ok_or_else(|| untold(None))?;
            self.rule().read(entry).map_err(|why| untold(Some(why.to_string())))?;
        }
        Ok(())
    }

    async fn wait_until<E: LineError>(
        &self,
        line: &Mailbox<E>,
        is_reached: impl Fn(&Status) -> bool,
        deadline: Instant,
    ) -> Result<Status, NotReached<E>> {
        let mut before = true;
        loop {
            let status = self.status(line).await.map_err(NotReached::NotRead)?;
            if status.look.state == State::Fault || status.look.has_fault() {
                return Err(NotReached::Tripped { status, before });
            }
            if is_reached(&status) {
                return Ok(status);
            }
            if line.now() >= deadline {
                return Err(NotReached::Late(status));
            }
            before = false;
            line.sleep(POLL_INTERVAL).await.map_err(|error| NotReached::NotRead(NotRead::Failed(error)))?;
        }
    }
}

#[cfg(test)]
mod tests;
