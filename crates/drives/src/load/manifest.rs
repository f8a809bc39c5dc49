//! The shape of `profile.toml`: what may stand in it, and of which type. What it refers to is `assemble`'s to check.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::{File, ProfileError, line_of};
use crate::command::Command;
use crate::state::State;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) name: Spanned<String>,
    pub(super) title: String,
    pub(super) source: String,
    pub(super) serial: Serial,
    pub(super) requests: Requests,
    pub(super) parameters: Parameters,
    pub(super) identification: Identification,
    pub(super) commands: Commands,
    pub(super) state: States,
    #[serde(default)]
    pub(super) control: Vec<Spanned<Control>>,
    pub(super) monitor: Monitor,
    pub(super) watchdog: Option<Spanned<Watchdog>>,
    #[serde(default)]
    pub(super) faults: Faults,
    #[serde(default)]
    pub(super) exceptions: Vec<Spanned<Exception>>,
    #[serde(default)]
    pub(super) bits: BTreeMap<Spanned<String>, Vec<Spanned<Field>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Serial {
    pub(super) baud_rate: Spanned<u32>,
    pub(super) format: Spanned<String>,
    pub(super) unit: Spanned<u8>,
    pub(super) response_delay_ms: u16,
    pub(super) verified: bool,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Requests {
    pub(super) functions: Vec<u8>,
    pub(super) max_words: Spanned<u16>,
    #[serde(rename = "source")]
    _source: String,
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
    pub(super) ram_bit: Spanned<u8>,
    #[serde(default)]
    pub(super) closed_groups: Vec<u8>,
    #[serde(default)]
    pub(super) acts: Vec<Spanned<String>>,
    #[serde(rename = "source")]
    _source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Identification {
    pub(super) register: Spanned<String>,
    #[serde(default)]
    pub(super) codes: Vec<Spanned<IdentificationCode>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct IdentificationCode {
    pub(super) code: u16,
    pub(super) family: String,
    pub(super) title: String,
    pub(super) verified: bool,
    pub(super) source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Commands {
    pub(super) register: Spanned<String>,
    pub(super) moves: Vec<Spanned<String>>,
    pub(super) codes: BTreeMap<Command, Spanned<u16>>,
    #[serde(rename = "source")]
    _source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct States {
    pub(super) register: Spanned<String>,
    pub(super) codes: BTreeMap<State, Spanned<u16>>,
    #[serde(rename = "source")]
    _source: String,
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
    pub(super) source: String,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Faults {
    pub(super) history: Vec<Spanned<String>>,
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

/// Reads `profile.toml`.
pub(super) fn read(file: &File) -> Result<Manifest, ProfileError> {
    toml::from_str(file.text()).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        file.broken(line_at(file, start), error.message())
    })
}

/// The line of `item` in `file`.
pub(super) fn line<T>(file: &File, item: &Spanned<T>) -> u64 {
    line_at(file, item.span().start)
}

fn line_at(file: &File, offset: usize) -> u64 {
    line_of(file.text().as_bytes().get(..offset).unwrap_or_default())
}
