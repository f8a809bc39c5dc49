//! Parameters in two memories: EEPROM, which outlives the power, and RAM, which the drive works with.

use std::collections::BTreeMap;

/// One parameter in both memories.
#[derive(Debug)]
struct Cell {
    eeprom: u16,
    ram: u16,
    writes: u64,
}

/// All parameters of one drive, by address.
///
/// Assumption: each word written to a plain address wears the EEPROM, also where it changes nothing. What the drive
/// keeps by itself (its fault history) is not counted.
#[derive(Debug, Default)]
pub(crate) struct Store {
    cells: BTreeMap<u16, Cell>,
}

impl Store {
    /// A store with factory values.
    pub(crate) fn new(factory: impl IntoIterator<Item = (u16, u16)>) -> Self {
        let cells =
            factory.into_iter().map(|(address, word)| (address, Cell { eeprom: word, ram: word, writes: 0 })).collect();
        Self { cells }
    }

    /// The value in force; `None` where there is no such parameter.
    pub(crate) fn get(&self, address: u16) -> Option<u16> {
        self.cells.get(&address).map(|cell| cell.ram)
    }

    /// As a plain address does: both memories.
    pub(crate) fn write_eeprom(&mut self, address: u16, word: u16) {
        if let Some(cell) = self.cells.get_mut(&address) {
            *cell = Cell { eeprom: word, ram: word, writes: cell.writes + 1 };
        }
    }

    /// As an address with the top bit does: lost with the power.
    pub(crate) fn write_ram(&mut self, address: u16, word: u16) {
        if let Some(cell) = self.cells.get_mut(&address) {
            cell.ram = word;
        }
    }

    /// The drive itself keeps `word` for good.
    pub(crate) fn keep(&mut self, address: u16, word: u16) {
        if let Some(cell) = self.cells.get_mut(&address) {
            cell.eeprom = word;
            cell.ram = word;
        }
    }

    /// Power off and on: what was only in RAM is lost.
    pub(crate) fn power_cycle(&mut self) {
        for cell in self.cells.values_mut() {
            cell.ram = cell.eeprom;
        }
    }

    /// Words written to the EEPROM from the bus.
    pub(crate) fn eeprom_writes(&self) -> u64 {
        self.cells.values().map(|cell| cell.writes).sum()
    }

    /// Words written to one EEPROM address from the bus.
    pub(crate) fn eeprom_writes_of(&self, address: u16) -> u64 {
        self.cells.get(&address).map_or(0, |cell| cell.writes)
    }
}
