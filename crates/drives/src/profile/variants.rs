//! A profile for a drive of which is known what a parameter makes of some registers.

use crate::parts::variant::{Share, Variant, VariantError};
use crate::profile::Profile;
use crate::quantity::Quantity;
use crate::text::closest;

impl Profile {
    /// This profile for a drive of which is known what a parameter makes of some registers: `speed_unit` is `Hz`, or
    /// `base_frequency` is `87 Hz`.
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
            let (choice, quantity) = self.chosen_of(name, variant, choice)?;
            for entry in profile.entries.iter_mut().filter(|entry| entry.quantity.variant.as_deref() == Some(name)) {
                entry.quantity = Quantity { variant: Some(name.to_owned()), ..quantity.clone() };
            }
            profile.chosen.insert(name.to_owned(), choice);
        }
        Ok(profile)
    }

    /// What is chosen of `variant` where its parameter has this `value`, which is of one or two words; `None` where that means
    /// nothing known, or there is no such variant.
    pub fn choice_of(&self, variant: &str, value: u32) -> Option<String> {
        let rule = self.variants.get(variant)?;
        if let Some(share) = &rule.share {
            let parameter = self.find(&rule.parameter).ok()?.quantity();
            return share.quantity(parameter, value).map(|_| Share::named(parameter, value));
        }
        let told = rule.choices.iter().find(|(_, choice)| u32::from(choice.word) == value);
        told.map(|(name, _)| name.clone())
    }

    /// The least and the most that the parameter of `variant` may be, as [`with_variants`](Self::with_variants) takes it:
    /// `1 Hz` and `599 Hz`. `None` where it is no [share](Variant::share).
    pub fn share_between(&self, variant: &Variant) -> Option<(String, String)> {
        let share = variant.share.as_ref()?;
        let parameter = self.find(&variant.parameter).ok()?.quantity();
        Some((Share::named(parameter, share.low), Share::named(parameter, share.high)))
    }

    /// `choice` of `variant`, which is called `name`, as it is written, and what the registers then are.
    fn chosen_of(&self, name: &str, variant: &Variant, choice: &str) -> Result<(String, Quantity), VariantError> {
        let unknown = |closest: &str| VariantError::UnknownChoice {
            profile: self.name.clone(),
            name: name.to_owned(),
            choice: choice.to_owned(),
            closest: closest.to_owned(),
        };
        let Some(share) = &variant.share else {
            let known = variant.choices.iter().find(|(known, _)| known.eq_ignore_ascii_case(choice.trim()));
            return known.map(|(known, chosen)| (known.clone(), chosen.quantity.clone())).ok_or_else(|| {
                unknown(closest(choice, variant.choices.keys().map(String::as_str)).unwrap_or_default())
            });
        };
        // The loader found it.
        let parameter = self.find(&variant.parameter).map_err(|_| unknown(&variant.parameter))?.quantity();
        let whole = share.read(parameter, choice);
        whole.and_then(|whole| Some((Share::named(parameter, whole), share.quantity(parameter, whole)?))).ok_or_else(
            || VariantError::NoWhole {
                profile: self.name.clone(),
                name: name.to_owned(),
                choice: choice.to_owned(),
                low: Share::named(parameter, share.low),
                high: Share::named(parameter, share.high),
            },
        )
    }
}
