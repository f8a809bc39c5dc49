//! A profile for a drive of which is known what a parameter makes of some registers.

use crate::parts::variant::VariantError;
use crate::profile::Profile;
use crate::quantity::Quantity;
use crate::text::closest;

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
