//! What the output and the shaft do: run, jog, stop, coast, trip. One working point after the other, no steps.
//!
//! Between two events (a ramp's turn, the end of a stop, an overload trip) every quantity is a closed formula, so
//! [`Machine::advance`] goes from event to event and the result does not depend on how often it is called.
//!
//! What the manual leaves open:
//!
//! - Assumption: a jog begins only from standstill or out of another jog, and command 8 ends nothing but a jog. A run
//!   command does not interrupt a jog.
//! - Assumption: while it ramps down to stop, a drive still reports the direction it turns in; it reports "stopped"
//!   when the output reaches 0 Hz, and at once when it coasts.
//! - Assumption: a run command to a shaft that still turns catches it: the output starts at the shaft's speed.
//! - Assumption: an immediate stop holds the shaft where it is: it stands still at once.
//! - Assumption: the motor overload builds up with the square of the current above 110 % of its rating and
//!   trips after about six seconds at 150 % load; heat goes away evenly in ten seconds. A real drive takes about a
//!   minute; nobody wants to wait for that.
//! - Assumption: the cause of an overload is gone once the output is off, so that it can be reset at once. Its heat
//!   stays: a second overload trips sooner.

use std::time::Duration;

use drivebus_rtu::Instant;

use crate::motor::{self, UNFED, WorkingPoint};
use crate::ramp::{Ramp, Slopes};

/// Current above which heat builds up, as a share of the rated current.
const OVERLOAD_CURRENT: f64 = 1.1;
/// Heat at which the drive trips, in seconds times squared shares.
const TRIP_HEAT: f64 = 5.0;
/// Heat at which the pre-alarm bit comes on.
const ALARM_HEAT: f64 = 1.0;
/// Heat lost per second while the current is below [`OVERLOAD_CURRENT`].
const COOLING: f64 = 0.5;
/// What the energy meter counts in an hour at rated power. Assumption: watt-hours of a 4 kW motor.
const METERED_PER_HOUR: f64 = 4_000.0;

/// Which way the shaft turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Forward,
    Reverse,
}

impl Direction {
    fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Reverse => -1.0,
        }
    }
}

/// What the motor may be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Command {
    Run(Direction),
    Jog(Direction),
    Stop,
    Coast,
    StopAtOnce,
    ResetFault,
    JogStop,
    /// Taken, and nothing comes of it.
    Nothing,
}

/// What the parameters and setpoints ask of the machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings {
    /// Frequency to run at, Hz, within its limits; below zero the motor turns the other way round.
    pub(crate) setpoint: f64,
    pub(crate) run_slopes: Slopes,
    pub(crate) jog: f64,
    pub(crate) jog_slopes: Slopes,
    /// Whether "stop" coasts instead of ramping down.
    pub(crate) stop_by_coasting: bool,
}

/// What the output is on for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Run(Direction),
    Jog(Direction),
    /// On the way to 0 Hz, at the end of a jog or of a run.
    Stop {
        jog: bool,
    },
}

#[derive(Debug, Clone, Copy)]
enum Output {
    On {
        purpose: Purpose,
        ramp: Ramp,
    },
    /// The shaft turned at `rpm` when the output went off at `since`.
    Off {
        rpm: f64,
        since: Instant,
    },
}

/// What the motor does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunState {
    Forward,
    Reverse,
    Stopped,
    Fault,
}

/// Which way the output frequency goes, as status words number it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ramping {
    /// Output off, or at 0 Hz.
    Stopped = 0,
    Faster = 1,
    Slower = 2,
    Even = 3,
}

/// Output, shaft, overload and present fault of one drive.
#[derive(Debug)]
pub(crate) struct Machine {
    now: Instant,
    output: Output,
    load: f64,
    /// Fault number of the motor overload; `None`: it does not trip.
    overload: Option<u16>,
    /// What the motor took from the beginning until `metered`, as shares of its rated power times seconds.
    taken: f64,
    /// Since then nothing has changed but the frequency, along one line.
    metered: Instant,
    heat: f64,
    /// How fast heat builds up (or goes, below zero). Between two events neither the torque nor the current changes.
    heating: f64,
    fault: Option<u16>,
    /// A fault whose cause is still there cannot be reset.
    held: bool,
}

impl Machine {
    pub(crate) fn new(now: Instant, load: f64, overload: Option<u16>) -> Self {
        let output = Output::Off { rpm: 0.0, since: now };
        let (taken, heat, heating) = (0.0, 0.0, -COOLING);
        Self { now, output, load, overload, taken, metered: now, heat, heating, fault: None, held: false }
    }

    /// The same after a loss of power at `now`, of which only the energy meter knows nothing.
    pub(crate) fn after_power_loss(&self, now: Instant) -> Self {
        Self { taken: self.taken + self.unmetered(), ..Self::new(now, self.load, self.overload) }
    }

    /// Lets time pass until `to`; returns the fault that tripped the drive on the way, if one did.
    pub(crate) fn advance(&mut self, to: Instant) -> Option<u16> {
        let mut tripped = None;
        while self.now < to {
            let turn = match self.output {
                Output::On { ramp, .. } => ramp.next_turn(self.now),
                Output::Off { .. } => None,
            };
            let overload = self.overload_at();
            let next = [turn, overload.map(|(at, _)| at), Some(to)].into_iter().flatten().min().unwrap_or(to);
            let seconds = next.saturating_duration_since(self.now).as_secs_f64();
            self.heat = (self.heat + self.heating * seconds).max(0.0);
            self.now = next;
            if let Some((_, code)) = overload.filter(|&(at, _)| at == next) {
                self.trip(code);
                tripped = Some(code);
            } else if turn == Some(next) {
                self.meter();
                self.finish_stop();
                self.heating = self.heating();
            }
        }
        tripped
    }

    /// Does what `command` says, as far as the state allows.
    pub(crate) fn command(&mut self, command: Command, settings: &Settings) {
        match (command, self.purpose()) {
            (Command::ResetFault, _) => {
                if !self.held {
                    self.fault = None;
                }
            }
            (Command::Run(_) | Command::Jog(_), _) if self.fault.is_some() => {}
            (Command::Run(direction), None | Some(Purpose::Run(_) | Purpose::Stop { .. })) => {
                self.turn_on(Purpose::Run(direction), settings);
            }
            (Command::Jog(direction), None | Some(Purpose::Jog(_) | Purpose::Stop { jog: true })) => {
                self.turn_on(Purpose::Jog(direction), settings);
            }
            (Command::Stop, Some(Purpose::Run(_))) if settings.stop_by_coasting => self.turn_off(),
            (Command::Stop, Some(Purpose::Run(_))) => self.turn_on(Purpose::Stop { jog: false }, settings),
            (Command::Stop | Command::JogStop, Some(Purpose::Jog(_))) => {
                self.turn_on(Purpose::Stop { jog: true }, settings);
            }
            (Command::Coast, Some(_)) => self.turn_off(),
            (Command::StopAtOnce, Some(_)) => {
                self.turn_off();
                self.output = Output::Off { rpm: 0.0, since: self.now };
            }
            (Command::Run(_), Some(Purpose::Jog(_)))
            | (Command::Jog(_), Some(Purpose::Run(_) | Purpose::Stop { jog: false }))
            | (Command::Stop, None | Some(Purpose::Stop { .. }))
            | (Command::JogStop, None | Some(Purpose::Run(_) | Purpose::Stop { .. }))
            | (Command::Coast | Command::StopAtOnce, None)
            | (Command::Nothing, _) => {}
        }
    }

    /// Takes changed settings into account.
    pub(crate) fn update(&mut self, settings: &Settings) {
        if let Some(purpose) = self.purpose() {
            self.turn_on(purpose, settings);
        }
    }

    /// Trips the drive: output off, fault shown.
    pub(crate) fn trip(&mut self, code: u16) {
        self.turn_off();
        self.fault = Some(code);
    }

    /// Whether the cause of a fault is there and keeps it from being reset.
    pub(crate) fn hold_fault(&mut self, held: bool) {
        self.held = held;
    }

    /// Sets the load as a share of rated torque.
    pub(crate) fn set_load(&mut self, load: f64) {
        self.meter();
        if let Output::Off { rpm, since } = &mut self.output {
            *rpm = motor::coast(*rpm, self.load, self.now.saturating_duration_since(*since).as_secs_f64());
            *since = self.now;
        }
        self.load = load;
        self.heating = self.heating();
    }

    pub(crate) fn load(&self) -> f64 {
        self.load
    }

    pub(crate) fn fault(&self) -> Option<u16> {
        self.fault
    }

    /// Whether the output is on.
    pub(crate) fn is_running(&self) -> bool {
        matches!(self.output, Output::On { .. })
    }

    /// Whether it jogs, or comes to a stop out of a jog.
    pub(crate) fn is_jogging(&self) -> bool {
        matches!(self.purpose(), Some(Purpose::Jog(_) | Purpose::Stop { jog: true }))
    }

    pub(crate) fn ramping(&self) -> Ramping {
        let Output::On { ramp, .. } = self.output else { return Ramping::Stopped };
        match ramp.slope(self.now) {
            slope if slope > 0.0 => Ramping::Faster,
            slope if slope < 0.0 => Ramping::Slower,
            _ if ramp.at(self.now) == 0.0 => Ramping::Stopped,
            _ => Ramping::Even,
        }
    }

    /// What the energy meter has counted.
    pub(crate) fn energy(&self) -> f64 {
        (self.taken + self.unmetered()) / 3_600.0 * METERED_PER_HOUR
    }

    pub(crate) fn overload_alarm(&self) -> bool {
        self.heat >= ALARM_HEAT
    }

    pub(crate) fn state(&self) -> RunState {
        match (self.fault, self.purpose()) {
            (Some(_), _) => RunState::Fault,
            (None, None) => RunState::Stopped,
            (None, Some(purpose)) => {
                let hz = self.frequency();
                let forward = match purpose {
                    Purpose::Run(direction) | Purpose::Jog(direction) if hz == 0.0 => direction == Direction::Forward,
                    _ => hz >= 0.0,
                };
                if forward { RunState::Forward } else { RunState::Reverse }
            }
        }
    }

    /// Output frequency, Hz, negative in reverse; 0 while the output is off.
    pub(crate) fn frequency(&self) -> f64 {
        match self.output {
            Output::On { ramp, .. } => ramp.at(self.now),
            Output::Off { .. } => 0.0,
        }
    }

    /// Shaft speed, rpm, negative in reverse.
    pub(crate) fn speed(&self) -> f64 {
        match self.output {
            Output::On { .. } => self.working_point().rpm * self.frequency().signum(),
            Output::Off { rpm, since } => {
                motor::coast(rpm, self.load, self.now.saturating_duration_since(since).as_secs_f64())
            }
        }
    }

    pub(crate) fn working_point(&self) -> WorkingPoint {
        match self.output {
            Output::On { ramp, .. } => WorkingPoint::new(ramp.at(self.now).abs(), ramp.slope(self.now), self.load),
            Output::Off { .. } => UNFED,
        }
    }

    fn purpose(&self) -> Option<Purpose> {
        match self.output {
            Output::On { purpose, .. } => Some(purpose),
            Output::Off { .. } => None,
        }
    }

    /// What the motor took since `metered`. Its torque has not changed since, so its power has moved along a line;
    /// what flows back goes to the brake.
    fn unmetered(&self) -> f64 {
        let Output::On { ramp, .. } = self.output else { return 0.0 };
        let slope = ramp.slope(self.metered);
        let power = |at| WorkingPoint::new(ramp.at(at).abs(), slope, self.load).power;
        let seconds = self.now.saturating_duration_since(self.metered).as_secs_f64();
        (f64::midpoint(power(self.metered), power(self.now)) * seconds).max(0.0)
    }

    fn meter(&mut self) {
        self.taken += self.unmetered();
        self.metered = self.now;
    }

    fn turn_on(&mut self, purpose: Purpose, settings: &Settings) {
        self.meter();
        let from = match self.output {
            Output::On { ramp, .. } => ramp.at(self.now),
            Output::Off { .. } => motor::synchronous_hz(self.speed()),
        };
        let (to, slopes) = match purpose {
            Purpose::Run(direction) => (direction.sign() * settings.setpoint, settings.run_slopes),
            Purpose::Jog(direction) => (direction.sign() * settings.jog, settings.jog_slopes),
            Purpose::Stop { jog: false } => (0.0, settings.run_slopes),
            Purpose::Stop { jog: true } => (0.0, settings.jog_slopes),
        };
        self.output = Output::On { purpose, ramp: Ramp::new(self.now, from, to, slopes) };
        self.finish_stop();
        self.heating = self.heating();
    }

    fn turn_off(&mut self) {
        self.meter();
        self.output = Output::Off { rpm: self.speed(), since: self.now };
        self.heating = self.heating();
    }

    /// A stop that has reached 0 Hz switches the output off.
    fn finish_stop(&mut self) {
        if let Output::On { purpose: Purpose::Stop { .. }, ramp } = self.output
            && ramp.next_turn(self.now).is_none()
        {
            self.turn_off();
        }
    }

    /// The heating at this working point.
    fn heating(&self) -> f64 {
        let current = self.working_point().current_share();
        if current > OVERLOAD_CURRENT { current.powi(2) - OVERLOAD_CURRENT.powi(2) } else { -COOLING }
    }

    /// When the overload trips if nothing changes before, and with which fault.
    fn overload_at(&self) -> Option<(Instant, u16)> {
        let code = self.overload.filter(|_| self.heating > 0.0)?;
        let time = Duration::try_from_secs_f64((TRIP_HEAT - self.heat) / self.heating).unwrap_or(Duration::ZERO);
        // At least one nanosecond, so that the moment lies ahead and is reached.
        Some((self.now + time.max(Duration::from_nanos(1)), code))
    }
}
