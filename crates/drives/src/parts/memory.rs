//! Memory: which address of a parameter reaches EEPROM, and which only RAM. Families have opposite rules.

/// What the memory bit of a parameter's address means when it is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum MemoryBit {
    /// The write goes to RAM only; without the bit it is kept in EEPROM.
    Ram,
    /// The write is kept in EEPROM; without the bit it goes to RAM only.
    Eeprom,
}

/// How a family says where a written parameter is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Memory {
    /// The bit of the address, 8..=15.
    pub bit: u8,
    /// What it means.
    pub means: MemoryBit,
    /// Whether a document of this family prints it.
    pub verified: bool,
    /// What to know about it; says what is assumed where it is not verified.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

impl Memory {
    /// The bit as a mask.
    pub const fn mask(&self) -> u16 {
        1 << self.bit
    }
}
