//! What a row takes over from the row of the profile below in whose place it stands: the roles that it had there, its
//! bits, and what its values are called.

use crate::entry::{Entry, Kind};
use crate::lookup::names;
use crate::profile::Profile;

/// Lets `rows` succeed those of `base` that have one of their names, or else one of their addresses.
pub(super) fn succeed<'a>(base: &mut Profile, rows: impl Iterator<Item = &'a mut Entry>) {
    let inherited = base.entries.clone();
    for new in rows {
        let same_name = |old: &&Entry| names(old).any(|name| names(new).any(|own| own == name));
        let same_place = |old: &&Entry| old.address.is_some() && old.address == new.address;
        let Some(old) = inherited.iter().find(same_name).or_else(|| inherited.iter().find(same_place)) else {
            continue;
        };
        if new.bits.is_empty() {
            new.bits.clone_from(&old.bits);
        }
        // A table of registers has no column for them.
        if new.kind == Kind::Register {
            new.quantity.choices.clone_from(&old.quantity.choices);
        }
        rename(base, &old.name, &new.name);
        if let Some(place) = old.address {
            let follow = |address: u16| if address == place { new.address } else { Some(address) };
            base.moving = base.moving.iter().filter_map(|&address| follow(address)).collect();
            base.command_address = base.command_address.and_then(follow);
        }
    }
}

/// Calls an entry by its new name wherever `base` refers to it.
fn rename(base: &mut Profile, old: &str, new: &str) {
    let (groups, roles) = (&mut base.groups, &mut base.roles);
    let lists = [
        &mut base.monitor,
        &mut base.fault_history,
        &mut base.fault_values,
        &mut roles.status_words,
        &mut groups.acts,
        &mut groups.serial,
        &mut groups.motor,
        &mut groups.last,
    ];
    let roles = [&mut roles.identification, &mut roles.fault, &mut roles.frequency, &mut roles.setpoint];
    let bounds = base.entries.iter_mut().flat_map(|row| [&mut row.quantity.low_from, &mut row.quantity.high_from]);
    let setpoints = base
        .setpoints
        .values_mut()
        .flat_map(|role| std::iter::once(&mut role.register).chain(role.needs.iter_mut().map(|item| &mut item.code)));
    let everywhere = lists
        .into_iter()
        .flatten()
        .chain(roles.into_iter().flatten())
        .chain(bounds.flatten())
        .chain(base.control.iter_mut().map(|item| &mut item.code))
        .chain(setpoints)
        .chain(base.variants.values_mut().map(|variant| &mut variant.parameter))
        .chain(base.watchdog.iter_mut().flat_map(|watchdog| [&mut watchdog.timeout, &mut watchdog.action]))
        .chain(base.state.iter_mut().map(|state| &mut state.register));
    for name in everywhere.filter(|name| **name == old) {
        new.clone_into(name);
    }
}
