//! What `profile.toml` says of commands and states: the words that move a motor, and those that tell what it does.

use std::collections::BTreeMap;

use super::File;
use super::entries::Entries;
use super::facts::check;
use super::manifest::{Commands, Elsewhere, Manifest, States, line};
use super::placed::Placed;
use super::problems::Problems;
use crate::entry::{Access, names};
use crate::parts::command::{Command, CommandCode};
use crate::parts::rules::UnitKind;
use crate::parts::state::{StateRule, StateWord};
use crate::profile::Profile;
use crate::text::closest;

/// The command register, its codes, and what else moves a motor.
pub(super) fn commands(
    file: &File,
    manifest: &Manifest,
    profile: &mut Profile,
    entries: &mut Entries,
    problems: &mut Problems,
) {
    let Some(table) = &manifest.commands else { return };
    profile.commands.clear();
    profile.other_commands.clear();
    profile.commands_note.clear();
    let mut all: Vec<(Command, &Placed<u16>, bool)> = Vec::new();
    all.extend(table.codes.iter().map(|(&command, code)| (command, code, true)));
    if let Some(assumed) = &table.assumed {
        all.extend(assumed.codes.iter().map(|(&command, code)| (command, code, false)));
        profile.commands_note.clone_from(assumed.reason.get_ref());
        if assumed.reason.get_ref().trim().is_empty() {
            problems.add(file, line(file, &assumed.reason), "\"reason\" is empty; say why these codes are assumed");
        }
    }
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    profile.command_address = register.place;
    register.quantity.choices.clear();
    let mut choices: BTreeMap<u16, String> = BTreeMap::new();
    for (command, spanned, verified) in all {
        let code = *spanned.get_ref();
        if profile.kind == UnitKind::Rectifier && !for_rectifiers(command) {
            let reason = format!("a rectifier feeds no motor: it has no {}", command.name());
            problems.add(file, line(file, spanned), reason);
        }
        let word = check(file, line(file, spanned), &register.quantity, &register.name, code.into());
        if problems.keep(word).is_none() {
            continue;
        }
        let label = match choices.get(&code) {
            Some(other) if told_apart(table, command, other) => format!("{other} or {}", command.name()),
            other => {
                if let Some(other) = other {
                    problems.add(file, line(file, spanned), format!("{} has the code of {other}", command.name()));
                }
                command.name().to_owned()
            }
        };
        choices.insert(code, label);
        if profile.commands.insert(command, CommandCode { code, verified, elsewhere: None, first: None }).is_some() {
            problems.add(file, line(file, spanned), format!("{} is there twice", command.name()));
        }
    }
    for (key, label) in &table.other {
        let Ok(code) = key.get_ref().parse::<u16>() else {
            let reason = format!("\"{}\" must be a number, the code of \"{label}\"", key.get_ref());
            problems.add(file, line(file, key), reason);
            continue;
        };
        if let Some(other) = choices.insert(code, label.clone()) {
            problems.add(file, line(file, key), format!("\"{label}\" has the code of {other}"));
        }
        profile.other_commands.insert(code, label.clone());
    }
    register.quantity.choices = choices;
    for (&command, other) in &table.elsewhere {
        elsewhere(file, command, other, profile, entries, problems);
    }
    for (&command, row) in &table.first {
        first(file, command, row, profile, entries, problems);
    }
    let moves = entries.names(file, &table.moves, problems);
    profile.moving = moves.iter().filter_map(|name| entries.find(name)?.place).collect();
}

/// A command in a register of its own.
fn elsewhere(
    file: &File,
    command: Command,
    table: &Elsewhere,
    profile: &mut Profile,
    entries: &mut Entries,
    problems: &mut Problems,
) {
    let (place, code) = (line(file, &table.register), *table.code.get_ref());
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    if profile.kind == UnitKind::Rectifier && !for_rectifiers(command) {
        problems.add(file, place, format!("a rectifier feeds no motor: it has no {}", command.name()));
    }
    // Without an address of its own it would go to the command register, where the word means something else.
    let Some(address) = register.place else {
        problems.add(file, place, format!("{} takes {}, so it needs an address", register.name, command.name()));
        return;
    };
    if profile.command_address == Some(address) {
        let reason =
            format!("{} is the command register: give {} with [commands.codes]", register.name, command.name());
        problems.add(file, place, reason);
        return;
    }
    let word = check(file, line(file, &table.code), &register.quantity, &register.name, code.into());
    if problems.keep(word).is_none() {
        return;
    }
    let same = profile.commands.iter().find(|(_, known)| known.elsewhere == Some(address) && known.code == code);
    if let Some((other, _)) = same {
        let reason = format!("{} has the code of {}", command.name(), other.name());
        problems.add(file, line(file, &table.code), reason);
    }
    register.quantity.choices.insert(code, command.name().to_owned());
    let known = CommandCode { code, verified: true, elsewhere: Some(address), first: None };
    if profile.commands.insert(command, known).is_some() {
        problems.add(file, place, format!("{} is there twice", command.name()));
    }
}

/// Whether what is written before them tells `one` and the command called `other` apart, which have the same word.
fn told_apart(table: &Commands, one: Command, other: &str) -> bool {
    let before =
        |command: Command| Some(table.first.get(&command)?).map(|row| (row.register.get_ref(), row.code.get_ref()));
    let other = other.parse().ok().and_then(before);
    matches!((before(one), other), (Some((here, code)), Some((there, word))) if here == there && code != word)
}

/// What is written before the word of a command.
fn first(
    file: &File,
    command: Command,
    table: &Elsewhere,
    profile: &mut Profile,
    entries: &Entries,
    problems: &mut Problems,
) {
    let (place, code) = (line(file, &table.register), *table.code.get_ref());
    let Some(register) = entries.get(file, &table.register, problems) else { return };
    let word = check(file, line(file, &table.code), &register.quantity, &register.name, code.into());
    if problems.keep(word).is_none() {
        return;
    }
    if register.access == Access::Ro || register.words() != 1 {
        let reason = format!(
            "{} is written before {}, so it must have one word that can be written",
            register.name,
            command.name()
        );
        problems.add(file, place, reason);
    }
    let Some(at) = register.place else {
        problems.add(
            file,
            place,
            format!("{} is written before {}, so it needs an address", register.name, command.name()),
        );
        return;
    };
    match profile.commands.get_mut(&command) {
        Some(known) => known.first = Some((at, code)),
        None => problems.add(file, place, format!("there is no {} that this could come before", command.name())),
    }
}

/// Whether a unit without a motor can have `command`.
pub(super) fn for_rectifiers(command: Command) -> bool {
    matches!(command, Command::RunForward | Command::Stop | Command::Coast | Command::ResetFault)
}

/// The state word, by its values or by its bits.
pub(super) fn state(
    file: &File,
    manifest: &Manifest,
    profile: &mut Profile,
    entries: &mut Entries,
    problems: &mut Problems,
) {
    let Some(spanned) = &manifest.state else { return };
    let table = spanned.get_ref();
    if !table.verified && table.note.is_empty() {
        problems.add(file, line(file, spanned), "states that are not verified need a \"note\" that says why");
    }
    if table.codes.is_empty() == table.when.is_empty() {
        let reason = "a state word needs either [state.codes] or [[state.when]]";
        problems.add(file, line(file, spanned), reason);
    }
    let mut rules = by_bits(file, manifest, table, entries, problems);
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    if !table.codes.is_empty() {
        register.quantity.choices.clear();
    }
    for (&state, spanned) in &table.codes {
        let code = *spanned.get_ref();
        let word = check(file, line(file, spanned), &register.quantity, &register.name, code.into());
        if problems.keep(word).is_none() {
            continue;
        }
        if let Some(other) = register.quantity.choices.insert(code, state.name().to_owned()) {
            problems.add(file, line(file, spanned), format!("{} has the code of {other}", state.name()));
        }
        rules.push(StateRule { state, mask: u16::MAX, value: code });
    }
    profile.state = Some(StateWord {
        register: register.name.clone(),
        rules,
        verified: table.verified,
        note: table.note.clone(),
        source: table.source.clone(),
    });
}

fn by_bits(
    file: &File,
    manifest: &Manifest,
    table: &States,
    entries: &Entries,
    problems: &mut Problems,
) -> Vec<StateRule> {
    let Some(register) = entries.find(table.register.get_ref()) else { return Vec::new() };
    let of_register = manifest.bits.iter().filter(|(name, _)| names(register).any(|own| own == name.get_ref()));
    let declared: Vec<_> = of_register.flat_map(|(_, fields)| fields).collect();
    let mut rules = Vec::new();
    for spanned in &table.when {
        let when = spanned.get_ref();
        let mut rule = StateRule { state: when.state, mask: 0, value: 0 };
        for (name, &value) in &when.fields {
            let Some(field) = register.bits.iter().find(|field| field.name == *name) else {
                // A field that is broken has a problem of its own.
                if declared.iter().any(|field| field.get_ref().name == *name) {
                    continue;
                }
                let closest = closest(name, register.bits.iter().map(|field| field.name.as_str())).unwrap_or("none");
                let reason = format!("{} has no bit field \"{name}\"; the closest is \"{closest}\"", register.name);
                problems.add(file, line(file, spanned), reason);
                continue;
            };
            if field.extract(field.insert(0, value)) != value {
                let reason = format!("{value} does not fit the {} bits of \"{name}\"", field.width);
                problems.add(file, line(file, spanned), reason);
            }
            rule.mask |= field.mask();
            rule.value = field.insert(rule.value, value);
        }
        rules.push(rule);
    }
    rules
}
