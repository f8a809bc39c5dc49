//! The registers and parameters of a profile while it is put together: its own rows, and those of the profile below it.

use std::collections::BTreeMap;

use super::File;
use super::manifest::line;
use super::placed::Placed;
use super::problems::Problems;
use super::rows::Located;
use crate::entry::{Access, Entry, Kind, names};
use crate::parts::memory::Memory;
use crate::place::{Place, Table};
use crate::text::{closest, group, parse_code};

/// The registers and parameters, and where each address is.
#[derive(Debug, Default)]
pub(super) struct Entries {
    pub(super) list: Vec<Entry>,
    /// Of two at one place the one that is read.
    pub(super) by_address: BTreeMap<Place, usize>,
    /// Some rows were broken, so that a name that is missing may be theirs.
    pub(super) incomplete: bool,
}

impl Entries {
    /// `rows` over `inherited`, of which each row with the same name or the same address gives way.
    pub(super) fn merge(
        inherited: Vec<Entry>,
        rows: Vec<(&File, Located<Entry>)>,
        closed_groups: &[u8],
        memory: Option<&Memory>,
        problems: &mut Problems,
    ) -> Self {
        let mut own: Vec<Entry> = Vec::new();
        for (file, Located { line, item }) in rows {
            if let Some(twice) = names(&item).find(|&name| own.iter().any(|other| is_called(other, name))) {
                problems.add(file, line, format!("{twice} is there twice"));
            } else if let Some((other, place)) = own.iter().find_map(|other| Some((other, clash(other, &item)?))) {
                let reason = format!("{} is at {place}, where {} is already", item.name, other.name);
                problems.add(file, line, reason);
            } else if let Some(reason) = out_of_place(&item, closed_groups, memory) {
                problems.add(file, line, reason);
            } else {
                own.push(item);
            }
        }
        let replaced = |old: &Entry| {
            own.iter().any(|new| clash(old, new).is_some() || names(old).any(|name| is_called(new, name)))
        };
        let mut list: Vec<Entry> = inherited.into_iter().filter(|old| !replaced(old)).collect();
        list.append(&mut own);
        list.sort_by(|one, other| {
            let place = |entry: &Entry| (entry.kind, entry.place.is_none(), entry.place);
            place(one).cmp(&place(other)).then_with(|| one.name.cmp(&other.name))
        });
        let placed = |index: usize| Some((list.get(index)?.place?, index));
        let (written, read): (Vec<_>, Vec<_>) =
            (0..list.len()).filter_map(placed).partition(|&(_, index)| list[index].access == Access::Wo);
        let by_address = written.into_iter().chain(read).collect();
        Self { list, by_address, incomplete: false }
    }

    /// Checks that the bounds of `entries` of `file`, with their lines, are parameters.
    pub(super) fn check_bounds(&self, file: &File, bounds: &[(u64, String)], problems: &mut Problems) {
        for (line, bound) in bounds {
            let known = self.list.iter().any(|entry| entry.kind == Kind::Parameter && entry.name == *bound);
            if !known && !self.incomplete && !problems.is_full() {
                let closest = closest(bound, self.codes()).unwrap_or("nothing at all");
                let reason =
                    format!("bound \"{bound}\" is not a parameter of this profile; the closest is \"{closest}\"");
                problems.add(file, *line, reason);
            }
        }
    }

    fn codes(&self) -> impl Iterator<Item = &str> {
        self.list.iter().filter(|entry| entry.kind == Kind::Parameter).map(|entry| entry.name.as_str())
    }

    pub(super) fn find(&self, name: &str) -> Option<&Entry> {
        self.list.iter().find(|entry| names(entry).any(|known| known == name))
    }

    /// The entry that `name`, in `file`, refers to; there is a problem if there is none.
    pub(super) fn get(&self, file: &File, name: &Placed<String>, problems: &mut Problems) -> Option<&Entry> {
        let found = self.find(name.get_ref());
        if found.is_none() && !self.incomplete && !problems.is_full() {
            let wanted = name.get_ref();
            let closest = closest(wanted, self.list.iter().flat_map(names)).unwrap_or("nothing at all");
            let reason = format!("no register or parameter \"{wanted}\"; the closest is \"{closest}\"");
            problems.add(file, line(file, name), reason);
        }
        found
    }

    /// As [`get`](Self::get), for what is to be changed.
    pub(super) fn get_mut(
        &mut self,
        file: &File,
        name: &Placed<String>,
        problems: &mut Problems,
    ) -> Option<&mut Entry> {
        let found = self.get(file, name, problems)?.name.clone();
        self.list.iter_mut().find(|entry| entry.name == found)
    }

    /// The names that `wanted` refers to.
    pub(super) fn names(&self, file: &File, wanted: &[Placed<String>], problems: &mut Problems) -> Vec<String> {
        wanted.iter().filter_map(|name| Some(self.get(file, name, problems)?.name.clone())).collect()
    }

    /// The parameters that `wanted` refers to, by code or by whole groups: `P14`.
    pub(super) fn parameters(&self, file: &File, wanted: &[Placed<String>], problems: &mut Problems) -> Vec<String> {
        let mut found = Vec::new();
        for name in wanted {
            let wanted = name.get_ref();
            let numbered = |code: &str| parse_code(code).map(|(group, _)| group);
            let number = numbered(&format!("{wanted}.00"));
            let of_group = |entry: &&Entry| {
                let same_number = number.is_some() && numbered(&entry.name) == number;
                entry.kind == Kind::Parameter && (same_number || group(&entry.name).eq_ignore_ascii_case(wanted))
            };
            let before = found.len();
            found.extend(self.list.iter().filter(of_group).map(|entry| entry.name.clone()));
            if found.len() > before {
                continue;
            }
            if number.is_none() {
                found.extend(self.get(file, name, problems).map(|entry| entry.name.clone()));
            } else if !self.incomplete {
                problems.add(file, line(file, name), format!("no parameter is in group {wanted}"));
            }
        }
        found
    }
}

/// Whether one of the names of `entry` is `name`; codes are read in upper and lower case alike.
fn is_called(entry: &Entry, name: &str) -> bool {
    names(entry).any(|own| own.eq_ignore_ascii_case(name))
}

/// A place that both have, and only one can.
pub(super) fn clash(one: &Entry, other: &Entry) -> Option<Place> {
    overlap(one, other).filter(|_| !is_other_way(one, other))
}

/// Whether one is what is read and the other what is written at the same place.
pub(super) fn is_other_way(one: &Entry, other: &Entry) -> bool {
    let ways = (one.access, other.access);
    let same_word = one.place.is_some() && one.place == other.place && one.words() == other.words();
    same_word && matches!(ways, (Access::Ro, Access::Wo) | (Access::Wo, Access::Ro))
}

/// A place that both have.
fn overlap(one: &Entry, other: &Entry) -> Option<Place> {
    let last = |first: u16, entry: &Entry| first.saturating_add(entry.words() - 1);
    let (Place { table, address: first }, second) = (one.place?, other.place?);
    let meet = first.max(second.address);
    let both = table == second.table && meet <= last(first, one).min(last(second.address, other));
    both.then_some(Place::new(table, meet))
}

/// Why `entry` cannot stand at its address.
fn out_of_place(entry: &Entry, closed_groups: &[u8], memory: Option<&Memory>) -> Option<String> {
    let Place { table: Table::Holding, address } = entry.place? else { return None };
    let [group, _] = address.to_be_bytes();
    if entry.kind == Kind::Parameter && closed_groups.contains(&group) {
        return Some(format!("{} is in the group {group}, which is one of \"closed_groups\"", entry.name));
    }
    let mask = memory.map_or(0, Memory::mask);
    (address & mask != 0).then(|| {
        let bit = mask.trailing_zeros();
        format!(
            "{} is at {address:04X}H, whose bit {bit} says where a write is kept: give the plain address",
            entry.name
        )
    })
}
