//! Variants: registers whose unit, scale and range a parameter of the drive decides.

use std::collections::BTreeMap;

use crate::decimal::{Counts, Decimal};
use crate::quantity::{Quantity, limits};
use crate::scale::Scale;

/// A parameter that decides what some registers mean.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Variant {
    /// The parameter's code.
    pub parameter: String,
    /// What the registers may be, by name; none where they are a [share](Self::share).
    pub choices: BTreeMap<String, VariantChoice>,
    /// What they are whatever the parameter is, where that is the whole of which they count a share.
    pub share: Option<Share>,
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

/// A share of what a parameter says: so many counts are as much as that.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Share {
    /// The counts of the whole.
    pub counts: u16,
    /// Whether words are two's complement. A value below zero is not among what is given.
    pub signed: bool,
    /// The least that the parameter may say, in its own counts.
    pub low: u32,
    /// The most that it may say.
    pub high: u32,
}

impl Share {
    /// What the registers are where the parameter, which is a `parameter`, is `whole`.
    pub(crate) fn quantity(&self, parameter: &Quantity, whole: u32) -> Option<Quantity> {
        if !(self.low..=self.high).contains(&whole) {
            return None;
        }
        let scale = Scale::of_share(self.counts, whole, parameter.scale?)?;
        Some(Quantity {
            unit: parameter.unit.clone(),
            scale: Some(scale),
            signed: self.signed,
            wide: false,
            high_first: false,
            low: Some(0),
            high: Some(self.counts.into()),
            low_from: None,
            high_from: None,
            choices: BTreeMap::new(),
            variant: None,
        })
    }

    /// What the parameter is, as people write it: `50 Hz`.
    pub(crate) fn named(parameter: &Quantity, whole: u32) -> String {
        let value = parameter.value(whole.into()).to_string();
        let value = if value.contains('.') { value.trim_end_matches('0').trim_end_matches('.') } else { &value };
        format!("{value} {}", parameter.unit)
    }

    /// What the parameter is, in counts, where people say `text`: `50 Hz`, or `50`.
    pub(crate) fn read(&self, parameter: &Quantity, text: &str) -> Option<u32> {
        let text = text.trim().to_ascii_lowercase();
        let number = text.strip_suffix(&parameter.unit.to_ascii_lowercase()).unwrap_or(&text);
        match parameter.counts_of(&Decimal::parse(number.trim())?) {
            Counts::Whole(count) => u32::try_from(count).ok().filter(|count| (self.low..=self.high).contains(count)),
            _ => None,
        }
    }

    /// The bounds of the parameter, of which `low` and `high` say the values, or what is wrong with them.
    pub(crate) fn bounds(parameter: &Quantity, low: f64, high: f64) -> Result<(u32, u32), String> {
        let (_, most) = limits(false, parameter.wide);
        let count = |value: f64| match Decimal::of_float(value).map(|number| parameter.counts_of(&number)) {
            Some(Counts::Whole(count)) if (1..=most).contains(&count) => {
                u32::try_from(count).map_err(|_| format!("{value} is more than two words hold"))
            }
            _ => Err(format!("{value} is not what the parameter can be; it must be above 0, in its own steps")),
        };
        let (low, high) = (count(low)?, count(high)?);
        if low > high { Err("low is above high".to_owned()) } else { Ok((low, high)) }
    }
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
    /// The parameter that the registers are a share of cannot be this.
    #[error("{name} = \"{choice}\" is not what {profile} may be set to: {low} to {high}, in its own steps")]
    NoWhole {
        /// The profile that was asked.
        profile: String,
        /// The variant.
        name: String,
        /// The choice as given.
        choice: String,
        /// The least that it may be.
        low: String,
        /// The most that it may be.
        high: String,
    },
}
