//! Variants: registers whose unit, scale and range a parameter of the drive decides.

use std::collections::BTreeMap;

use crate::quantity::Quantity;

/// A parameter that decides what some registers mean.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Variant {
    /// The parameter's code.
    pub parameter: String,
    /// What the registers may be, by name.
    pub choices: BTreeMap<String, VariantChoice>,
    /// Whether a document of this family prints the words of the parameter.
    pub verified: bool,
    /// What to know about it; says what is assumed where it is not verified.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

/// One thing that the registers may mean.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct VariantChoice {
    /// The word of the parameter that says so.
    pub word: u16,
    /// What the registers then are.
    pub quantity: Quantity,
}

/// Why a choice cannot be taken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VariantError {
    /// The family has no variant of this name.
    #[error("{profile} has no variant \"{name}\"; it has {known}")]
    Unknown {
        /// The profile that was asked.
        profile: String,
        /// The name as given.
        name: String,
        /// Those that it has.
        known: String,
    },
    /// The variant has no choice of this name.
    #[error("{name} = \"{choice}\" is not a choice of {profile}; the closest is \"{closest}\"")]
    UnknownChoice {
        /// The profile that was asked.
        profile: String,
        /// The variant.
        name: String,
        /// The choice as given.
        choice: String,
        /// The choice closest to it.
        closest: String,
    },
}
