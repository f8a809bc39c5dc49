//! Memory: what of a parameter reaches EEPROM, and what only RAM. Families have opposite rules.

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
    /// By what it says so.
    pub told_by: ToldBy,
    /// Whether a document of this family prints it.
    pub verified: bool,
    /// What to know about it; says what is assumed where it is not verified.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

/// What decides where a written parameter is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ToldBy {
    /// A bit of its address.
    Bit {
        /// Which one, 8..=15.
        bit: u8,
        /// What it means.
        means: MemoryBit,
    },
    /// A word written after it. Without that, it stays in RAM.
    Word(StoreWord),
}

/// The word that stores all that was set, also what somebody else had set in RAM.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct StoreWord {
    /// The name of the register that takes it.
    pub register: String,
    /// What is written there.
    pub word: u16,
    /// What stands there before, and again once all is stored; `None` where that does not tell. Where something else stands
    /// there, the word would undo it.
    pub idle: Option<u16>,
}

impl Memory {
    /// The bit of a parameter's address that decides, as a mask; 0 where none does.
    pub const fn mask(&self) -> u16 {
        match self.told_by {
            ToldBy::Bit { bit, .. } => 1 << bit,
            ToldBy::Word(_) => 0,
        }
    }

    /// Whether a write to an address that has the bit set, or has not, is kept in EEPROM by itself.
    pub fn keeps(&self, is_set: bool) -> bool {
        match self.told_by {
            ToldBy::Bit { means, .. } => is_set == (means == MemoryBit::Eeprom),
            ToldBy::Word(_) => false,
        }
    }

    /// The word that stores what was written, where the family has one.
    pub const fn store_word(&self) -> Option<&StoreWord> {
        match &self.told_by {
            ToldBy::Bit { .. } => None,
            ToldBy::Word(word) => Some(word),
        }
    }
}
