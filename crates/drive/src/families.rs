//! Families: all that a unit may be of.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use drivebus_drives::{Place, Profile};
use drivebus_rtu::huanyang::Protocol;

use crate::codes::Codes;
use crate::family::Family;

/// The families that are known beside the one that a unit was named as, and the codes that they list.
#[derive(Debug)]
pub struct Families {
    known: Vec<Arc<Family>>,
    codes: Arc<Codes>,
    /// Where units take commands, and of which families.
    commanded: BTreeMap<Place, Vec<Arc<Family>>>,
}

impl Families {
    /// The shipped ones. They are worked out once, when somebody asks first.
    ///
    /// There are none where the profiles are not part of the program: see the features of `drivebus-drives`.
    pub fn shipped() -> &'static Self {
        static SHIPPED: LazyLock<Families> =
            LazyLock::new(|| Families::of(Profile::builtin_names().filter_map(|name| Profile::builtin(name).ok())));
        &SHIPPED
    }

    /// Those of `profiles`, in their order.
    pub fn of(profiles: impl IntoIterator<Item = Arc<Profile>>) -> Self {
        let profiles: Vec<_> = profiles.into_iter().collect();
        let codes = Arc::new(Codes::of(&profiles));
        let known: Vec<_> = profiles.iter().map(|profile| Arc::new(family(profile, &profiles, &codes))).collect();
        let mut commanded: BTreeMap<Place, Vec<Arc<Family>>> = BTreeMap::new();
        for family in &known {
            for &place in family.command_registers().keys() {
                commanded.entry(place).or_default().push(Arc::clone(family));
            }
        }
        Self { known, codes, commanded }
    }

    /// The family that `profile` describes: one of these, or one of somebody's own.
    pub fn family(&self, profile: &Arc<Profile>) -> Arc<Family> {
        let is_it = |each: &&Arc<Family>| Arc::ptr_eq(each.profile(), profile);
        self.known.iter().find(is_it).cloned().unwrap_or_else(|| {
            let profiles: Vec<_> = self.known.iter().map(|each| Arc::clone(each.profile())).collect();
            Arc::new(family(profile, &profiles, &self.codes))
        })
    }

    /// All that a unit may be of that was named as `own`: that one first, then those of other names that speak its protocol.
    /// Of a name that it shares with one of these, it is the one that is meant.
    ///
    /// What is said in one protocol does nothing to a unit of another, which hears no request in it.
    pub fn with(&self, own: &Arc<Family>) -> Vec<Arc<Family>> {
        let others = self.speaking(own.protocol()).filter(|each| each.name() != own.name());
        std::iter::once(own).chain(others).cloned().collect()
    }

    /// The one of this name.
    pub fn named(&self, name: &str) -> Option<&Arc<Family>> {
        self.known.iter().find(|family| family.name() == name)
    }

    /// Those whose units speak `protocol`.
    pub(crate) fn speaking(&self, protocol: Protocol) -> impl Iterator<Item = &Arc<Family>> {
        self.known.iter().filter(move |each| each.protocol() == protocol)
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<Family>> {
        self.known.iter()
    }

    /// Those whose units take commands at `place`, in their order; none where none of them does.
    pub fn commanded_at(&self, place: Place) -> &[Arc<Family>] {
        self.commanded.get(&place).map_or(&[], Vec::as_slice)
    }

    /// The codes that they list.
    pub fn codes(&self) -> &Codes {
        &self.codes
    }
}

fn family(profile: &Arc<Profile>, known: &[Arc<Profile>], codes: &Arc<Codes>) -> Family {
    let named = |name: &str| known.iter().find(|each| each.name() == name);
    let is_known = profile.reports_as().iter().any(|name| named(name).is_some());
    let below = named(profile.family()).and_then(|family| family.signature());
    Family::new(Arc::clone(profile), Arc::clone(codes), below, is_known)
}
