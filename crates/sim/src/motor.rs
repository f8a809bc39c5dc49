//! The motor on the drive and the machine on its shaft: a 4 kW, four-pole asynchronous motor on a 380 V drive.
//!
//! Everything is algebra over the output frequency, its slope and the load: nothing is integrated in steps, so a
//! simulated hour costs what a simulated second costs. The flux is taken as constant, so above the rated frequency
//! the currents are only a sketch. Shares are of rated values.
//!
//! Assumption: the whole motor. No manual gives one; the figures are those of a usual 4 kW motor.

/// Rated frequency, Hz.
pub(crate) const RATED_HZ: f64 = 50.0;
/// Rated voltage, V.
pub(crate) const RATED_VOLTS: f64 = 380.0;
/// Rated current, A.
pub(crate) const RATED_AMPERES: f64 = 9.0;
/// Current that only magnetises, A.
pub(crate) const MAGNETISING_AMPERES: f64 = 3.6;
/// Synchronous speed per Hz, rpm: two pole pairs.
const RPM_PER_HZ: f64 = 30.0;
/// Speed lost to slip at rated torque, rpm.
const RATED_SLIP_RPM: f64 = 60.0;
/// Speed at rated frequency and torque, rpm.
pub(crate) const RATED_RPM: f64 = RATED_HZ * RPM_PER_HZ - RATED_SLIP_RPM;
/// How long rated torque would take to bring motor and machine to rated speed, s.
const INERTIA_SECONDS: f64 = 2.0;
/// The least torque that bearings and air take, as a share.
const FRICTION: f64 = 0.05;
/// Bus voltage without load, V: the crest of 380 V.
const IDLE_BUS_VOLTS: f64 = 537.0;
/// What the bus loses at rated power, V.
const BUS_DIP_VOLTS: f64 = 16.0;
/// What the bus gains when rated power flows back, V.
const BUS_RISE_VOLTS: f64 = 120.0;
/// Where the brake chopper holds the bus, V.
const BUS_LIMIT_VOLTS: f64 = 700.0;

/// The present working point of a fed motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WorkingPoint {
    /// Shaft torque as a share, positive while it drives, negative while it brakes.
    pub(crate) torque: f64,
    /// Stator current, A.
    pub(crate) amperes: f64,
    /// Output voltage, V.
    pub(crate) volts: f64,
    /// Shaft speed, rpm, without sign.
    pub(crate) rpm: f64,
    /// Shaft power as a share, negative while it flows back.
    pub(crate) power: f64,
    /// DC bus, V.
    pub(crate) bus_volts: f64,
}

/// What the drive shows while its output is off.
pub(crate) const UNFED: WorkingPoint =
    WorkingPoint { torque: 0.0, amperes: 0.0, volts: 0.0, rpm: 0.0, power: 0.0, bus_volts: IDLE_BUS_VOLTS };

impl WorkingPoint {
    /// At `hz` (without sign), which changes by `slope` Hz/s, under `load` as a share of rated torque.
    pub(crate) fn new(hz: f64, slope: f64, load: f64) -> Self {
        let torque = load.max(FRICTION) + INERTIA_SECONDS * slope / RATED_HZ;
        let rpm = (hz * RPM_PER_HZ - RATED_SLIP_RPM * torque).max(0.0);
        let power = torque * rpm / RATED_RPM;
        let bus_volts = if power < 0.0 {
            (IDLE_BUS_VOLTS - BUS_RISE_VOLTS * power).min(BUS_LIMIT_VOLTS)
        } else {
            IDLE_BUS_VOLTS - BUS_DIP_VOLTS * power
        };
        let active = (RATED_AMPERES.powi(2) - MAGNETISING_AMPERES.powi(2)).sqrt() * torque;
        Self {
            torque,
            amperes: active.hypot(MAGNETISING_AMPERES),
            volts: RATED_VOLTS * (hz / RATED_HZ).min(1.0),
            rpm,
            power,
            bus_volts,
        }
    }

    /// Current as a share of the motor's rated current.
    pub(crate) fn current_share(&self) -> f64 {
        self.amperes / RATED_AMPERES
    }
}

/// Shaft speed, in rpm and with `rpm`'s sign, of a motor left alone under `load` for `seconds`.
///
/// The load brakes with the same torque at any speed, so the speed falls along a straight line.
pub(crate) fn coast(rpm: f64, load: f64, seconds: f64) -> f64 {
    let lost = load.max(FRICTION) * RATED_RPM / INERTIA_SECONDS * seconds;
    rpm.signum() * (rpm.abs() - lost).max(0.0)
}

/// The output frequency that would turn the shaft at `rpm` without slip.
pub(crate) fn synchronous_hz(rpm: f64) -> f64 {
    rpm / RPM_PER_HZ
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "exact by construction")]

    use super::*;

    #[test]
    fn the_rated_point_is_what_the_name_plate_says() {
        let point = WorkingPoint::new(50.0, 0.0, 1.0);
        assert!((point.amperes - 9.0).abs() < 1e-9);
        assert_eq!((point.torque, point.rpm, point.power, point.volts), (1.0, 1_440.0, 1.0, 380.0));
        assert_eq!(point.bus_volts, 521.0);
    }

    #[test]
    fn braking_sends_power_back_and_lifts_the_bus() {
        // From 50 Hz in 1 s: 2 s × 50 Hz/s ÷ 50 Hz = 2.0 of rated torque, less the load of 0.5.
        let point = WorkingPoint::new(25.0, -50.0, 0.5);
        assert_eq!((point.torque, point.rpm), (-1.5, 840.0));
        assert_eq!(point.power, -1.5 * 840.0 / 1_440.0);
        assert_eq!(point.bus_volts, 537.0 + 120.0 * 0.875);
    }

    #[test]
    fn a_shaft_left_alone_loses_speed_evenly_and_stops() {
        assert_eq!(coast(1_440.0, 0.5, 1.0), 1_080.0);
        assert_eq!(coast(-1_440.0, 0.5, 1.0), -1_080.0);
        assert_eq!(coast(1_440.0, 0.5, 5.0), 0.0);
        assert_eq!(coast(1_440.0, 0.0, 10.0), 1_080.0, "friction is 5 %");
    }
}
