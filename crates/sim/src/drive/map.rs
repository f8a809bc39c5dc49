//! Every word of a family's drives: the registers that the family describes, and the parameters of family and profile.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drives::{Access as ProfileAccess, Entry, Kind, Profile, Quantity, Value};
use drivebus_rtu::UnitAddress;

use super::family::{Bounds, Family, Parameter, Register};
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
    family: Family,
    /// By address.
    words: Vec<(u32, Word)>,
    places: Places,
    /// Where the parameters stand among the parameters, by address.
    parameters: Arc<Places>,
    /// Where the words that the bus sets stand among each other.
    controls: Places,
    control_words: usize,
}

impl Map {
    /// The words of `family`, with the plain parameters of its `profile`.
    pub(crate) fn new(family: Family, profile: &Profile) -> Self {
        let mut words = BTreeMap::new();
        for entry in profile.entries().filter(|entry| entry.kind() == Kind::Parameter) {
            let Some((address, low)) = entry.address().zip(low_word(entry)) else { continue };
            if entry.words() == 2 {
                // The factory value of two words fills no more than the low one.
                let high = if low == address { address.wrapping_add(1) } else { address };
                let access = access_of(entry);
                words.insert(high.into(), Word::Parameter(Parameter { access, ..Parameter::shown(high) }));
            }
            words.insert(u32::from(low), Word::Parameter(parameter(&family, profile, entry, low)));
        }
        words.extend(family.parameters.iter().map(|&known| (known.address.into(), Word::Parameter(known))));
        words.extend(family.registers.iter().map(|register| (register.address, Word::Register(register.clone()))));

        let places = Places::new(words.keys().copied());
        let addresses = |wanted: fn(&Word) -> bool| -> Vec<u32> {
            words.iter().filter(|(_, word)| wanted(word)).map(|(&address, _)| address).collect()
        };
        let parameters = Arc::new(Places::new(addresses(Word::is_parameter)));
        let set = addresses(|word| !word.is_parameter() && word.access() != Access::ReadOnly);
        let (controls, control_words) = (Places::new(set.iter().copied()), set.len());
        Self { family, words: words.into_iter().collect(), places, parameters, controls, control_words }
    }

    pub(crate) fn family(&self) -> &Family {
        &self.family
    }

    /// How many words the bus sets.
    pub(crate) fn control_words(&self) -> usize {
        self.control_words
    }

    /// Where `address` stands among them.
    pub(crate) fn control(&self, address: u32) -> Option<usize> {
        self.controls.of(address)
    }

    pub(crate) fn word(&self, address: u32) -> Option<&Word> {
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
            Word::Parameter(_) if own.map(u32::from) == Some(*address) => Some(u16::from(unit.get())),
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

/// How a row of the profile is written.
fn access_of(entry: &Entry) -> Access {
    match entry.access() {
        ProfileAccess::Ro => Access::ReadOnly,
        ProfileAccess::Stop => Access::Stopped,
        _ => Access::Always,
    }
}

/// A row of the profile.
fn parameter(family: &Family, profile: &Profile, entry: &Entry, address: u16) -> Parameter {
    let low = entry.quantity().low().map(Value::count);
    let lowest = low.and_then(|low| u16::try_from(low).ok()).unwrap_or(0);
    let assumed = || family.factory.iter().find(|&&(known, _)| known == address).map(|&(_, value)| value);
    let cap = family.roles.max_frequency.filter(|_| family.capped.contains(&address)).map(|max| max.address);
    // Assumption: of two words any are in range.
    let bounds = if entry.words() == 2 { Bounds::NONE } else { bounds(profile, entry.quantity()) };
    Parameter {
        address,
        access: access_of(entry),
        bounds: Bounds { high_from: bounds.high_from.or(cap), ..bounds },
        factory: entry.default_raw().or_else(assumed).unwrap_or(lowest),
    }
}

/// The range of a quantity of the profile.
pub(crate) fn bounds(profile: &Profile, quantity: &Quantity) -> Bounds {
    // Counts are compared with counts: a parameter in others says nothing.
    let same = |entry: &&Entry| entry.quantity().ratio() == quantity.ratio();
    let address_of = |code: &str| profile.find(code).ok().filter(same).and_then(Entry::address);
    Bounds {
        low: quantity.low().map(Value::count),
        high: quantity.high().map(Value::count),
        low_from: quantity.low_from().and_then(address_of),
        high_from: quantity.high_from().and_then(address_of),
        signed: quantity.is_signed(),
    }
}

/// Where the low word of `entry` is, or its only one.
pub(crate) fn low_word(entry: &Entry) -> Option<u16> {
    let behind = entry.words() == 2 && entry.quantity().is_high_first();
    entry.address().map(|address| address.wrapping_add(u16::from(behind)))
}
