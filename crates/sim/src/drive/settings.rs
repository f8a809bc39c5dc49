//! What parameters and setpoints ask of the machine.

use super::family::{Family, OtherWords, Scaled, Speed, SpeedUnit, USUAL_MAX_HZ};
use super::machine::Settings;
use super::store::Store;
use crate::motor;
use crate::ramp::Slopes;

/// Where a family has no parameter for it: how long a ramp over all frequencies takes, s. Assumption, as the other.
const USUAL_RAMP: f64 = 10.0;
/// How fast a jog is, Hz.
const USUAL_JOG_HZ: f64 = 5.0;

/// Whether `parameters` have the values that stand beside them.
pub(super) fn all_are(store: &Store, parameters: &[(u16, u16)]) -> bool {
    parameters.iter().all(|&(address, value)| store.get(address) == Some(value))
}

/// The other meaning of commands, where a parameter is set to that.
pub(super) fn other_words(family: &Family, store: &Store) -> Option<OtherWords> {
    family.roles.other_words.filter(|other| all_are(store, &[other.set_by]))
}

/// Whether commands from the bus are obeyed. Where they have another meaning, the parameter that decides it stands at that.
pub(super) fn obeys(family: &Family, store: &Store) -> bool {
    let decided_by = other_words(family, store).map(|other| other.set_by.0);
    let is_set = |&parameter: &(u16, u16)| decided_by == Some(parameter.0) || all_are(store, &[parameter]);
    family.roles.obeys.iter().all(is_set)
}

/// Reads the settings from the parameters in force and from `speed`, the word of the speed that the bus asks for.
///
/// Assumption: ramps are straight lines; their times are those from 0 Hz to the maximum frequency. The setpoint is cut
/// to the upper limit and to the maximum.
pub(super) fn settings(family: &Family, store: &Store, speed: u16) -> Settings {
    let roles = &family.roles;
    let of = |role: Option<Scaled>| {
        let Scaled { address, counts } = role?;
        store.get(address).map(|word| f64::from(word) / counts)
    };
    let seconds = |role| of(role).unwrap_or(USUAL_RAMP);

    let max = of(roles.max_frequency).unwrap_or(family.max_hertz);
    let from_bus = match &roles.speed_source {
        Some(sources) => all_are(store, sources),
        None => family.command.is_some() && obeys(family, store),
    };
    let asked = if from_bus {
        roles.speed.as_ref().map_or(0.0, |role| speed_in_hertz(role, store, speed, max))
    } else {
        of(roles.keypad_frequency).unwrap_or(USUAL_MAX_HZ)
    };
    let limit = max.min(of(roles.upper_frequency).unwrap_or(max));
    let slopes = |rise, fall| Slopes::from_times(max, seconds(rise), seconds(fall));
    Settings {
        setpoint: asked.clamp(-limit, limit),
        run_slopes: slopes(roles.acceleration, roles.deceleration),
        jog: of(roles.jog_frequency).unwrap_or(USUAL_JOG_HZ).min(max),
        jog_slopes: slopes(roles.jog_acceleration, roles.jog_deceleration),
        stop_by_coasting: roles.coasts_to_stop.is_some_and(|coasts| all_are(store, &[coasts])),
    }
}

/// The speed in `word`. Assumption: 100 % is the maximum frequency.
fn speed_in_hertz(speed: &Speed, store: &Store, word: u16, max: f64) -> f64 {
    let scale = speed.scale(|parameter| store.get(parameter));
    let count = if scale.bounds.signed { f64::from(word.cast_signed()) } else { f64::from(word) };
    let value = count / scale.counts;
    match scale.unit {
        SpeedUnit::Hertz => value,
        SpeedUnit::Percent => value / 100.0 * max,
        SpeedUnit::Rpm => motor::synchronous_hz(value),
    }
}
