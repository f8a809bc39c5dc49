//! Identification codes: where units keep them, and what the shipped profiles list of each.
//!
//! A code says what documents say of it, and no more: some families share one, and some codes are known from other
//! people's programs alone.

use std::sync::Arc;

use drivebus_drives::{Identification, Place, Profile};

/// The codes that some profiles list, and where units of their families keep them.
#[derive(Debug, Clone)]
pub struct Codes {
    places: Vec<Place>,
    /// Each code with its rows, one for each family.
    rows: Vec<(u16, Vec<Identification>)>,
}

impl Codes {
    /// Those of `profiles`; of rows that say the same of a family, the first that a document prints, or else the first.
    pub(crate) fn of(profiles: &[Arc<Profile>]) -> Self {
        let mut places = Vec::new();
        let mut rows: Vec<(u16, Vec<Identification>)> = Vec::new();
        for profile in profiles {
            places.extend(place_of(profile).filter(|place| !places.contains(place)));
            for row in profile.identifications() {
                let Some((_, known)) = rows.iter_mut().find(|(code, _)| *code == row.code) else {
                    rows.push((row.code, vec![row.clone()]));
                    continue;
                };
                match known.iter_mut().find(|known| known.family == row.family) {
                    None => known.push(row.clone()),
                    Some(known) if row.verified && !known.verified => *known = row.clone(),
                    Some(_) => {}
                }
            }
        }
        Self { places, rows }
    }

    /// Where units of these families keep their codes, each place once, in the order of the families.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Every code that is listed, 0..=0xFFFF, each once, in the order of the families.
    pub fn all(&self) -> impl Iterator<Item = u16> {
        self.rows.iter().map(|&(code, _)| code)
    }

    /// What is listed of the code `word`, if codes stand at `place`; elsewhere it is a word like any other.
    pub fn rows(&self, place: Place, word: u16) -> &[Identification] {
        if !self.places.contains(&place) {
            return &[];
        }
        self.rows.iter().find(|(code, _)| *code == word).map_or(&[], |(_, rows)| rows)
    }

    /// Whether some code is listed for the family of this name.
    pub(crate) fn has_family(&self, name: &str) -> bool {
        self.rows.iter().flat_map(|(_, rows)| rows).any(|row| row.family == name)
    }
}

/// Where units of `profile` keep their code; `None` if they have none, or nobody knows where.
pub(crate) fn place_of(profile: &Profile) -> Option<Place> {
    profile.role("identification")?.place()
}

/// Whether `row` names a family that units of `profile` report as, by itself or as one that shares the code.
pub(crate) fn is_own(profile: &Profile, row: &Identification) -> bool {
    let mut named = std::iter::once(&row.family).chain(&row.shared);
    named.any(|name| profile.reports_as().contains(name))
}
