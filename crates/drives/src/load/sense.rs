//! What is right in its form and cannot be meant: a setpoint that can only be read, a state that every word shows.

use super::File;
use super::entries::Entries;
use super::manifest::{Manifest, line};
use super::motion::for_rectifiers;
use super::placed::Placed;
use super::problems::Problems;
use crate::entry::Access;
use crate::parts::rules::UnitKind;
use crate::parts::setpoint::Setpoint;
use crate::profile::Profile;
use crate::text::folded;

/// Checks what `manifest` says of `entries`.
pub(super) fn check(file: &File, manifest: &Manifest, entries: &Entries, problems: &mut Problems) {
    itself(file, manifest, problems);
    motion(file, manifest, entries, problems);
    let no = |access: Access| {
        move |name: &&Placed<String>| entries.find(name.get_ref()).is_some_and(|row| row.access == access)
    };
    for name in read(manifest).into_iter().filter(no(Access::Wo)) {
        let reason = format!("\"{}\" can only be written, and would have to be read here", name.get_ref());
        problems.add(file, line(file, name), reason);
    }
    for name in manifest.setpoints.values().map(|role| &role.register).filter(no(Access::Ro)) {
        let reason = format!("\"{}\" can only be read, and a setpoint has to be written", name.get_ref());
        problems.add(file, line(file, name), reason);
    }
    for choice in manifest.variants.values().flat_map(|variant| variant.get_ref().choices.values()) {
        let row = choice.get_ref();
        if let (Some(low), Some(high)) = (row.low, row.high)
            && low > high
        {
            problems.add(file, line(file, choice), format!("low = {low} is above high = {high}"));
        }
    }
    for field in manifest.bits.values().flatten().filter(|field| field.get_ref().name.trim().is_empty()) {
        problems.add(file, line(file, field), "\"name\" is empty; say what the bits are");
    }
}

/// Checks that a unit without a motor takes nothing over from one that has one. What it says itself is checked where it
/// says that.
pub(super) fn check_inherited(file: &File, manifest: &Manifest, profile: &Profile, problems: &mut Problems) {
    let below = manifest.extends.as_ref().map(|table| &table.get_ref().profile);
    let below = below.or(manifest.overlay.as_ref().map(|table| &table.get_ref().profile));
    let Some(below) = below.filter(|_| profile.kind == UnitKind::Rectifier) else { return };
    let mut wrong: Vec<&str> = Vec::new();
    if manifest.commands.is_none() {
        wrong
            .extend(profile.commands.keys().filter(|command| !for_rectifiers(**command)).map(|command| command.name()));
    }
    if profile.setpoints.contains_key(&Setpoint::Frequency) && !manifest.setpoints.contains_key(&Setpoint::Frequency) {
        wrong.push("setpoints.frequency");
    }
    if !wrong.is_empty() {
        let reason = format!(
            "a rectifier feeds no motor: it cannot take over {} from \"{}\"; drop the registers, or say [commands] anew",
            wrong.join(", "),
            below.get_ref()
        );
        problems.add(file, line(file, below), reason);
    }
}

/// What a profile says of itself.
fn itself(file: &File, manifest: &Manifest, problems: &mut Problems) {
    let place = line(file, &manifest.name);
    if manifest.title.as_ref().is_some_and(|title| title.trim().is_empty()) {
        problems.add(file, place, "\"title\" is empty; say what the maker calls the family");
    }
    let (models, aliases) = (manifest.models.iter().flatten(), manifest.aliases.iter().flatten());
    for name in manifest.maker.iter().chain(models).filter(|name| folded(name.get_ref()).is_empty()) {
        problems.add(file, line(file, name), format!("\"{}\" is no name of a maker or a drive", name.get_ref()));
    }
    for alias in aliases {
        let told = alias.get_ref();
        if folded(&told.name).is_empty() {
            problems.add(file, line(file, alias), "\"name\" is empty; say what stands on the drive");
        }
        if told.source.trim().is_empty() {
            problems.add(file, line(file, alias), "\"source\" is empty; name who says that it is this drive");
        }
    }
    if manifest.source.trim().is_empty() {
        problems.add(file, place, "\"source\" is empty; name the documents that the profile was made from");
    }
    if let Some(version) = manifest.version.as_ref().filter(|version| *version.get_ref() == 0) {
        problems.add(file, line(file, version), "version is 0 and must be 1 or more");
    }
    if let Some(requests) = manifest.requests.as_ref().filter(|requests| requests.functions.is_empty()) {
        problems.add(file, line(file, &requests.max_words), "\"functions\" is empty; 0x03 reads, 0x06 writes one word");
    }
    if let Some((requests, source)) =
        manifest.requests.as_ref().and_then(|requests| Some((requests, requests.joined.as_ref()?)))
    {
        if source.get_ref().trim().is_empty() {
            problems.add(
                file,
                line(file, source),
                "\"joined\" is empty; name the document and the page, or leave it out",
            );
        }
        if !requests.functions.contains(&0x10) {
            let reason = "\"joined\" says that one request may write several parameters, and \"functions\" has no 0x10";
            problems.add(file, line(file, source), reason);
        }
    }
}

/// What moves a motor, and what tells whether it moves.
fn motion(file: &File, manifest: &Manifest, entries: &Entries, problems: &mut Problems) {
    if let Some(commands) = &manifest.commands {
        let others = commands.elsewhere.values().chain(commands.first.values()).map(|other| &other.register);
        for named in std::iter::once(&commands.register).chain(others) {
            let register = entries.find(named.get_ref());
            let is_it = |name: &Placed<String>| entries.find(name.get_ref()) == register;
            if register.is_some() && !commands.moves.iter().any(is_it) {
                let register = named.get_ref();
                let reason = format!("\"moves\" must hold \"{register}\": what is written there can start a motor");
                problems.add(file, line(file, named), reason);
            }
        }
    }
    for when in manifest.state.iter().flat_map(|state| &state.get_ref().when) {
        if when.get_ref().fields.is_empty() {
            let reason = format!("{} has no \"fields\", so every word would show it", when.get_ref().state.name());
            problems.add(file, line(file, when), reason);
        }
    }
}

/// The registers that have to be read.
fn read(manifest: &Manifest) -> Vec<&Placed<String>> {
    let status = manifest
        .status
        .iter()
        .flat_map(|status| status.words.iter().chain(&status.fault).chain(&status.frequency).chain(&status.setpoint));
    let identification = manifest.identification.iter().filter_map(|table| table.register.as_ref());
    let state = manifest.state.iter().map(|state| &state.get_ref().register);
    let monitor = manifest.monitor.iter().flat_map(|monitor| &monitor.registers);
    let faults = manifest.faults.iter().flat_map(|faults| faults.history.iter().chain(&faults.values));
    status.chain(identification).chain(state).chain(monitor).chain(faults).collect()
}
