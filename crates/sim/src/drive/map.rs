//! Every word of a family's drives: the registers that the family describes, and the parameters of family and profile.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drives::{Access as ProfileAccess, Entry, Kind, Profile, ProfileError, Value};
use drivebus_rtu::UnitAddress;

use super::family::{Family, Parameter, Register};
use super::places::Places;

/// When a word may be read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    Always,
    /// Written at standstill only.
    Stopped,
    ReadOnly,
    WriteOnly,
}

/// One word.
#[derive(Debug)]
pub(crate) enum Word {
    Register(Register),
    Parameter(Parameter),
}

/// Every word of one family's drives. Shared by the drives of a family.
#[derive(Debug)]
pub(crate) struct Map {
    family: &'static Family,
    /// By address.
    words: Vec<(u16, Word)>,
    places: Places,
    /// Where the parameters stand among the parameters, by address.
    parameters: Arc<Places>,
}

impl Map {
    /// The words of `family`, with the plain parameters of its profile.
    pub(crate) fn new(family: &'static Family) -> Result<Self, ProfileError> {
        let profile = Profile::builtin(family.name)?;
        let mut words = BTreeMap::new();
        for entry in profile.entries().filter(|entry| entry.kind() == Kind::Parameter) {
            if let Some(address) = entry.address() {
                words.insert(address, Word::Parameter(parameter(family, &profile, entry, address)));
            }
        }
        words.extend(family.parameters.iter().map(|&known| (known.address, Word::Parameter(known))));
        let registers = family.registers.iter().copied().flatten();
        words.extend(registers.map(|&register| (register.address, Word::Register(register))));

        let places = Places::new(words.keys().copied());
        let of_parameters = words.iter().filter(|(_, word)| matches!(word, Word::Parameter(_)));
        let parameters = Arc::new(Places::new(of_parameters.map(|(&address, _)| address)));
        Ok(Self { family, words: words.into_iter().collect(), places, parameters })
    }

    pub(crate) fn family(&self) -> &'static Family {
        self.family
    }

    pub(crate) fn word(&self, address: u16) -> Option<&Word> {
        self.places.of(address).and_then(|place| self.words.get(place)).map(|(_, word)| word)
    }

    /// Where each parameter stands in [`factory`](Self::factory).
    pub(crate) fn parameters(&self) -> Arc<Places> {
        Arc::clone(&self.parameters)
    }

    /// The factory value of every parameter, in a drive with the address `unit`.
    pub(crate) fn factory(&self, unit: UnitAddress) -> impl Iterator<Item = u16> {
        let own = self.family.roles.unit_address;
        self.words.iter().filter_map(move |(address, word)| match word {
            Word::Register(_) => None,
            Word::Parameter(_) if own == Some(*address) => Some(u16::from(unit.get())),
            Word::Parameter(parameter) => Some(parameter.factory),
        })
    }
}

impl Word {
    /// Whether it is a parameter: in RAM and EEPROM, and at two addresses where bit 15 tells them apart.
    pub(crate) fn is_parameter(&self) -> bool {
        matches!(self, Self::Parameter(_))
    }

    pub(crate) fn access(&self) -> Access {
        match self {
            Self::Register(register) => register.access,
            Self::Parameter(parameter) => parameter.access,
        }
    }
}

impl Parameter {
    /// Whether `raw` is in range; `value_of` tells the parameters that the range depends on.
    pub(crate) fn allows(&self, raw: u16, value_of: impl Fn(u16) -> u16) -> bool {
        let count = |raw: u16| if self.signed { i64::from(raw.cast_signed()) } else { i64::from(raw) };
        let value = count(raw);
        let bound = |address: Option<u16>| address.map(|address| count(value_of(address)));
        let above = [self.low, bound(self.low_from)].into_iter().flatten().all(|low| low <= value);
        let below = [self.high, bound(self.high_from)].into_iter().flatten().all(|high| value <= high);
        above && below
    }
}

/// A row of the profile.
fn parameter(family: &Family, profile: &Profile, entry: &Entry, address: u16) -> Parameter {
    let quantity = entry.quantity();
    let address_of = |code: &str| profile.find(code).ok().and_then(Entry::address);
    let low = quantity.low().map(Value::count);
    let lowest = low.and_then(|low| u16::try_from(low).ok()).unwrap_or(0);
    let assumed = || family.factory.iter().find(|&&(known, _)| known == address).map(|&(_, value)| value);
    let cap = if family.capped.contains(&address) { family.roles.max_frequency } else { None };
    Parameter {
        address,
        access: match entry.access() {
            ProfileAccess::Ro => Access::ReadOnly,
            ProfileAccess::Stop => Access::Stopped,
            _ => Access::Always,
        },
        low,
        high: quantity.high().map(Value::count),
        low_from: quantity.low_from().and_then(address_of),
        high_from: quantity.high_from().and_then(address_of).or(cap),
        signed: quantity.is_signed(),
        factory: entry.default_raw().or_else(assumed).unwrap_or(lowest),
    }
}
