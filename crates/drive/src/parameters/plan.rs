//! What the profile decides of a write: whether it may be, where it goes, and as which word.

use std::borrow::Cow;

use drivebus_drives::{Access, Entry, Input, Kind, Place, Profile, Store, Value};

use super::not_kept::{Held, NotPlanned, WhyNotPlanned};
use crate::unit::Unit;

type Why = WhyNotPlanned;

/// One write that is allowed, as far as the profile tells.
#[derive(Debug, Clone)]
pub(crate) struct Planned<'p> {
    /// What it was called.
    pub(super) name: &'p str,
    pub(super) entry: Cow<'p, Entry>,
    /// Where it goes, with the bit that says where it is kept.
    pub(super) place: Place,
    /// One, or two, in the order of their addresses.
    pub(super) words: Vec<u16>,
}

impl Planned<'_> {
    /// One name for a parameter that has two.
    pub(super) fn key(&self) -> &str {
        self.entry.name()
    }

    pub(super) fn is_parameter(&self) -> bool {
        self.entry.kind() == Kind::Parameter
    }

    pub(super) fn value(&self) -> Value {
        self.entry.quantity().decode_raw(self.entry.quantity().raw(&self.words))
    }

    /// The same with `words` in its place.
    pub(super) fn held(&self, words: &[u16]) -> Held {
        let quantity = self.entry.quantity();
        Held::of(self.name, &self.entry, quantity.decode_raw(quantity.raw(words)))
    }
}

/// What `name` means to `profile`.
pub(super) fn resolve<'p>(profile: &'p Profile, name: &str) -> Result<Cow<'p, Entry>, NotPlanned> {
    profile.resolve(name).map_err(|why| NotPlanned::of(name, Why::Unknown(why)))
}

impl Unit {
    /// The write of `value` to `name`, whose meaning is settled.
    pub(crate) fn plan<'p>(&'p self, name: &'p str, value: Input<'_>, store: Store) -> Result<Planned<'p>, NotPlanned> {
        let entry = resolve(self.profile(), name)?;
        match self.planned(&entry, value, store) {
            Ok((place, words)) => Ok(Planned { name, entry, place, words }),
            Err(why) => Err(NotPlanned::of(name, why)),
        }
    }

    fn planned(&self, entry: &Entry, value: Input<'_>, store: Store) -> Result<(Place, Vec<u16>), Why> {
        let (profile, rule) = (self.profile(), self.rule());
        if entry.access() == Access::Ro {
            return Err(Why::ReadOnly);
        }
        if entry.place().is_some_and(|place| profile.is_command(place)) {
            return Err(Why::Moves);
        }
        if entry.place().is_some() && profile.store_word().map(|(_, at)| at) == entry.place() {
            return Err(Why::Stores);
        }
        rule.write(entry).map_err(|why| Why::MayNot(why.to_string()))?;
        if entry.kind() == Kind::Parameter && store == Store::Ram && profile.memory().is_none() {
            return Err(Why::OnlyStored);
        }
        let words = entry.encode_words(value).map_err(Why::Unfit)?;
        let raw = entry.quantity().raw(&words);
        rule.word(entry, raw).map_err(|_| Why::NoRange(raw))?;
        let place = profile.write_address(entry, store).map_err(Why::NoPlace)?;
        rule.kept(entry, store).map_err(|why| Why::MayNotKeep(why.to_string()))?;
        Ok((place, words))
    }
}
