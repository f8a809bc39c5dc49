//! The shape of `profile.toml`: what may stand in it, and of which type. What it refers to is `assemble`'s to check.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::{File, ProfileError, line_of, shape};
use crate::command::Command;
use crate::memory::MemoryBit;
use crate::rules::UnitKind;
use crate::setpoint::Setpoint;
use crate::state::State;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) name: Spanned<String>,
    pub(super) title: Option<String>,
    pub(super) kind: Option<UnitKind>,
    pub(super) version: Option<Spanned<u32>>,
    pub(super) source: String,
    pub(super) extends: Option<Spanned<Extends>>,
    pub(super) overlay: Option<Spanned<Overlay>>,
    #[serde(default)]
    pub(super) drop: Vec<Spanned<String>>,
    pub(super) serial: Option<Serial>,
    pub(super) requests: Option<Requests>,
    pub(super) parameters: Option<Parameters>,
    pub(super) identification: Option<Identification>,
    pub(super) commands: Option<Commands>,
    pub(super) state: Option<Spanned<States>>,
    pub(super) status: Option<Status>,
    pub(super) control: Option<Vec<Spanned<Control>>>,
    #[serde(default)]
    pub(super) setpoints: BTreeMap<Setpoint, SetpointRole>,
    #[serde(default)]
    pub(super) variants: BTreeMap<Spanned<String>, Spanned<Variant>>,
    pub(super) monitor: Option<Monitor>,
    pub(super) watchdog: Option<Spanned<Watchdog>>,
    pub(super) faults: Option<Faults>,
    #[serde(default)]
    pub(super) exceptions: Vec<Spanned<Exception>>,
    #[serde(default)]
    pub(super) bits: BTreeMap<Spanned<String>, Vec<Spanned<Field>>>,
}

/// A sister family, of which all is taken over that is not stated.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Extends {
    pub(super) profile: Spanned<String>,
    pub(super) assumption: Spanned<String>,
    #[serde(default)]
    pub(super) confirmed: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) confirmed_source: String,
}

/// A profile to which something is added.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Overlay {
    pub(super) profile: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Serial {
    pub(super) baud_rate: Spanned<u32>,
    pub(super) format: Spanned<String>,
    pub(super) unit: Option<Spanned<u8>>,
    #[serde(default)]
    pub(super) response_delay_ms: u16,
    pub(super) verified: bool,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Requests {
    pub(super) functions: Vec<u8>,
    pub(super) max_words: Spanned<u16>,
    #[serde(default = "yes")]
    pub(super) across_groups: bool,
    #[serde(default = "yes")]
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

/// How the code of a parameter becomes an address.
#[derive(Deserialize)]
enum AddressRule {
    /// The group is the high byte, the index the low byte: P05.06 is 0506H.
    #[serde(rename = "group.index")]
    GroupIndex,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    /// There is one rule so far; a family that needs another says so by its name.
    #[serde(rename = "address")]
    _address: AddressRule,
    pub(super) memory: Option<Spanned<Memory>>,
    pub(super) closed_groups: Option<Vec<u8>>,
    pub(super) acts: Option<Vec<Spanned<String>>>,
    pub(super) serial: Option<Vec<Spanned<String>>>,
    pub(super) motor: Option<Vec<Spanned<String>>>,
    pub(super) last: Option<Vec<Spanned<String>>>,
    #[serde(rename = "source")]
    _source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Memory {
    pub(super) bit: Spanned<u8>,
    pub(super) means: MemoryBit,
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Identification {
    pub(super) register: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) codes: Vec<Spanned<IdentificationCode>>,
    pub(super) signature: Option<Signature>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct IdentificationCode {
    pub(super) code: u16,
    pub(super) family: String,
    pub(super) title: String,
    #[serde(default)]
    pub(super) shared: Vec<String>,
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Signature {
    pub(super) answers: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) refuses: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Commands {
    pub(super) register: Spanned<String>,
    pub(super) moves: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) codes: BTreeMap<Command, Spanned<u16>>,
    pub(super) assumed: Option<AssumedCommands>,
    /// TOML keys are text; `assemble` reads them as numbers.
    #[serde(default)]
    pub(super) other: BTreeMap<Spanned<String>, String>,
    #[serde(rename = "source")]
    _source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AssumedCommands {
    pub(super) reason: Spanned<String>,
    pub(super) codes: BTreeMap<Command, Spanned<u16>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct States {
    pub(super) register: Spanned<String>,
    #[serde(default)]
    pub(super) codes: BTreeMap<State, Spanned<u16>>,
    #[serde(default)]
    pub(super) when: Vec<Spanned<When>>,
    #[serde(default = "yes")]
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

/// A state that is told by bit fields.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct When {
    #[serde(rename = "is")]
    pub(super) state: State,
    pub(super) fields: BTreeMap<String, u16>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Status {
    #[serde(default)]
    pub(super) words: Vec<Spanned<String>>,
    pub(super) fault: Option<Spanned<String>>,
    pub(super) frequency: Option<Spanned<String>>,
    pub(super) setpoint: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Control {
    pub(super) code: String,
    pub(super) value: i64,
    pub(super) label: String,
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetpointRole {
    pub(super) register: Spanned<String>,
    #[serde(default)]
    pub(super) needs: Vec<Spanned<Control>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Variant {
    pub(super) parameter: Spanned<String>,
    pub(super) choices: BTreeMap<String, Spanned<VariantChoice>>,
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VariantChoice {
    pub(super) value: u16,
    #[serde(default)]
    pub(super) unit: String,
    pub(super) scale: u32,
    #[serde(default)]
    pub(super) signed: bool,
    pub(super) low: Option<f64>,
    pub(super) high: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Monitor {
    pub(super) registers: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Watchdog {
    pub(super) timeout: Spanned<String>,
    pub(super) action: Spanned<String>,
    pub(super) coast: Option<Spanned<i64>>,
    pub(super) stop: Option<Spanned<i64>>,
    pub(super) verified: bool,
    #[serde(default)]
    pub(super) note: String,
    pub(super) source: String,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Faults {
    #[serde(default)]
    pub(super) history: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) values: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Exception {
    pub(super) code: u8,
    pub(super) name: String,
    pub(super) meaning: String,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Field {
    pub(super) name: String,
    /// The highest and the lowest bit.
    pub(super) bits: [u8; 2],
    /// TOML keys are text; `assemble` reads them as numbers.
    pub(super) values: Option<BTreeMap<String, String>>,
    #[serde(default = "yes")]
    pub(super) verified: bool,
}

fn yes() -> bool {
    true
}

/// Reads `profile.toml`, or says all that is wrong with its shape.
pub(super) fn read(file: &File) -> Result<Manifest, Vec<ProfileError>> {
    toml::from_str(file.text()).map_err(|_| {
        let problems = shape::problems::<Manifest>(file.text());
        problems.into_iter().map(|(place, reason)| file.broken(line_at(file, place), reason)).collect()
    })
}

/// The line of `item` in `file`.
pub(super) fn line<T>(file: &File, item: &Spanned<T>) -> u64 {
    line_at(file, item.span().start)
}

fn line_at(file: &File, offset: usize) -> u64 {
    line_of(file.text().as_bytes().get(..offset).unwrap_or_default())
}
