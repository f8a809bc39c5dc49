//! The shape of `profile.toml`: what may stand in it, and of which type. What it refers to is `assemble`'s to check.

mod motion;
#[cfg(test)]
mod schema;

use std::collections::BTreeMap;

pub(super) use motion::{
    Commands, Control, Elsewhere, Scale, SetpointRole, States, Unlock, Variant, VariantChoice, VariantShare, Watchdog,
    Word,
};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use super::placed::Placed;
use super::{File, ProfileError, line_of, shape};
use crate::parts::fault::Means;
use crate::parts::memory::MemoryBit;
use crate::parts::rules::{Protocol, UnitKind};
use crate::parts::setpoint::Setpoint;

/// The rules of a family of drives. The long tables stand beside it: registers.csv, parameters.csv, faults.csv.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// One word: lower-case letters, digits, `-` and `_`.
    pub(super) name: Placed<String>,
    /// The family as its maker calls it.
    pub(super) title: Option<String>,
    /// Who makes it.
    pub(super) maker: Option<Placed<String>>,
    /// What stands on drives of this family beside its name and title: `--profile` takes it too.
    pub(super) models: Option<Vec<Placed<String>>>,
    /// Drives of other makers that have these registers and commands.
    pub(super) aliases: Option<Vec<Placed<Alias>>>,
    /// Whether it feeds a motor.
    pub(super) kind: Option<UnitKind>,
    /// A whole number from 1, counted up with each change; backups name it.
    pub(super) version: Option<Placed<u32>>,
    /// The documents it was made from.
    pub(super) source: String,
    pub(super) extends: Option<Placed<Extends>>,
    pub(super) overlay: Option<Placed<Overlay>>,
    /// Names and codes of the profile below that this drive does not have; `faults` is the whole list of them.
    #[serde(default)]
    pub(super) drop: Vec<Placed<String>>,
    pub(super) serial: Option<Serial>,
    pub(super) requests: Option<Requests>,
    pub(super) parameters: Option<Parameters>,
    pub(super) identification: Option<Identification>,
    pub(super) commands: Option<Commands>,
    pub(super) state: Option<Placed<States>>,
    pub(super) status: Option<Status>,
    pub(super) ramp: Option<Ramp>,
    /// What must be set before the drive obeys the bus, in this order.
    pub(super) control: Option<Vec<Placed<Control>>>,
    /// What can be given over the bus beside commands.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "schema::table::<Setpoint, SetpointRole>"))]
    pub(super) setpoints: BTreeMap<Setpoint, SetpointRole>,
    /// Parameters that decide what some registers mean.
    #[serde(default)]
    pub(super) variants: BTreeMap<Placed<String>, Placed<Variant>>,
    pub(super) monitor: Option<Monitor>,
    pub(super) watchdog: Option<Placed<Watchdog>>,
    /// What must be written before the drive takes any other word, of a command too.
    pub(super) unlock: Option<Placed<Unlock>>,
    pub(super) faults: Option<Faults>,
    /// Exceptions that mean something else than in the Modbus specification.
    #[serde(default)]
    pub(super) exceptions: Vec<Placed<Exception>>,
    /// The bits of a register, or of a parameter by its code.
    #[serde(default)]
    pub(super) bits: BTreeMap<Placed<String>, Vec<Placed<Field>>>,
}

/// A drive with another name.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Alias {
    /// Its maker and its name.
    pub(super) name: String,
    /// How much of the family is known of it.
    #[serde(default)]
    pub(super) note: String,
    /// Who says so: document and page, or repository and path.
    pub(super) source: String,
}

/// A sister family, of which all is taken over that is not stated.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Extends {
    /// A shipped name, or a folder relative to this one.
    pub(super) profile: Placed<String>,
    /// Why that family may be taken for this one.
    pub(super) assumption: Placed<String>,
    /// What of it this family's own documents print too: names, codes, or tables such as `commands`.
    #[serde(default)]
    pub(super) confirmed: Vec<Placed<String>>,
    /// The documents that do.
    #[serde(default)]
    pub(super) confirmed_source: String,
}

/// A profile to which something is added.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Overlay {
    /// A shipped name, or a folder relative to this one.
    pub(super) profile: Placed<String>,
}

/// The line as it leaves the factory.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Serial {
    /// Bits a second.
    pub(super) baud_rate: Placed<u32>,
    /// Data bits, parity, stop bits: `8E1`.
    pub(super) format: Placed<String>,
    /// The address, 1 to 247.
    pub(super) unit: Option<Placed<u8>>,
    /// How long the drive waits before it answers, in milliseconds.
    #[serde(default)]
    pub(super) response_delay_ms: u16,
    /// Whether a document of this very family prints it.
    pub(super) verified: bool,
    /// Where it is printed: document and page.
    pub(super) source: String,
}

/// What the drive takes as a request.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Requests {
    /// In which protocol it is asked: `"modbus"`, or `"huanyang"`.
    #[serde(default)]
    pub(super) protocol: Protocol,
    /// The function codes that it takes: `[0x03, 0x06]`.
    pub(super) functions: Vec<u8>,
    /// Most words in one request, 1 to 125.
    pub(super) max_words: Placed<u16>,
    /// Most words in one write, 1 to 123, where it takes fewer than in a read.
    pub(super) max_written: Option<Placed<u16>>,
    /// Where it is printed that one 10H request may write several parameters: document and page. Each is written by its own
    /// request where this is left out.
    pub(super) joined: Option<Placed<String>>,
    /// Whether a read may run from one parameter group into the next.
    #[serde(default = "yes")]
    pub(super) across_groups: bool,
    /// Whether a read may have one parameter and no more.
    #[serde(default)]
    pub(super) single_parameters: bool,
    /// The high bytes of addresses under which a read is answered, with 0 where there is nothing: `[0x00, 0x07]`.
    #[serde(default)]
    pub(super) zeros: Vec<u8>,
    /// A word that the drive has where it has nothing, among others of a read or alone: `0x8000`. It is no value of anything
    /// that has neither bits nor choices.
    pub(super) absent: Option<u16>,
    /// Whether a document of this very family prints it.
    #[serde(default = "yes")]
    pub(super) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(super) note: String,
    /// Where it is printed: document and page.
    pub(super) source: String,
}

/// How the code of a parameter becomes an address.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(super) enum AddressRule {
    /// The group is the high byte, the index the low byte: P05.06 is 0506H.
    #[serde(rename = "group.index")]
    GroupIndex,
    /// It does not: each row of parameters.csv says where its parameter is, whatever its code looks like.
    #[serde(rename = "listed")]
    Listed,
}

/// How the code of a parameter becomes an address, and which of them are special.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    /// How the code becomes an address.
    pub(super) address: AddressRule,
    pub(super) memory: Option<Placed<Memory>>,
    /// Groups that nobody may touch.
    pub(super) closed_groups: Option<Vec<u8>>,
    /// High bytes of addresses at which the drive may have parameters that the file has no row of, and no rule finds. One too many
    /// costs a question before a word meant for another drive; one too few may cost a parameter.
    pub(super) unlisted_groups: Option<Vec<u8>>,
    /// Codes whose write does something, such as tuning the motor.
    pub(super) acts: Option<Vec<Placed<String>>>,
    /// Codes or groups (`P14`) that set the line: a restore leaves them alone unless asked.
    pub(super) serial: Option<Vec<Placed<String>>>,
    /// Codes or groups (`P02`) that describe the motor: a restore leaves them alone unless asked.
    pub(super) motor: Option<Vec<Placed<String>>>,
    /// What a restore writes last, in this order.
    pub(super) last: Option<Vec<Placed<String>>>,
    /// Where it is printed: document and page.
    #[serde(rename = "source")]
    _source: String,
}

/// How the family says where a written parameter is kept. Without it every write may wear EEPROM.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Memory {
    /// The bit of the address, 8 to 15.
    pub(super) bit: Option<Placed<u8>>,
    /// What it means when it is set.
    pub(super) means: Option<MemoryBit>,
    /// Instead of a bit: the word that stores what was written, which stays in RAM until then.
    pub(super) store: Option<StoreWord>,
    /// Whether a document of this very family prints it.
    pub(super) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(super) note: String,
    /// Where it is printed: document and page.
    pub(super) source: String,
}

/// The word that stores all that was set.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct StoreWord {
    /// The register, or parameter, that takes it.
    pub(super) register: Placed<String>,
    /// What is written there.
    pub(super) word: u16,
    /// What stands there before, and again once all is stored. Where something else stands, nothing is stored.
    pub(super) idle: Option<u16>,
}

/// What the drive says it is.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Identification {
    /// Where it says so.
    pub(super) register: Option<Placed<String>>,
    /// What its words mean.
    #[serde(default)]
    pub(super) codes: Vec<Placed<IdentificationCode>>,
    pub(super) signature: Option<Signature>,
}

/// One code, and who says it.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct IdentificationCode {
    /// The word.
    pub(super) code: u16,
    /// The name of that family's profile, whether or not there is one.
    pub(super) family: String,
    /// The family as its maker calls it.
    pub(super) title: String,
    /// What else says the same.
    #[serde(default)]
    pub(super) shared: Vec<String>,
    /// Whether a document of this very family prints it.
    pub(super) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(super) note: String,
    /// Where it is printed: document and page.
    pub(super) source: String,
}

/// How a unit that does not say what it is can be told.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Signature {
    /// Names or addresses that it answers, read one word each. An address of another table has the table's name before
    /// it: `input 0x0000`.
    pub(super) answers: Vec<Placed<String>>,
    /// Names or addresses that it refuses.
    #[serde(default)]
    pub(super) refuses: Vec<Placed<String>>,
}

/// Registers with a role.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Status {
    /// Registers whose bits tell `ready`, `motor`, `overload_alarm` or `control_channel`.
    #[serde(default)]
    pub(super) words: Vec<Placed<String>>,
    /// The present fault.
    pub(super) fault: Option<Placed<String>>,
    /// Whether it keeps its number after a reset: then it is the present fault while the state says so.
    pub(super) fault_holds: Option<Placed<bool>>,
    /// The frequency at the output.
    pub(super) frequency: Option<Placed<String>>,
    /// The frequency setpoint in force.
    pub(super) setpoint: Option<Placed<String>>,
}

/// The ramp along which a stop slows the motor down.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Ramp {
    /// The parameter with the time that it takes from `start` to 0 Hz.
    pub(super) deceleration: Placed<String>,
    /// The parameter with the frequency that this time is counted from.
    pub(super) start: Placed<String>,
}

/// What `monitor` shows when it is not told what.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Monitor {
    /// Names of registers.
    pub(super) registers: Vec<Placed<String>>,
}

/// Where the drive keeps what happened.
#[derive(Default, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Faults {
    /// Parameters that hold the last faults, the latest first.
    #[serde(default)]
    pub(super) history: Vec<Placed<String>>,
    /// What the drive measured at the last one.
    #[serde(default)]
    pub(super) values: Vec<Placed<String>>,
}

/// An exception of this family.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Exception {
    /// Its code.
    pub(super) code: u8,
    /// One word.
    pub(super) name: String,
    /// What it means.
    pub(super) meaning: String,
    /// Whether it is a decision. Without it as the specification has the code, but 05H as `not_now`: drives that list it
    /// hardly ever acknowledge by it.
    pub(super) means: Option<Means>,
    /// Where it is printed: document and page.
    pub(super) source: String,
}

/// Some bits of a word.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Field {
    /// One word.
    pub(super) name: String,
    /// The highest and the lowest bit.
    #[serde(deserialize_with = "two")]
    pub(super) bits: [u8; 2],
    /// What they mean, by their value; without it a bit is off or on.
    pub(super) values: Option<BTreeMap<String, String>>,
    /// Whether it is known well enough to be set without `unverified=True`.
    #[serde(default = "yes")]
    pub(super) verified: bool,
}

fn yes() -> bool {
    true
}

/// Two numbers and no more: the parser of TOML lets a longer list pass for a shorter one.
fn two<'de, D: Deserializer<'de>>(list: D) -> Result<[u8; 2], D::Error> {
    let numbers = Vec::deserialize(list)?;
    <[u8; 2]>::try_from(numbers)
        .map_err(|other| D::Error::invalid_length(other.len(), &"the highest and the lowest bit"))
}

/// Reads `profile.toml`, or says all that is wrong with its shape.
pub(super) fn read(file: &File) -> Result<Manifest, Vec<ProfileError>> {
    toml::from_str(file.text()).map_err(|_| {
        let problems = shape::problems::<Manifest>(file.text());
        problems.into_iter().map(|(place, reason)| file.broken(line_at(file, place), reason)).collect()
    })
}

/// The line of `item` in `file`.
pub(super) fn line<T>(file: &File, item: &Placed<T>) -> u64 {
    line_at(file, item.span().start)
}

fn line_at(file: &File, offset: usize) -> u64 {
    line_of(file.text().as_bytes().get(..offset).unwrap_or_default())
}
