//! Whether what a profile takes over from the one below it still fits the rows and rules that it states itself.
//!
//! What it states itself was checked where it was read. Here no line is at fault alone, so the one that changed the rule is
//! named, or else the first.

use super::File;
use super::manifest::{Manifest, line};
use super::problems::Problems;
use crate::bits::BitField;
use crate::entry::{Access, Entry};
use crate::parts::memory::Memory;
use crate::parts::rules::Protocol;
use crate::parts::setpoint::Setpoint;
use crate::place::{Place, Table};
use crate::profile::Profile;

/// Checks the whole `profile`, which is put together.
pub(super) fn check(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    memory(file, manifest, profile, problems);
    words(file, profile, problems);
    setpoints(file, profile, problems);
    functions(file, manifest, profile, problems);
    wide(file, manifest, profile, problems);
    protocol(file, manifest, profile, problems);
    sequence(file, profile, problems);
    if profile.fault_holds() && !(profile.state_tells_fault() && profile.role("fault").is_some()) {
        let reason = "\"fault_holds\" needs a register of the fault, and a state that says when the drive is in fault";
        let own = manifest.status.as_ref().and_then(|status| status.fault_holds.as_ref());
        problems.add(file, own.map_or(1, |own| line(file, own)), reason.to_owned());
    }
}

/// The bit that says where a write is kept is no part of any address.
fn memory(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    let mask = profile.memory.as_ref().map_or(0, Memory::mask);
    let own = manifest.parameters.as_ref().and_then(|parameters| parameters.memory.as_ref());
    let is_hit = |place: &Place| place.table == Table::Holding && place.address & mask != 0;
    let hit = profile.entries.iter().find_map(|entry| Some((entry, entry.place.filter(is_hit)?)));
    if let Some((entry, at)) = hit {
        let place = own.map_or(1, |rule| line(file, rule));
        let reason = format!(
            "{} is at {at}, and bit {} of an address is to say where a write is kept",
            entry.name,
            mask.trailing_zeros()
        );
        problems.add(file, place, reason);
    }
}

/// What is read or written as one word has one, and may be.
fn words(file: &File, profile: &Profile, problems: &mut Problems) {
    let mut one_word = |what: &str, entry: Option<&Entry>, not: Access| {
        let Some(entry) = entry else { return };
        if entry.words() != 1 || entry.access == not {
            let must = if not == Access::Ro { "written" } else { "read" };
            let reason = format!("{} is {what}, so it must have one word that can be {must}", entry.name);
            problems.add(file, 1, reason);
        }
    };
    for &place in profile.command_registers().keys() {
        one_word("the command register", profile.written_entry_at(place), Access::Ro);
    }
    for setpoint in profile.setpoints.values() {
        one_word("a setpoint", profile.entry(&setpoint.register), Access::Ro);
    }
    for (what, role) in
        [("the state", "state"), ("the present fault", "fault"), ("the identification", "identification")]
    {
        one_word(what, profile.role(role), Access::Wo);
    }
    for word in profile.status_words() {
        one_word("a status word", Some(word), Access::Wo);
    }
    let registers = profile.command_registers();
    for place in registers.into_keys().filter(|&place| profile.entry_at(place).is_none()) {
        problems.add(file, 1, format!("another row lies over the command register, {place}"));
    }
}

/// What the words before a start wait for is still told by the state word.
fn sequence(file: &File, profile: &Profile, problems: &mut Problems) {
    // Without a state nothing is started that waits for it.
    let Some(state) = profile.state.as_ref().and_then(|state| profile.entry(&state.register)) else { return };
    for step in &profile.start_sequence {
        for until in &step.until {
            let is_there = |field: &BitField| field.name == until.field && field.mask() == until.mask;
            if !state.bits.iter().any(is_there) {
                let reason = format!("\"{}\" waits for {} of {}", step.label, until.field, state.name);
                problems.add(file, 1, format!("{reason}, which has no such bits any more: say [commands] anew"));
            }
        }
    }
}

/// What only changes a speed is written where nothing starts a motor.
fn setpoints(file: &File, profile: &Profile, problems: &mut Problems) {
    for (setpoint, role) in &profile.setpoints {
        let moves = matches!(setpoint, Setpoint::VirtualInputs | Setpoint::VirtualOutputs | Setpoint::SpecialControl);
        let place = profile.entry(&role.register).and_then(|entry| entry.place);
        let commands = profile.command_registers();
        let taken = |place: Place| commands.contains_key(&place) || (!moves && profile.is_command(place));
        if let Some(place) = place.filter(|&place| taken(place)) {
            let reason = format!("{} is at {place}, where a word can start a motor", role.register);
            problems.add(file, 1, format!("{reason}: no setpoint can be there"));
        }
    }
}

/// Huanyang's protocol has nothing but what these addresses stand for, a word at a time.
fn protocol(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    if profile.requests().protocol != Protocol::Huanyang {
        return;
    }
    let place = manifest.requests.as_ref().map_or(1, |requests| line(file, &requests.max_words));
    if profile.max_words() != 1 {
        problems.add(file, place, "Huanyang's protocol has one word in a request: \"max_words\" must be 1");
    }
    for entry in &profile.entries {
        let Some(Place { table, address }) = entry.place() else { continue };
        let fits = table == Table::Holding
            && entry.words() == 1
            && matches!(
                (address.to_be_bytes(), entry.access),
                ([0x01, _], _) | ([0x04, _], Access::Ro) | ([0x03 | 0x05, 0], Access::Wo)
            );
        if !fits {
            let has = "parameters at 0100H to 01FFH, read-only words at 0400H to 04FFH, and write-only ones at 0300H and 0500H";
            problems.add(file, place, format!("Huanyang's protocol has {has}: {} is none of those", entry.name));
        }
    }
}

/// Two words are written by one request, so that the drive never has one half of a value.
fn wide(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    if profile.requests().writes_two() {
        return;
    }
    let at = manifest.requests.as_ref().map_or(1, |requests| line(file, &requests.max_words));
    for entry in profile.entries.iter().filter(|entry| entry.words() == 2 && entry.access != Access::Ro) {
        let reason = "it is written by 0x10 with two words, which \"functions\" or the most words do not allow";
        problems.add(file, at, format!("{} has two words and can be written: {reason}", entry.name));
    }
}

/// What stands beside the holding registers is read and written by functions that the drive has to know.
fn functions(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    let place = manifest.requests.as_ref().map_or(1, |requests| line(file, &requests.max_words));
    for entry in profile.entries.iter().filter(|entry| entry.table() != Table::Holding) {
        let (table, known) = (entry.table(), profile.functions());
        let reads = entry.access != Access::Wo && !known.contains(&table.function());
        let writes = entry.access != Access::Ro && !table.written_by().iter().any(|function| known.contains(function));
        let lacks = if reads { Some(table.function()) } else { table.written_by().first().copied().filter(|_| writes) };
        if let Some(function) = lacks {
            let does = if reads { "read" } else { "written" };
            let reason = format!("\"functions\" has no 0x{function:02X}, by which {} is {does}", entry.name);
            problems.add(file, place, reason);
        }
    }
}
