//! How fast a motor turns, and how its drive is set to slow it down.

use std::sync::Arc;

use drivebus_drives::{Control, Entry, Profile, ReadPlan, Setpoint, State, Value};
use drivebus_rtu::UnitAddress;

use crate::rule::Rule;
use crate::task::{Cause, LineError, Mailbox, Read};
use crate::wanted::wanted_for;

/// Output frequency in Hz up to which a drive that has stopped counts as stopped.
pub const STANDSTILL: f64 = 0.05;

/// What units of one family tell of their speed, under one trust. Worked out once.
#[derive(Debug)]
pub struct Speeds {
    /// The output frequency; `None` where it may not be read.
    output: Option<ReadPlan>,
    /// The output frequency, and the setpoint in force where that is in the same unit.
    both: Option<ReadPlan>,
    rest_by_frequency: bool,
    ramp: Option<ReadPlan>,
    /// What the values of that plan are, in its order.
    told: Vec<Told>,
    /// How many settings make the bus alone command the drive.
    settings: usize,
}

/// A parameter that says how a drive slows down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    /// Seconds of the ramp.
    Time,
    /// Hertz that it is counted from.
    Start,
    /// What these bits of a setting are where only the bus commands the drive.
    Setting { mask: u16, word: u16 },
}

/// The frequencies of one moment, whichever way the motor turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frequencies {
    /// At the output, in Hz.
    pub output: f64,
    /// The setpoint in force, in Hz; `None` where the drive does not tell it, or in another unit.
    pub setpoint: Option<f64>,
}

/// How a drive is set to slow down.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ramp {
    /// In Hz a second; `None` where that is not known.
    pub slope: Option<f64>,
    /// Whether nobody but the bus tells it to.
    pub only_by_bus: bool,
}

impl Speeds {
    /// What units of `profile` tell; where `is_trusted`, also by what no document of the family prints.
    pub fn new(profile: &Arc<Profile>, is_trusted: bool) -> Self {
        let rule = Rule::of(profile, is_trusted);
        let readable = |entry: &Entry| rule.read(entry).is_ok();
        let of_role = |role: &str| profile.role(role).filter(|entry| readable(entry));
        let (frequency, setpoint) = (of_role("frequency"), of_role("setpoint"));
        // Where one is in percent, or rpm, they cannot be compared.
        let setpoint =
            setpoint.filter(|other| frequency.is_some_and(|one| one.quantity().unit() == other.quantity().unit()));
        let both = frequency.map(|frequency| std::iter::once(frequency).chain(setpoint).collect::<Vec<_>>());

        let settings = wanted_for(profile, Setpoint::Frequency);
        let setting = |each: &Control| {
            let low = each.bits.map_or(0, |[_, low]| low);
            Told::Setting { mask: each.found(u16::MAX) << low, word: each.raw << low }
        };
        let set = settings.iter().filter_map(|each| Some((profile.find(&each.code).ok()?, setting(each))));
        let ramp = [("deceleration", Told::Time), ("ramp_start", Told::Start)];
        let ramp = ramp.into_iter().filter_map(|(role, told)| Some((profile.role(role)?, told)));
        let (entries, told): (Vec<_>, Vec<_>) = set.chain(ramp).filter(|(entry, _)| readable(entry)).unzip();
        Self {
            output: frequency.and_then(|entry| profile.compile(&[entry]).ok()),
            both: both.and_then(|entries| profile.compile(&entries).ok()),
            rest_by_frequency: profile.state_word().is_some_and(|word| word.rest_by_frequency),
            ramp: if entries.is_empty() { None } else { profile.compile(&entries).ok() },
            told,
            settings: settings.len(),
        }
    }

    /// The output frequency and the setpoint in force, in the fewest reads; `None` where the family does not tell.
    ///
    /// # Errors
    ///
    /// Those of the line.
    pub async fn frequencies<E>(
        &self,
        line: &Mailbox<E>,
        unit: UnitAddress,
        is_urgent: bool,
    ) -> Result<Option<Frequencies>, E> {
        let Some(plan) = &self.both else { return Ok(None) };
        let mut values = values_of(plan, line, unit, is_urgent).await?.into_iter().map(|value| value.to_f64().abs());
        Ok(values.next().map(|output| Frequencies { output, setpoint: values.next() }))
    }

    /// The output frequency in Hz, whichever way the motor turns; `None` where the family does not tell.
    ///
    /// # Errors
    ///
    /// Those of the line.
    pub async fn output<E>(&self, line: &Mailbox<E>, unit: UnitAddress, is_urgent: bool) -> Result<Option<f64>, E> {
        let Some(plan) = &self.output else { return Ok(None) };
        Ok(values_of(plan, line, unit, is_urgent).await?.first().map(|value| value.to_f64().abs()))
    }

    /// Whether a motor whose `state` says that it rests still turns, in a family whose word may say so on the ramp.
    ///
    /// # Errors
    ///
    /// Those of the line, which is asked of such a family only.
    pub async fn turns_in_spite_of<E>(
        &self,
        state: State,
        line: &Mailbox<E>,
        unit: UnitAddress,
        is_urgent: bool,
    ) -> Result<bool, E> {
        if !state.is_at_rest() || !self.rest_by_frequency {
            return Ok(false);
        }
        Ok(self.output(line, unit, is_urgent).await?.is_some_and(|frequency| frequency > STANDSTILL))
    }

    /// How a stop slows the motor down, and who else may, as the drive's parameters say it. Of a drive that does not say
    /// it nothing is known.
    ///
    /// # Errors
    ///
    /// Those of the line, where it is no answer that was missing or bad.
    pub async fn ramp<E: LineError>(&self, line: &Mailbox<E>, unit: UnitAddress, is_urgent: bool) -> Result<Ramp, E> {
        let values = match &self.ramp {
            None => Vec::new(),
            Some(plan) => match values_of(plan, line, unit, is_urgent).await {
                Ok(values) => values,
                Err(error) if matches!(error.cause(), Cause::NoAnswer | Cause::BadAnswer | Cause::Refused(..)) => {
                    return Ok(Ramp::default());
                }
                Err(error) => return Err(error),
            },
        };
        let (mut seconds, mut hertz, mut set) = (0.0, 0.0, 0);
        for (told, value) in self.told.iter().zip(values) {
            match *told {
                Told::Time => seconds = value.to_f64(),
                Told::Start => hertz = value.to_f64(),
                Told::Setting { mask, word } => set += usize::from(value.word() & mask == word),
            }
        }
        Ok(Ramp {
            slope: (hertz > 0.0 && seconds > 0.0).then(|| hertz / seconds),
            only_by_bus: self.settings > 0 && set == self.settings,
        })
    }
}

/// The values of `plan`; none where the drive has not all of them.
async fn values_of<E>(plan: &ReadPlan, line: &Mailbox<E>, unit: UnitAddress, is_urgent: bool) -> Result<Vec<Value>, E> {
    let mut words = Vec::with_capacity(plan.words());
    for span in plan.reads() {
        words.extend(line.read(Read::words(unit, span.place(), span.count).urgent(is_urgent)).await?);
    }
    // Where one of them is not there, none can be told from another.
    let values: Option<Vec<_>> = plan.told(&words).map(|(_, value)| value).collect();
    Ok(values.unwrap_or_default())
}

#[cfg(test)]
mod tests;
