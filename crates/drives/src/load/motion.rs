//! What `profile.toml` says of commands and states: the words that move a motor, and those that tell what it does.

use std::collections::BTreeMap;

use super::File;
use super::entries::Entries;
use super::facts::check;
use super::manifest::{Elsewhere, Manifest, States, Word, line};
use super::placed::Placed;
use super::problems::Problems;
use super::words;
use crate::entry::{Access, Kind};
use crate::parts::command::{Command, CommandCode};
use crate::parts::rules::UnitKind;
use crate::parts::state::{State, StateRule, StateWord};
use crate::parts::unlock::Unlock;
use crate::place::{Place, Table};
use crate::profile::Profile;

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
    let mut all: Vec<(Command, &Placed<Word>, bool)> = Vec::new();
    all.extend(table.codes.iter().map(|(&command, code)| (command, code, true)));
    if let Some(assumed) = &table.assumed {
        all.extend(assumed.codes.iter().map(|(&command, code)| (command, code, false)));
        profile.commands_note.clone_from(assumed.reason.get_ref());
        if assumed.reason.get_ref().trim().is_empty() {
            problems.add(file, line(file, &assumed.reason), "\"reason\" is empty; say why these codes are assumed");
        }
    }
    let before = |(&command, row)| (command, first(file, manifest, command, row, entries, problems));
    let before: Before = table.first.iter().map(before).collect();
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    profile.command_address = register.place;
    register.quantity.choices.clear();
    let base = table.base.as_ref();
    let base = base.map_or(0, |base| words::word(file, base, 0, register, manifest, problems));
    let mut choices: BTreeMap<u16, String> = BTreeMap::new();
    for (command, spanned, verified) in all {
        let code = words::word(file, spanned, base, register, manifest, problems);
        if profile.kind == UnitKind::Rectifier && !for_rectifiers(command) {
            let reason = format!("a rectifier feeds no motor: it has no {}", command.name());
            problems.add(file, line(file, spanned), reason);
        }
        let word = check(file, line(file, spanned), &register.quantity, &register.name, code.into());
        if problems.keep(word).is_none() {
            continue;
        }
        let label = match choices.get(&code) {
            Some(other) if told_apart(&before, command, other) => format!("{other} or {}", command.name()),
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
        let Some(code) = number(key.get_ref()) else {
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
        elsewhere(file, manifest, command, other, profile, entries, problems);
    }
    for (command, row) in &table.first {
        if let Some(known) = profile.commands.get_mut(command) {
            known.first = before.get(command).copied().flatten();
        } else {
            let reason = format!("there is no {} that this could come before", command.name());
            problems.add(file, line(file, &row.register), reason);
        }
    }
    let moves = entries.names(file, &table.moves, problems);
    profile.moving = moves.iter().filter_map(|name| entries.find(name)?.place).collect();
}

/// A command in a register of its own.
fn elsewhere(
    file: &File,
    manifest: &Manifest,
    command: Command,
    table: &Elsewhere,
    profile: &mut Profile,
    entries: &mut Entries,
    problems: &mut Problems,
) {
    let place = line(file, &table.register);
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    let code = words::word(file, &table.code, 0, register, manifest, problems);
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

/// What is written before commands: where, and the word. `None` is what cannot be read, which has a problem of its own.
type Before = BTreeMap<Command, Option<(Place, u16)>>;

/// Whether what is written `before` them tells `one` and the command called `other` apart, which have the same word.
fn told_apart(before: &Before, one: Command, other: &str) -> bool {
    let other = other.parse().ok().and_then(|other: Command| before.get(&other));
    match (before.get(&one), other) {
        (Some(Some((here, code))), Some(Some((there, word)))) => here == there && code != word,
        (one, other) => one.is_some() && other.is_some(),
    }
}

/// What is written before the word of a command: where, and the word.
fn first(
    file: &File,
    manifest: &Manifest,
    command: Command,
    table: &Elsewhere,
    entries: &Entries,
    problems: &mut Problems,
) -> Option<(Place, u16)> {
    let place = line(file, &table.register);
    let register = entries.get(file, &table.register, problems)?;
    let code = words::word(file, &table.code, 0, register, manifest, problems);
    let word = check(file, line(file, &table.code), &register.quantity, &register.name, code.into());
    problems.keep(word)?;
    let mut needs = |what: &str| {
        let reason = format!("{} is written before {}, so it {what}", register.name, command.name());
        problems.add(file, place, reason);
    };
    if register.access == Access::Ro || register.words() != 1 {
        needs("must have one word that can be written");
    }
    if register.place.is_none() {
        needs("needs an address");
    }
    if !is_start(command) {
        needs("must come before a start: a stop and a reset wait for nothing");
    }
    Some((register.place?, code))
}

/// What the drive is told before it takes any other word. That must do nothing to a motor.
pub(super) fn unlock(
    file: &File,
    manifest: &Manifest,
    profile: &mut Profile,
    entries: &Entries,
    problems: &mut Problems,
) {
    let Some(spanned) = &manifest.unlock else { return };
    let table = spanned.get_ref();
    let mut place = |name: &Placed<String>, is_written: bool| {
        let entry = entries.get(file, name, problems)?;
        let place = entry.place.filter(|place| place.table == Table::Holding && entry.words() == 1);
        let is_reached = if is_written { entry.access != Access::Ro } else { entry.access != Access::Wo };
        let moves = place.is_some_and(|place| profile.moving.contains(&place) || profile.is_command(place));
        if place.is_none() || !is_reached || entry.kind != Kind::Register || is_written && moves {
            let does = if is_written { "written, and moves no motor" } else { "read" };
            let reason = format!("{} must be a holding register of one word that is {does}", entry.name);
            problems.add(file, line(file, name), reason);
        }
        place
    };
    let (register, shown) = (place(&table.register, true), place(&table.shown_by.register, false));
    if !(1..=0x7F).contains(&table.exception) {
        let reason = format!("exception {} must be 1 to 127", table.exception);
        problems.add(file, line(file, spanned), reason);
    }
    profile.unlock = register.zip(shown).map(|(place, shown)| Unlock {
        place,
        word: table.word,
        exception: table.exception,
        shown_by: (shown, table.shown_by.word),
        source: table.source.clone(),
    });
}

/// A word as a key of TOML has it, which is a text: `9`, or `0x0476`.
fn number(key: &str) -> Option<u16> {
    match key.strip_prefix("0x") {
        Some(digits) if digits.bytes().all(|digit| digit.is_ascii_hexdigit()) => u16::from_str_radix(digits, 16).ok(),
        _ => key.parse().ok(),
    }
}

/// Whether `command` makes a motor turn.
fn is_start(command: Command) -> bool {
    matches!(command, Command::RunForward | Command::RunReverse | Command::JogForward | Command::JogReverse)
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
    // Where each other word means something too, they are numbers.
    let is_number = table.otherwise.is_some();
    if !table.codes.is_empty() && !is_number {
        register.quantity.choices.clear();
    }
    for (&state, spanned) in &table.codes {
        let code = *spanned.get_ref();
        let word = check(file, line(file, spanned), &register.quantity, &register.name, code.into());
        if problems.keep(word).is_none() {
            continue;
        }
        let listed = (!is_number).then(|| register.quantity.choices.insert(code, state.name().to_owned())).flatten();
        if let Some(other) = listed {
            problems.add(file, line(file, spanned), format!("{} has the code of {other}", state.name()));
        }
        rules.push(StateRule { state, mask: u16::MAX, value: code });
    }
    profile.state = Some(StateWord {
        register: register.name.clone(),
        rules,
        otherwise: table.otherwise.unwrap_or(State::Unknown),
        rest_by_frequency: table.rest_by_frequency,
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
    let mut rules = Vec::new();
    for spanned in &table.when {
        let when = spanned.get_ref();
        let mut rule = StateRule { state: when.state, mask: 0, value: 0 };
        for (field, value) in words::fields(file, line(file, spanned), &when.fields, register, manifest, problems) {
            rule.mask |= field.mask();
            rule.value = field.insert(rule.value, value);
        }
        rules.push(rule);
    }
    rules
}
