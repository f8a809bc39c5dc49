//! What a parameter of the drive decides of the meaning of its words, and asking the drive how it is set.

use std::sync::Arc;

use drivebus_drives::{Entry, Profile, Variant};
use thiserror::Error;

use crate::task::{LineError, Mailbox, Read};
use crate::unit::Unit;

/// Why nobody knows what the words of a unit mean. Nothing was changed. `E` is the error of whoever drives.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NotSettled<E> {
    /// What the parameter says of this variant may not be used.
    #[error("what decides its {variant} may not be used: {why}")]
    Unproved {
        /// Which variant.
        variant: String,
        /// And why not.
        why: String,
    },
    /// The parameter that decides this variant may not be read.
    #[error("what decides its {variant} may not be read: {why}")]
    Unreadable {
        /// Which variant.
        variant: String,
        /// And why not.
        why: String,
    },
    /// The parameter has a value that means nothing known.
    #[error("{parameter} is {raw}, which means nothing known of its {variant}")]
    Unknown {
        /// Which variant.
        variant: String,
        /// The parameter that decides it.
        parameter: String,
        /// What it is.
        raw: u32,
    },
    /// The line failed, or the unit refused.
    #[error("{0}")]
    Failed(E),
}

impl Unit {
    /// The same call, with everything fixed on which the meaning of `names` depends. Names that the profile does not know
    /// depend on nothing.
    ///
    /// # Errors
    ///
    /// [`NotSettled`].
    pub async fn settled<E: LineError>(&self, line: &Mailbox<E>, names: &[&str]) -> Result<Self, NotSettled<E>> {
        let profile = self.profile();
        let mut chosen: Vec<(String, String)> = Vec::new();
        for variant in names.iter().filter_map(|name| open_variant(profile, name)) {
            if chosen.iter().any(|(known, _)| *known == variant) {
                continue;
            }
            let choice = self.chosen(line, &variant, &profile.variants()[&variant]).await?;
            chosen.push((variant, choice));
        }
        if chosen.is_empty() {
            return Ok(self.clone());
        }
        let chosen = chosen.iter().map(|(variant, choice)| (variant.as_str(), choice.as_str()));
        // They are choices of its own.
        let known = profile.with_variants(chosen).map_or_else(|_| Arc::clone(profile), Arc::new);
        Ok(self.with_profile(&known))
    }

    /// What the drive's own parameter says of `variant`, which is as `rule` has it.
    async fn chosen<E: LineError>(
        &self,
        line: &Mailbox<E>,
        variant: &str,
        rule: &Variant,
    ) -> Result<String, NotSettled<E>> {
        let profile = self.profile();
        let unreadable = |why: String| NotSettled::Unreadable { variant: variant.to_owned(), why };
        if let Err(why) = self.rule().variant(rule) {
            return Err(NotSettled::Unproved { variant: variant.to_owned(), why: why.to_string() });
        }
        let entry = profile.find(&rule.parameter).map_err(|why| unreadable(why.to_string()))?;
        self.rule().read(entry).map_err(|why| unreadable(why.to_string()))?;
        let place = profile.read_address(entry).map_err(|why| unreadable(why.to_string()))?;
        let read = Read::words(self.address(), place, entry.words());
        let words = line.taken_for(self.address(), self.family()).read(read).await.map_err(NotSettled::Failed)?;
        let raw = number(entry, &words);
        profile.choice_of(variant, raw).ok_or_else(|| NotSettled::Unknown {
            variant: variant.to_owned(),
            parameter: rule.parameter.clone(),
            raw,
        })
    }
}

/// The variant on which the meaning of `name` depends, if nobody has said yet how it is.
fn open_variant(profile: &Profile, name: &str) -> Option<String> {
    let entry = profile.resolve(name).ok()?;
    let variant = entry.quantity().variant()?;
    (profile.variants().contains_key(variant) && !profile.chosen().contains_key(variant)).then(|| variant.to_owned())
}

/// What `words` are together.
fn number(entry: &Entry, words: &[u16]) -> u32 {
    let low_first: Vec<_> =
        if entry.quantity().is_high_first() { words.iter().rev().copied().collect() } else { words.to_vec() };
    low_first.iter().rev().fold(0, |sum, &word| sum << 16 | u32::from(word))
}
