//! Parameters in two memories: EEPROM, which outlives the power, and RAM, which the drive works with.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::places::Places;

/// All parameters of one drive, by address.
///
/// Assumption: each word written to the EEPROM wears it, also where it changes nothing. What the drive keeps by itself
/// (its fault history) is not counted.
#[derive(Debug)]
pub(crate) struct Store {
    /// Where a parameter stands in the lists; all drives of a family share it.
    places: Arc<Places>,
    ram: Vec<u16>,
    eeprom: Vec<u16>,
    /// Words written to the EEPROM from the bus, by address.
    writes: BTreeMap<u16, u64>,
}

impl Store {
    /// A store with factory values, in the order of `places`.
    pub(crate) fn new(places: Arc<Places>, factory: impl IntoIterator<Item = u16>) -> Self {
        let ram: Vec<u16> = factory.into_iter().collect();
        Self { places, eeprom: ram.clone(), ram, writes: BTreeMap::new() }
    }

    /// The value in force; `None` where there is no such parameter.
    pub(crate) fn get(&self, address: u16) -> Option<u16> {
        self.places.of(address.into()).and_then(|place| self.ram.get(place)).copied()
    }

    /// From the bus, for good: both memories.
    pub(crate) fn write_eeprom(&mut self, address: u16, word: u16) {
        if self.places.of(address.into()).is_some() {
            self.keep(address, word);
            *self.writes.entry(address).or_default() += 1;
        }
    }

    /// To RAM only: lost with the power.
    pub(crate) fn write_ram(&mut self, address: u16, word: u16) {
        if let Some(cell) = self.places.of(address.into()).and_then(|place| self.ram.get_mut(place)) {
            *cell = word;
        }
    }

    /// From the bus: all that RAM has is kept for good.
    ///
    /// Assumption: what EEPROM has already is not written again.
    pub(crate) fn keep_all(&mut self) {
        let places = Arc::clone(&self.places);
        for (address, place) in (0..=u16::MAX).filter_map(|address| Some((address, places.of(address.into())?))) {
            if let Some(word) = self.ram.get(place).copied().filter(|word| self.eeprom.get(place) != Some(word)) {
                self.write_eeprom(address, word);
            }
        }
    }

    /// The drive itself keeps `word` for good.
    pub(crate) fn keep(&mut self, address: u16, word: u16) {
        self.write_ram(address, word);
        if let Some(cell) = self.places.of(address.into()).and_then(|place| self.eeprom.get_mut(place)) {
            *cell = word;
        }
    }

    /// The drive itself takes factory values, in the order of the places.
    pub(crate) fn reset(&mut self, factory: impl IntoIterator<Item = u16>) {
        self.ram.clear();
        self.ram.extend(factory);
        self.eeprom.copy_from_slice(&self.ram);
    }

    /// Power off and on: what was only in RAM is lost.
    pub(crate) fn power_cycle(&mut self) {
        self.ram.copy_from_slice(&self.eeprom);
    }

    /// Words written to the EEPROM from the bus.
    pub(crate) fn eeprom_writes(&self) -> u64 {
        self.writes.values().sum()
    }

    /// Words written to the EEPROM of one parameter from the bus.
    pub(crate) fn eeprom_writes_of(&self, address: u16) -> u64 {
        self.writes.get(&address).copied().unwrap_or(0)
    }
}
