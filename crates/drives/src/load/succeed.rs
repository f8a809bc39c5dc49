//! What a row takes over from the row of the profile below in whose place it stands: the roles that it had there, its
//! bits, and what its values are called.
//!
//! A name says what a row is, wherever it stands. A place says so only where a document prints it: what is found where
//! something else was only assumed to be is that other thing no more.

use std::collections::BTreeMap;

use crate::entry::{Access, Entry, Kind, names};
use crate::evidence::Evidence;
use crate::place::Place;
use crate::profile::Profile;

/// Lets `rows` succeed those of `base` that have one of their names, or else one of their addresses. Rows of `base` in
/// whose place something else stands now lose their roles.
pub(super) fn succeed<'a>(base: &mut Profile, rows: impl Iterator<Item = &'a mut Entry>) {
    let inherited = base.entries.clone();
    let mut rows: Vec<&mut Entry> = rows.collect();
    let pairs = pairs(&inherited, &rows);
    let gone = |(index, old): &(usize, &Entry)| {
        !pairs.contains_key(index) && rows.iter().any(|new| overlaps(old, new) || share_a_name(old, new))
    };
    let gone: Vec<String> = inherited.iter().enumerate().filter(gone).map(|(_, old)| old.name.clone()).collect();
    for name in &gone {
        leave_roles(base, name);
    }

    let mut called = BTreeMap::new();
    let mut places = BTreeMap::new();
    let only_read = |old: &Entry| {
        old.access == Access::Ro && inherited.iter().any(|other| super::entries::is_other_way(old, other))
    };
    for (old, new) in pairs.iter().filter_map(|(&old, &new)| Some((inherited.get(old)?, new))) {
        let Some(new) = rows.get_mut(new) else { continue };
        if new.bits.is_empty() {
            new.bits.clone_from(&old.bits);
        }
        // A table of registers has no column for them.
        if new.kind == Kind::Register {
            new.quantity.choices.clone_from(&old.quantity.choices);
        }
        called.insert(old.name.clone(), new.name.clone());
        // What is written there stays, wherever what is read there goes.
        places.extend(old.place.filter(|_| !only_read(old)).map(|place| (place, new.place)));
    }
    rename(base, &called);
    let follow = |place: Place| places.get(&place).copied().unwrap_or(Some(place));
    base.moving = base.moving.iter().filter_map(|&place| follow(place)).collect();
    base.command_address = base.command_address.and_then(follow);
    base.commands.retain(|_, known| {
        let is_there = known.elsewhere.is_none_or(|place| {
            known.elsewhere = follow(place);
            known.elsewhere.is_some()
        });
        is_there
            && known.first.is_none_or(|(place, code)| {
                known.first = follow(place).map(|place| (place, code));
                known.first.is_some()
            })
    });
}

/// Which of `inherited` is succeeded by which of `rows`, by index.
fn pairs(inherited: &[Entry], rows: &[&mut Entry]) -> BTreeMap<usize, usize> {
    let same_word = |old: &Entry, new: &Entry| own_name(old) == own_name(new);
    let same_place = |old: &Entry, new: &Entry| {
        let unnamed = new.kind == Kind::Parameter && new.alias.is_none();
        let known = old.evidence != Evidence::Assumed || unnamed;
        let same = old.place.is_some() && old.place == new.place && !super::entries::is_other_way(old, new);
        known && (share_a_name(old, new) || same)
    };
    let mut pairs = BTreeMap::new();
    for same in [&same_word as &dyn Fn(&Entry, &Entry) -> bool, &same_place] {
        for (new_index, new) in rows.iter().enumerate() {
            let taken = pairs.values().any(|&taken| taken == new_index);
            let mut free = inherited.iter().enumerate().filter(|(index, _)| !pairs.contains_key(index));
            if let Some((old, _)) = free.find(|(_, old)| !taken && same(old, new)) {
                pairs.insert(old, new_index);
            }
        }
    }
    pairs
}

/// What people call it: its name, or of a parameter without one its code.
fn own_name(entry: &Entry) -> &str {
    entry.alias.as_deref().unwrap_or(&entry.name)
}

fn share_a_name(old: &Entry, new: &Entry) -> bool {
    names(old).any(|name| names(new).any(|own| own == name))
}

fn overlaps(old: &Entry, new: &Entry) -> bool {
    super::entries::clash(old, new).is_some()
}

/// Nothing of `base` relies any more on `name` for what the drive does. What writes to it do stays as it was.
fn leave_roles(base: &mut Profile, name: &str) {
    for role in base.roles.single_mut() {
        role.take_if(|role| role == name);
    }
    base.roles.status_words.retain(|word| word != name);
    base.state.take_if(|state| state.register == name);
    base.setpoints.retain(|_, role| role.register != name);
}

/// Calls entries by their new names wherever `base` refers to them, all at once: two may have changed places.
fn rename(base: &mut Profile, called: &BTreeMap<String, String>) {
    let follow = |name: &mut String| {
        if let Some(new) = called.get(name) {
            name.clone_from(new);
        }
    };
    base.lists_mut().into_iter().flatten().for_each(follow);
    base.roles.single_mut().into_iter().flatten().for_each(follow);
    let bounds = base.entries.iter_mut().flat_map(|row| [&mut row.quantity.low_from, &mut row.quantity.high_from]);
    let setpoints = base
        .setpoints
        .values_mut()
        .flat_map(|role| std::iter::once(&mut role.register).chain(role.needs.iter_mut().map(|item| &mut item.code)));
    bounds
        .flatten()
        .chain(base.control.iter_mut().map(|item| &mut item.code))
        .chain(setpoints)
        .chain(base.variants.values_mut().map(|variant| &mut variant.parameter))
        .chain(
            base.watchdog
                .iter_mut()
                .flat_map(|watchdog| std::iter::once(&mut watchdog.timeout).chain(&mut watchdog.action)),
        )
        .chain(base.state.iter_mut().map(|state| &mut state.register))
        .for_each(follow);
}
