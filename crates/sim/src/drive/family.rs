//! What each family of drives does, typed from its manuals and not from its profile.
//!
//! A profile is what a master believes of a drive. If the simulated drive took its command codes, states, scales and
//! refusals from there, a mistake in the profile would agree with itself. So each family says here by itself which
//! words it has, what they show and what a command does; one machine does it. Only parameters that do nothing but keep
//! a value come from the profile, with their ranges.
//!
//! What the manuals at hand leave open is marked "Assumption:" where it is decided.

mod chf100a;
mod gd300;
mod gd3000;
mod gd350;
mod gd600;
mod register;
mod vfd500;

use super::machine::Command;
use super::refusal::Refusal;
pub(crate) use register::{Bit, Count, Measure, Parameter, Range, Register, Shows};

/// One family.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Family {
    /// The name of its profile.
    pub(crate) name: &'static str,
    /// What is on its output.
    pub(crate) kind: Kind,
    /// The function codes it takes.
    pub(crate) functions: &'static [u8],
    /// The exception code of each refusal.
    pub(crate) exception: fn(Refusal) -> u8,
    /// Which memory a parameter's address reaches.
    pub(crate) memory: Memory,
    /// What [`Shows::Identification`] shows.
    pub(crate) identification: u16,
    /// The first of the words that the bus sets.
    pub(crate) control: u16,
    /// The register that takes commands, and what each code does; codes it does not know are out of range.
    pub(crate) command: Option<u16>,
    pub(crate) commands: fn(u16) -> Option<Command>,
    /// Its bus registers, in blocks; a later one replaces an earlier one at the same address.
    pub(crate) registers: &'static [&'static [Register]],
    /// Its parameters, beside those of the profile, which they replace at the same address.
    pub(crate) parameters: &'static [Parameter],
    /// Factory values of parameters that stand in the profile without one.
    pub(crate) factory: &'static [(u16, u16)],
    /// Parameters that cannot be set above [`Roles::max_frequency`], whatever the profile says.
    pub(crate) capped: &'static [u16],
    pub(crate) roles: Roles,
    pub(crate) faults: Faults,
}

/// What a family drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A motor.
    Inverter,
    /// Nothing that turns: it feeds the inverters beside it.
    Rectifier,
}

/// What bit 15 of a parameter's address does when it is written to. An address that has it cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Memory {
    /// Plain addresses are kept in EEPROM; with the bit the word goes to RAM only.
    BitMeansRam,
    /// Plain addresses write to RAM only; with the bit the word is kept in EEPROM.
    BitMeansEeprom,
    /// Every write is kept in EEPROM; there is no address with the bit.
    EepromOnly,
}

/// The parameters at which a family behaves, by address; `None` where it has no such parameter or nobody knows which.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Roles {
    /// Commands move something only while each of these parameters has this value.
    pub(crate) obeys: &'static [(u16, u16)],
    /// Who gives the commands, as status words show it.
    pub(crate) channel: Option<u16>,
    /// The speed comes from the bus while this parameter has this value. Without one: while the bus is obeyed.
    pub(crate) speed_source: Option<(u16, u16)>,
    /// The unit of the speed registers: 0 hundredths of a percent, 1 hundredths of a hertz, 2 rpm. Without one: hertz.
    pub(crate) speed_unit: Option<u16>,
    /// The speed where it does not come from the bus, in hundredths of a hertz.
    pub(crate) keypad_frequency: Option<u16>,
    pub(crate) max_frequency: Option<u16>,
    pub(crate) upper_frequency: Option<u16>,
    pub(crate) acceleration: Option<u16>,
    pub(crate) deceleration: Option<u16>,
    pub(crate) jog_frequency: Option<u16>,
    pub(crate) jog_acceleration: Option<u16>,
    pub(crate) jog_deceleration: Option<u16>,
    /// "Stop" coasts while this parameter has this value.
    pub(crate) coasts_to_stop: Option<(u16, u16)>,
    pub(crate) password: Option<u16>,
    /// The latest fault first.
    pub(crate) fault_history: &'static [u16],
    pub(crate) unit_address: Option<u16>,
    /// In milliseconds.
    pub(crate) response_delay: Option<u16>,
    /// In tenths of a second, 0 for never.
    pub(crate) bus_timeout: Option<u16>,
    /// 0 trips, 1 does nothing, 2 stops if the bus is obeyed, 3 stops. Without one it trips.
    pub(crate) bus_timeout_action: Option<u16>,
}

impl Roles {
    /// None of them.
    pub(crate) const NONE: Self = Self {
        obeys: &[],
        channel: None,
        speed_source: None,
        speed_unit: None,
        keypad_frequency: None,
        max_frequency: None,
        upper_frequency: None,
        acceleration: None,
        deceleration: None,
        jog_frequency: None,
        jog_acceleration: None,
        jog_deceleration: None,
        coasts_to_stop: None,
        password: None,
        fault_history: &[],
        unit_address: None,
        response_delay: None,
        bus_timeout: None,
        bus_timeout_action: None,
    };
}

/// The numbers of the faults that come about by themselves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Faults {
    /// Motor overload.
    pub(crate) overload: u16,
    /// A bus that is silent for too long.
    pub(crate) silent_bus: u16,
}

/// Every family that is simulated.
static FAMILIES: [&Family; 11] = [
    &gd350::GD350,
    &gd300::GD35,
    &gd300::GD35_H1,
    &gd300::GD300,
    &gd600::GD600,
    &gd600::RECTIFIER,
    &gd3000::GD3000,
    &gd3000::RECTIFIER,
    &vfd500::VFD500,
    &chf100a::CHF100A,
    &chf100a::CHV100,
];

impl Family {
    /// The family called `name`, in upper or lower case.
    pub(crate) fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.into_iter().find(|family| family.name.eq_ignore_ascii_case(name.trim()))
    }

    /// The names of all of them.
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        FAMILIES.into_iter().map(|family| family.name)
    }
}
