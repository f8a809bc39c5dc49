//! Variants: registers whose unit, scale and range a parameter of the drive decides.

use std::collections::BTreeMap;

use crate::profile::Profile;
use crate::profile::lookup::closest;
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
    #[error("{name} = \"{choice}\" is no choice of {profile}; the closest is \"{closest}\"")]
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

impl Profile {
    /// This profile for a drive of which is known what a parameter makes of some registers: `speed_unit` is `Hz`.
    ///
    /// # Errors
    ///
    /// [`VariantError`]: there is no such variant, or it has no such choice.
    pub fn with_variants<'a>(
        &self,
        chosen: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, VariantError> {
        let mut profile = self.clone();
        for (name, choice) in chosen {
            let variant = self.variants.get(name).ok_or_else(|| VariantError::Unknown {
                profile: self.name.clone(),
                name: name.to_owned(),
                known: match self.variants.keys().map(String::as_str).collect::<Vec<_>>().join(", ") {
                    none if none.is_empty() => "none".to_owned(),
                    known => known,
                },
            })?;
            let known = variant.choices.iter().find(|(known, _)| known.eq_ignore_ascii_case(choice.trim()));
            let Some((choice, chosen)) = known else {
                return Err(VariantError::UnknownChoice {
                    profile: self.name.clone(),
                    name: name.to_owned(),
                    choice: choice.to_owned(),
                    closest: closest(choice, variant.choices.keys().map(String::as_str)).unwrap_or_default().to_owned(),
                });
            };
            for entry in profile.entries.iter_mut().filter(|entry| entry.quantity.variant.as_deref() == Some(name)) {
                entry.quantity = Quantity { variant: Some(name.to_owned()), ..chosen.quantity.clone() };
            }
            profile.chosen.insert(name.to_owned(), choice.clone());
        }
        Ok(profile)
    }
}
