//! What parameters and setpoints ask of the machine.

use super::family::Family;
use super::machine::Settings;
use super::store::Store;
use crate::motor;
use crate::ramp::Slopes;

/// Where a family has no parameter for it: the highest frequency, Hz. Assumption, as the others.
const USUAL_MAX_HZ: f64 = 50.0;
/// How long a ramp over all of that takes, s.
const USUAL_RAMP: f64 = 10.0;
/// How fast a jog is, Hz.
const USUAL_JOG_HZ: f64 = 5.0;

/// Whether `parameters` have the values that stand beside them.
pub(super) fn all_are(store: &Store, parameters: &[(u16, u16)]) -> bool {
    parameters.iter().all(|&(address, value)| store.get(address) == Some(value))
}

/// Reads the settings from the parameters in force and from `speed`, the speed that the bus asks for.
///
/// Assumption: ramps are straight lines; their times are those from 0 Hz to the maximum frequency. The setpoint is cut
/// to the upper limit and to the maximum.
pub(super) fn settings(family: &Family, store: &Store, speed: u16) -> Settings {
    let roles = &family.roles;
    let of = |role: Option<u16>| role.and_then(|address| store.get(address)).map(f64::from);
    let hertz = |role| of(role).map(|counts| counts / 100.0);
    let seconds = |role| of(role).map_or(USUAL_RAMP, |counts| counts / 10.0);

    let max = hertz(roles.max_frequency).unwrap_or(USUAL_MAX_HZ);
    let from_bus = match roles.speed_source {
        Some(source) => all_are(store, &[source]),
        None => family.command.is_some() && all_are(store, roles.obeys),
    };
    let asked = if from_bus {
        speed_in_hertz(roles.speed_unit.and_then(|address| store.get(address)), speed, max)
    } else {
        hertz(roles.keypad_frequency).unwrap_or(USUAL_MAX_HZ)
    };
    let limit = max.min(hertz(roles.upper_frequency).unwrap_or(max));
    let slopes = |rise, fall| Slopes::from_times(max, seconds(rise), seconds(fall));
    Settings {
        setpoint: asked.clamp(-limit, limit),
        run_slopes: slopes(roles.acceleration, roles.deceleration),
        jog: hertz(roles.jog_frequency).unwrap_or(USUAL_JOG_HZ).min(max),
        jog_slopes: slopes(roles.jog_acceleration, roles.jog_deceleration),
        stop_by_coasting: roles.coasts_to_stop.is_some_and(|coasts| all_are(store, &[coasts])),
    }
}

/// The speed in `word`, in a family's unit. Assumption: 100 % is the maximum frequency.
fn speed_in_hertz(unit: Option<u16>, word: u16, max: f64) -> f64 {
    match unit {
        Some(0) => f64::from(word.cast_signed()) / 10_000.0 * max,
        Some(2) => motor::synchronous_hz(f64::from(word)),
        _ => f64::from(word) / 100.0,
    }
}

/// Whether `word` can be a speed in a family's unit: -100.00..=100.00 %, 0.00..=600.00 Hz, any rpm.
pub(super) fn is_speed(unit: Option<u16>, word: u16) -> bool {
    match unit {
        Some(0) => (-10_000..=10_000).contains(&word.cast_signed()),
        Some(2) => true,
        _ => word <= 60_000,
    }
}
