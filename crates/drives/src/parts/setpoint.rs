//! Setpoints: what a drive can be given over the bus beside commands, under one name for every family.

use serde::Deserialize;

use crate::parts::command::Control;

/// What a drive can be given over the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Setpoint {
    /// The frequency to run at.
    Frequency,
    /// The torque to drive with.
    Torque,
    /// The value that the PID controller is to reach.
    Pid,
    /// The value that the PID controller sees.
    PidFeedback,
    /// The highest frequency while turning forward.
    ForwardLimit,
    /// The highest frequency while turning in reverse.
    ReverseLimit,
    /// The highest torque while driving the load.
    MotoringTorqueLimit,
    /// The highest torque while braking the load.
    BrakingTorqueLimit,
    /// The voltage where it is separate from the frequency.
    VfVoltage,
    /// The first analog output.
    #[serde(rename = "analog_output_1")]
    AnalogOutput1,
    /// The second analog output.
    #[serde(rename = "analog_output_2")]
    AnalogOutput2,
    /// Digital inputs as the bus sets them.
    VirtualInputs,
    /// Digital outputs as the bus sets them.
    VirtualOutputs,
    /// Motor choice, excitation, braking and the like.
    SpecialControl,
}

impl Setpoint {
    /// Every setpoint.
    pub const ALL: [Self; 14] = [
        Self::Frequency,
        Self::Torque,
        Self::Pid,
        Self::PidFeedback,
        Self::ForwardLimit,
        Self::ReverseLimit,
        Self::MotoringTorqueLimit,
        Self::BrakingTorqueLimit,
        Self::VfVoltage,
        Self::AnalogOutput1,
        Self::AnalogOutput2,
        Self::VirtualInputs,
        Self::VirtualOutputs,
        Self::SpecialControl,
    ];

    /// Its name in profiles and programs: `frequency`, `pid_feedback` …
    pub const fn name(self) -> &'static str {
        match self {
            Self::Frequency => "frequency",
            Self::Torque => "torque",
            Self::Pid => "pid",
            Self::PidFeedback => "pid_feedback",
            Self::ForwardLimit => "forward_limit",
            Self::ReverseLimit => "reverse_limit",
            Self::MotoringTorqueLimit => "motoring_torque_limit",
            Self::BrakingTorqueLimit => "braking_torque_limit",
            Self::VfVoltage => "vf_voltage",
            Self::AnalogOutput1 => "analog_output_1",
            Self::AnalogOutput2 => "analog_output_2",
            Self::VirtualInputs => "virtual_inputs",
            Self::VirtualOutputs => "virtual_outputs",
            Self::SpecialControl => "special_control",
        }
    }
}

/// Where a family takes a setpoint, and what must be set before it does.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct SetpointRole {
    /// The register's name.
    pub register: String,
    /// The parameters that must have certain values, in order.
    pub needs: Vec<Control>,
}
