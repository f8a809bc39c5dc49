//! Bit fields: what single bits or groups of bits in a word mean.

use std::borrow::Cow;
use std::collections::BTreeMap;

/// Some neighbouring bits of a word, with a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BitField {
    pub(crate) name: String,
    pub(crate) low: u8,
    pub(crate) width: u8,
    pub(crate) values: BTreeMap<u16, String>,
    pub(crate) verified: bool,
}

impl BitField {
    /// Its name, unique within the word.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its lowest bit, 0..=15.
    pub fn low(&self) -> u8 {
        self.low
    }

    /// How many bits it has, 1..=16.
    pub fn width(&self) -> u8 {
        self.width
    }

    /// The bits that are its own.
    pub fn mask(&self) -> u16 {
        (u16::MAX >> (16 - self.width)) << self.low
    }

    /// What its values mean.
    pub fn values(&self) -> &BTreeMap<u16, String> {
        &self.values
    }

    /// Whether a document of this family prints it so; else it is inferred.
    pub fn verified(&self) -> bool {
        self.verified
    }

    /// Its value within `word`.
    pub fn extract(&self, word: u16) -> u16 {
        (word & self.mask()) >> self.low
    }

    /// What its value within `word` means; the number itself where that is not documented.
    pub fn meaning(&self, word: u16) -> Cow<'_, str> {
        let value = self.extract(word);
        self.values.get(&value).map_or_else(|| Cow::Owned(value.to_string()), |label| Cow::Borrowed(label.as_str()))
    }

    /// `word` with this field set to `value`, whose surplus bits are dropped.
    #[must_use]
    pub fn insert(&self, word: u16, value: u16) -> u16 {
        (word & !self.mask()) | ((value << self.low) & self.mask())
    }
}
