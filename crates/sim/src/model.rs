//! What a unit behaves like: a family that is typed here, or all that a profile of somebody's own says.

use drivebus_drives::Profile;

use crate::drive::{Family, Map, own, unlisted};
use crate::error::SimError;

/// What a simulated unit behaves like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Model<'a> {
    /// The family of a shipped profile, by its name: typed from its manuals, and not taken from the profile.
    Shipped(&'a str),
    /// What this profile says. A shipped one is taken for the family of its name.
    Profile(&'a Profile),
}

impl<'a> From<&'a str> for Model<'a> {
    fn from(name: &'a str) -> Self {
        Self::Shipped(name)
    }
}

impl<'a> From<&'a Profile> for Model<'a> {
    fn from(profile: &'a Profile) -> Self {
        Self::Profile(profile)
    }
}

impl Model<'_> {
    /// Its words.
    pub(crate) fn map(self) -> Result<Map, SimError> {
        match self {
            // The profile's own error says that there is none, and what comes near.
            Self::Shipped(name) => shipped(name, &*Profile::builtin(name)?),
            Self::Profile(profile) if is_shipped(profile) => shipped(profile.name(), profile),
            Self::Profile(profile) => {
                let lacking = |missing| SimError::Lacking { profile: profile.name().to_owned(), missing };
                Ok(Map::new(own::family(profile).map_err(lacking)?, profile))
            }
        }
    }
}

/// Whether `profile` is the shipped one of its name, for whatever variant.
fn is_shipped(profile: &Profile) -> bool {
    let chosen = profile.chosen().iter().map(|(name, choice)| (name.as_str(), choice.as_str()));
    let known = Profile::builtin(profile.name()).map(|known| known.with_variants(chosen));
    matches!(known, Ok(Ok(known)) if known == *profile)
}

fn shipped(name: &str, profile: &Profile) -> Result<Map, SimError> {
    let mut family = Family::named(name).ok_or_else(|| SimError::NotSimulated { profile: name.to_owned() })?;
    // What is typed or listed comes later, or is left out here: it is more than a stand-in.
    let groups: Vec<u8> = profile.parameter_groups().collect();
    let unlisted = unlisted().filter(|stand_in| {
        profile.entry_at(stand_in.address).is_none() && groups.contains(&stand_in.address.to_be_bytes()[0])
    });
    family.parameters = unlisted.chain(family.parameters).collect();
    Ok(Map::new(family, profile))
}
