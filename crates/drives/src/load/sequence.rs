//! The words that a drive wants, one after the other, before one that runs the motor.

use super::File;
use super::entries::Entries;
use super::facts::check;
use super::manifest::{Manifest, line};
use super::problems::Problems;
use super::words;
use crate::parts::command::{Command, StartWord, Until};
use crate::profile::Profile;

/// Commands that a word of the sequence may be as well: they end a motion, and begin none.
const HALTS: [Command; 3] = [Command::Stop, Command::Coast, Command::JogStop];

/// Reads the sequence, after commands and states.
pub(super) fn sequence(
    file: &File,
    manifest: &Manifest,
    profile: &mut Profile,
    entries: &mut Entries,
    problems: &mut Problems,
) {
    let Some(table) = &manifest.commands else { return };
    profile.start_sequence.clear();
    for spanned in &table.sequence {
        let (row, place) = (spanned.get_ref(), line(file, spanned));
        let Some(register) = entries.find(table.register.get_ref()) else { return };
        // What is wrong with the base was said where the commands were read.
        let known = &mut Problems::default();
        let base = table.base.as_ref().map_or(0, |base| words::word(file, base, 0, register, manifest, known));
        let word = words::word(file, &row.word, base, register, manifest, problems);
        let checked = check(file, place, &register.quantity, &register.name, word.into());
        if problems.keep(checked).is_none() {
            continue;
        }
        if row.label.trim().is_empty() {
            problems.add(file, place, "\"label\" is empty; say what the word does");
        }
        if let Some(reason) = taken(profile, word) {
            problems.add(file, place, reason);
        }
        if row.until.is_empty() {
            problems.add(file, place, "\"until\" is empty, so nothing would tell that the drive has taken the word");
        }
        let state = profile.state.as_ref().and_then(|state| entries.find(&state.register));
        let Some(state) = state else {
            problems.add(file, place, "\"until\" names bits of the state word, and there is no [state]");
            continue;
        };
        let until = words::fields(file, place, &row.until, state, manifest, problems);
        let until = until.into_iter().map(|(field, value)| Until {
            field: field.name.clone(),
            mask: field.mask(),
            value: field.insert(0, value),
        });
        profile.start_sequence.push(StartWord { word, label: row.label.clone(), until: until.collect() });
    }
    let Some(register) = entries.get_mut(file, &table.register, problems) else { return };
    for step in &profile.start_sequence {
        register.quantity.choices.entry(step.word).or_insert_with(|| step.label.clone());
    }
}

/// Why `word` cannot be the next of the sequence.
fn taken(profile: &Profile, word: u16) -> Option<String> {
    if profile.start_sequence.iter().any(|known| known.word == word) {
        return Some(format!("{word} is in the sequence already, and no word is sent twice"));
    }
    if let Some(label) = profile.other_commands.get(&word) {
        return Some(format!("{word} has the code of \"{label}\""));
    }
    let command = profile.command_of(word).filter(|command| !HALTS.contains(command))?;
    Some(format!("{word} has the code of {}, which is given when the sequence is over, or alone", command.name()))
}
