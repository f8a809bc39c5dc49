//! What a profile takes over from the one below it, and how much of it may then be trusted.

use super::File;
use super::entries::is_other_way;
use super::manifest::{Extends, Manifest, line};
use super::placed::Placed;
use super::problems::Problems;
use crate::entry::{Access, names};
use crate::evidence::Evidence;
use crate::profile::Profile;
use crate::text::closest;

/// Tables whose rules a sibling can confirm as a whole.
const TABLES: [&str; 10] =
    ["commands", "state", "control", "setpoints", "variants", "memory", "requests", "serial", "watchdog", "faults"];

/// What stands among the rows to drop for the whole list of faults.
const FAULTS: &str = "faults";

/// `base` as the one who writes `manifest` sees it: without what is dropped, and, for a sister family, with the evidence
/// that the assumption leaves.
pub(super) fn view(mut base: Profile, file: &File, manifest: &Manifest, problems: &mut Problems) -> Profile {
    drop_rows(&mut base, file, &manifest.drop, problems);
    // A code names one family.
    base.identifications.clear();
    base.signature = None;
    if let Some(extends) = &manifest.extends {
        // By the word that is asked before it is unlocked, a drive is told from its sisters.
        base.unlock = None;
        assume(&mut base, file, extends.get_ref(), problems);
    }
    base
}

fn drop_rows(base: &mut Profile, file: &File, dropped: &[Placed<String>], problems: &mut Problems) {
    for name in dropped {
        if name.get_ref() == FAULTS {
            base.faults.clear();
            continue;
        }
        base.groups.dropped.extend(base.entry(name.get_ref()).map(|entry| entry.name.clone()));
        if problems.is_full() {
            return;
        }
        let wanted = name.get_ref();
        let Some(index) = base.entries.iter().position(|entry| names(entry).any(|known| known == wanted)) else {
            let closest = closest(wanted, base.entries.iter().flat_map(names)).unwrap_or_default();
            let reason = format!("{} has no \"{wanted}\" to drop; the closest is \"{closest}\"", base.name);
            problems.add(file, line(file, name), reason);
            continue;
        };
        let gone = base.entries.remove(index);
        // Where the same address is written as something else, the commands stay.
        let place = gone
            .place
            .filter(|_| gone.access != Access::Ro || !base.entries.iter().any(|other| is_other_way(&gone, other)));
        let stays = |name: &String| *name != gone.name;
        base.lists_mut().into_iter().for_each(|list| list.retain(stays));
        for role in base.roles.single_mut() {
            role.take_if(|name| !stays(name));
        }
        base.control.retain(|item| stays(&item.code));
        base.setpoints.retain(|_, role| stays(&role.register) && role.needs.iter().all(|need| stays(&need.code)));
        base.variants.retain(|_, variant| stays(&variant.parameter));
        base.state.take_if(|state| !stays(&state.register));
        base.watchdog.take_if(|watchdog| {
            !stays(&watchdog.timeout) || watchdog.action.as_ref().is_some_and(|action| !stays(action))
        });
        base.unlock.take_if(|unlock| [unlock.place, unlock.shown_by.0].into_iter().any(|at| Some(at) == place));
        base.moving.retain(|&at| Some(at) != place);
        if base.command_address.is_some_and(|at| Some(at) == place) {
            base.command_address = None;
            base.commands.clear();
            base.other_commands.clear();
            base.start_sequence.clear();
        }
        base.commands.retain(|_, known| {
            let places = known.elsewhere.into_iter().chain(known.first.map(|(at, _)| at));
            places.into_iter().all(|at| Some(at) != place)
        });
        for entry in &mut base.entries {
            entry.quantity.variant.take_if(|variant| !base.variants.contains_key(variant));
            for bound in [&mut entry.quantity.low_from, &mut entry.quantity.high_from] {
                bound.take_if(|code| *code == gone.name);
            }
        }
    }
}

/// Takes the evidence off all that the sister family's own documents do not confirm.
fn assume(base: &mut Profile, file: &File, extends: &Extends, problems: &mut Problems) {
    let (assumption, source) = (extends.assumption.get_ref(), &extends.confirmed_source);
    if assumption.trim().is_empty() {
        let reason = "\"assumption\" is empty; say why this family may be taken for the other one";
        problems.add(file, line(file, &extends.assumption), reason);
    }
    if let (Some(first), true) = (extends.confirmed.first(), source.trim().is_empty()) {
        let reason = "\"confirmed_source\" is missing; name the document that prints these rows for this family";
        problems.add(file, line(file, first), reason);
    }
    for name in &extends.confirmed {
        if problems.is_full() {
            return;
        }
        let wanted = name.get_ref();
        let known =
            TABLES.contains(&wanted.as_str()) || base.entries.iter().any(|row| names(row).any(|own| own == wanted));
        if !known {
            let all = base.entries.iter().flat_map(names).chain(TABLES);
            let closest = closest(wanted, all).unwrap_or_default();
            let reason = format!("{} has no \"{wanted}\" to confirm; the closest is \"{closest}\"", base.name);
            problems.add(file, line(file, name), reason);
        }
    }
    let confirmed = |name: &str| extends.confirmed.iter().any(|row| row.get_ref() == name);

    for entry in &mut base.entries {
        if names(entry).any(confirmed) {
            entry.source.clone_from(source);
        } else if entry.evidence == Evidence::Verified {
            entry.evidence = Evidence::Unverified;
            entry.note = joined(assumption, &entry.note);
        }
    }
    if !confirmed("commands") {
        base.commands.values_mut().for_each(|command| command.verified = false);
        base.commands_note.clone_from(assumption);
    }
    if let Some(state) = base.state.as_mut().filter(|_| !confirmed("state")) {
        (state.verified, state.note) = (false, joined(assumption, &state.note));
    }
    if let Some(memory) = base.memory.as_mut().filter(|_| !confirmed("memory")) {
        (memory.verified, memory.note) = (false, joined(assumption, &memory.note));
    }
    if let Some(watchdog) = base.watchdog.as_mut().filter(|_| !confirmed("watchdog")) {
        (watchdog.verified, watchdog.note) = (false, joined(assumption, &watchdog.note));
    }
    if let Some(serial) = base.serial.as_mut().filter(|_| !confirmed("serial")) {
        serial.verified = false;
    }
    if !confirmed("requests") {
        let requests = &mut base.requests;
        (requests.verified, requests.note) = (false, joined(assumption, &requests.note));
        // What a sister does not print, its drives get one by one.
        requests.joined = None;
    }
    for variant in base.variants.values_mut().filter(|_| !confirmed("variants")) {
        (variant.verified, variant.note) = (false, joined(assumption, &variant.note));
    }
    let control = base.control.iter_mut().filter(|_| !confirmed("control"));
    let needs = base.setpoints.values_mut().filter(|_| !confirmed("setpoints")).flat_map(|role| &mut role.needs);
    for item in control.chain(needs) {
        (item.verified, item.note) = (false, joined(assumption, &item.note));
    }
    for fault in base.faults.values_mut().filter(|_| !confirmed("faults")) {
        if fault.evidence == Evidence::Verified {
            fault.evidence = Evidence::Unverified;
            fault.note = joined(assumption, &fault.note);
        }
    }
}

fn joined(assumption: &str, note: &str) -> String {
    format!("{assumption} {note}").trim_end().to_owned()
}
