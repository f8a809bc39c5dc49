//! Waiting until a motor has its speed, or stands.

use std::time::Duration;

use drivebus_drive::task::{Mailbox, Task};
use drivebus_drive::{self as drive, Frequencies};
use drivebus_drives::Entry;

use super::{Named, Work};
use crate::checks;
use crate::error::Error;
use crate::status::Status;

/// What a drive may tell of its speed, the output frequency first.
const ROLES: [&str; 2] = ["frequency", "setpoint"];

impl Named {
    pub(crate) fn wait_for_speed(
        &self,
        hz: Option<f64>,
        tolerance: f64,
        within: Duration,
    ) -> Result<Work<Status>, Error> {
        hz.map_or(Ok(()), |hz| checks::not_negative("frequency", hz))?;
        checks::not_negative("tolerance", tolerance)?;
        checks::time("within", within)?;
        let named = self.clone();
        Ok(Task::new(async move |line| {
            let reached = named.at_speed(&line, hz, tolerance, within).await;
            reached.map_err(|why| named.tell("speed", why))
        }))
    }

    pub(crate) fn wait_until_stopped(&self, within: Duration) -> Result<Work<Status>, Error> {
        checks::time("within", within)?;
        let named = self.clone();
        Ok(Task::new(async move |line| {
            let stands = named.at_rest(&line, within).await;
            stands.map_err(|why| named.tell("standstill", why))
        }))
    }

    async fn at_speed(
        &self,
        line: &Mailbox<Error>,
        hz: Option<f64>,
        tolerance: f64,
        within: Duration,
    ) -> Result<Status, Error> {
        let unit = self.measuring(line).await?;
        let compared = if hz.is_some() { &ROLES[..1] } else { &ROLES };
        if let Some(other) = compared.iter().filter_map(|role| told_in(&unit, role)).find(|other| *other != "Hz") {
            return Err(Error::not_allowed(format_args!("it tells that in {other}, and not in Hz")));
        }
        let status = unit.wait_for_speed(line, hz, tolerance, within).await?;
        Ok(shown(&unit, &status))
    }

    async fn at_rest(&self, line: &Mailbox<Error>, within: Duration) -> Result<Status, Error> {
        let unit = self.measuring(line).await?;
        let status = unit.wait_until_stopped(line, within).await?;
        Ok(shown(&unit, &status))
    }

    /// A call to the unit by which it is known in what it tells its speed.
    async fn measuring(&self, line: &Mailbox<Error>) -> Result<drive::Unit, Error> {
        let names: Vec<_> = ROLES.into_iter().filter_map(|role| self.profile().role(role)).map(Entry::name).collect();
        Ok(self.call(line).settled(line, &names).await?)
    }
}

/// In what the `unit` tells this of its speed.
fn told_in<'u>(unit: &'u drive::Unit, role: &str) -> Option<&'u str> {
    unit.profile().role(role).map(|entry| entry.quantity().unit())
}

fn shown(unit: &drive::Unit, status: &drive::Status) -> Status {
    let output = status.frequency.filter(|_| told_in(unit, ROLES[0]) == Some("Hz"));
    let frequencies = output.map(|output| Frequencies { output, setpoint: status.setpoint });
    Status::new(unit.profile(), &status.look, frequencies)
}
