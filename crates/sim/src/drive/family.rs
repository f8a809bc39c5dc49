//! What each family of drives does, typed from its manuals and not from its profile.
//!
//! A profile of somebody's own has nobody who typed it a second time: `own` takes the behaviour from the profile.
//!
//! A profile is what a master believes of a drive. If the simulated drive took its command codes, states, scales and
//! refusals from there, a mistake in the profile would agree with itself. So each family says here by itself which
//! words it has, what they show and what a command does; one machine does it. Only parameters that do nothing but keep
//! a value come from the profile, with their ranges.
//!
//! What the manuals at hand leave open is marked "Assumption:" where it is decided.

mod a1000;
mod acs355;
mod acs580;
mod atv12;
mod atv312;
mod atv320;
mod atv600;
mod atv71;
mod cfw500;
mod chf100a;
mod e510;
mod eds300;
mod f510;
mod fc202;
mod fc51;
mod fr_d700;
mod frenic;
mod gd200a;
mod gd300;
mod gd3000;
mod gd350;
mod gd600;
mod gs2;
mod gs4;
mod h100;
mod handshake;
mod huanyang;
mod j1000;
mod md500;
mod ms300;
mod nowforever;
mod optidrive;
pub(crate) mod own;
mod powerxl;
mod register;
mod roles;
mod saj8000m;
mod sj200;
mod smd;
mod starvert;
mod sunfar;
mod unlisted;
mod v20;
mod vacon;
mod vf_s15;
mod vfd500;
mod vfd_b;
mod vfd_e;
mod wj200;
mod x200;
mod yl620;

use std::borrow::Cow;

use super::machine::Command;
use super::refusal::Refusal;
pub(crate) use handshake::Handshake;
pub(crate) use register::{Bit, Bounds, Count, Flag, Measure, Parameter, Range, Register, Shows};
pub(crate) use roles::{
    Absent, Deciding, Lock, OnSilence, OtherWords, Roles, Scaled, Silence, Speed, SpeedScale, SpeedUnit,
};
pub(crate) use unlisted::unlisted;

/// One family.
#[derive(Debug, Clone)]
pub(crate) struct Family {
    /// The name of its profile.
    pub(crate) name: Cow<'static, str>,
    /// What is on its output.
    pub(crate) kind: Kind,
    /// The function codes it takes.
    pub(crate) functions: Vec<u8>,
    /// Most words in one request.
    pub(crate) max_words: u16,
    /// Whether a read may run from one group of addresses (one high byte) into the next.
    pub(crate) across_groups: bool,
    /// The exception code of each refusal.
    pub(crate) exception: fn(Refusal) -> u8,
    /// Which memory a parameter's address reaches.
    pub(crate) memory: Memory,
    /// What [`Shows::Identification`] shows.
    pub(crate) identification: u16,
    /// The register that takes commands, and what each code does; codes it does not know are out of range.
    pub(crate) command: Option<u32>,
    pub(crate) commands: Vec<(u16, Command)>,
    /// Where a command is bits and no code: what the word at the register does, by the word before it and itself.
    pub(crate) control_word: Option<fn(u16, u16) -> Command>,
    /// Commands in registers of their own: address, code, and what it does.
    pub(crate) elsewhere: Vec<(u32, u16, Command)>,
    /// Its bus registers; a later one replaces an earlier one at the same address.
    pub(crate) registers: Vec<Register>,
    /// Its parameters, beside those of the profile, which they replace at the same address.
    pub(crate) parameters: Vec<Parameter>,
    /// Factory values of parameters that stand in the profile without one.
    pub(crate) factory: &'static [(u16, u16)],
    /// Parameters that cannot be set above [`Roles::max_frequency`], whatever the profile says.
    pub(crate) capped: &'static [u16],
    pub(crate) roles: Roles,
    /// How many milliseconds an answer takes where no parameter says it.
    pub(crate) delay: u16,
    /// The highest frequency where no parameter says it, Hz.
    pub(crate) max_hertz: f64,
    pub(crate) faults: Faults,
}

/// Most words of one read or write: GD350 operation manual, sections 9.4.1 and 9.4.4; VFD500 manual, appendix A.
///
/// Assumption: the same in the families whose manuals at hand do not say.
const MAX_WORDS: u16 = 16;
/// How long a drive takes to answer that has no parameter for it, ms. Assumption: what most have from the factory.
const USUAL_DELAY: u16 = 5;
/// The highest frequency of most, and what their keypads ask for. Assumption.
pub(crate) const USUAL_MAX_HZ: f64 = 50.0;

/// What a family drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A motor.
    Inverter,
    /// Nothing that turns: it feeds the inverters beside it.
    Rectifier,
}

/// What a bit of a parameter's address does when it is written to. An address that has it cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Memory {
    /// Plain addresses are kept in EEPROM; with the bit the word goes to RAM only.
    BitMeansRam(u16),
    /// Plain addresses write to RAM only; with the bit the word is kept in EEPROM.
    BitMeansEeprom(u16),
    /// Addresses with these bits are kept in EEPROM and read; without all of them the word goes to RAM only.
    BitsMeanEeprom(u16),
    /// Every write is kept in EEPROM; there is no address with such a bit.
    EepromOnly,
    /// Every write goes to RAM, until the word at this address has one of these bits: that stores all, and the bits go back to 0.
    /// Where there are none, any word that is written there stores all.
    RamUntil(u32, u16),
}

/// The bit that families typed here have for the other memory.
const MEMORY_BIT: u16 = 0x8000;

impl Memory {
    /// Where what is written at `address` is read.
    pub(crate) fn plain(self, address: u32) -> u32 {
        match self {
            Self::BitMeansRam(bit) | Self::BitMeansEeprom(bit) => address & !u32::from(bit),
            Self::BitsMeanEeprom(bits) if address & u32::from(bits) == 0 => address | u32::from(bits),
            Self::BitsMeanEeprom(_) | Self::EepromOnly | Self::RamUntil(..) => address,
        }
    }
}

/// The numbers of the faults that come about by themselves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Faults {
    /// Motor overload. `None`: it does not trip.
    pub(crate) overload: Option<u16>,
    /// A bus that is silent for too long. `None`: the motor coasts without a fault.
    pub(crate) silent_bus: Option<u16>,
}

/// Every family that is typed here.
const FAMILIES: [fn() -> Family; 55] = [
    gd350::gd350,
    gd300::gd35,
    gd300::gd35_h1,
    gd300::gd300,
    gd200a::gd10,
    gd200a::gd20,
    gd200a::gd100,
    gd200a::gd200a,
    gd600::gd600,
    gd600::rectifier,
    gd3000::gd3000,
    gd3000::rectifier,
    vfd500::vfd500,
    chf100a::chf100a,
    chf100a::chv100,
    ms300::ms300,
    vfd_e::vfd_e,
    vfd_b::vfd_b,
    yl620::yl620,
    md500::md500,
    a1000::a1000,
    j1000::j1000,
    nowforever::nowforever,
    cfw500::cfw500,
    saj8000m::saj8000m,
    eds300::eds300,
    sunfar::e300,
    atv12::atv12,
    atv312::atv312,
    atv600::atv600,
    atv71::atv71,
    atv320::atv320,
    v20::v20,
    acs355::acs355,
    acs580::acs580,
    fc51::fc51,
    fc202::fc202,
    fr_d700::fr_d700,
    wj200::wj200,
    sj200::sj200,
    x200::x200,
    vf_s15::vf_s15,
    frenic::frenic,
    e510::e510,
    f510::f510,
    gs2::gs2,
    gs4::gs4,
    vacon::vacon10,
    h100::h100,
    optidrive::e3,
    optidrive::p2,
    powerxl::dc1,
    smd::smd,
    starvert::starvert,
    huanyang::huanyang,
];

impl Family {
    /// The family called `name`, in upper or lower case.
    pub(crate) fn named(name: &str) -> Option<Self> {
        FAMILIES.into_iter().map(|family| family()).find(|family| family.name.eq_ignore_ascii_case(name.trim()))
    }

    /// The names of all of them.
    pub(crate) fn names() -> impl Iterator<Item = Cow<'static, str>> {
        FAMILIES.into_iter().map(|family| family().name)
    }

    /// Whether `address` takes commands.
    pub(crate) fn takes_commands(&self, address: u32) -> bool {
        self.command == Some(address) || self.elsewhere.iter().any(|&(place, ..)| place == address)
    }

    /// What `code` does at `address`, where `before` stood; `None` where it is out of range, or no command is taken there.
    pub(crate) fn command_at(&self, address: u32, before: u16, code: u16) -> Option<Command> {
        if let Some(decode) = self.control_word.filter(|_| self.command == Some(address)) {
            return Some(decode(before, code));
        }
        let here = self.commands.iter().filter(|_| self.command == Some(address));
        let others = self.elsewhere.iter().filter(|&&(place, ..)| place == address);
        let mut known = here.copied().chain(others.map(|&(_, code, command)| (code, command)));
        known.find(|&(known, _)| known == code).map(|(_, command)| command)
    }
}
