//! Words made of bit fields: what a table of fields says of the bits of a register, and whole words for commands.

use std::collections::BTreeMap;

use super::File;
use super::manifest::{Manifest, Word, line};
use super::placed::Placed;
use super::problems::Problems;
use crate::bits::BitField;
use crate::entry::{Entry, names};
use crate::text::closest;

/// The bit fields of `register` that `fields`, at `place` of `file`, names, with what they hold. What is no field of it, or
/// does not fit, is a problem.
pub(super) fn fields<'a>(
    file: &File,
    place: u64,
    fields: &BTreeMap<String, u16>,
    register: &'a Entry,
    manifest: &Manifest,
    problems: &mut Problems,
) -> Vec<(&'a BitField, u16)> {
    let of_register = manifest.bits.iter().filter(|(name, _)| names(register).any(|own| own == name.get_ref()));
    let declared: Vec<_> = of_register.flat_map(|(_, fields)| fields).collect();
    let mut known = Vec::new();
    for (name, &value) in fields {
        let Some(field) = register.bits.iter().find(|field| field.name == *name) else {
            // A field that is broken has a problem of its own.
            if declared.iter().any(|field| field.get_ref().name == *name) {
                continue;
            }
            let closest = closest(name, register.bits.iter().map(|field| field.name.as_str())).unwrap_or("none");
            let reason = format!("{} has no bit field \"{name}\"; the closest is \"{closest}\"", register.name);
            problems.add(file, place, reason);
            continue;
        };
        if field.extract(field.insert(0, value)) != value {
            problems.add(file, place, format!("{value} does not fit the {} bits of \"{name}\"", field.width));
        }
        known.push((field, value));
    }
    known
}

/// The whole word that `word` is at `register`. Bits that no field of a table names are those of `base`; a number is whole
/// by itself.
pub(super) fn word(
    file: &File,
    word: &Placed<Word>,
    base: u16,
    register: &Entry,
    manifest: &Manifest,
    problems: &mut Problems,
) -> u16 {
    match word.get_ref() {
        Word::Number(number) => *number,
        Word::Fields(table) => fields(file, line(file, word), table, register, manifest, problems)
            .into_iter()
            .fold(base, |word, (field, value)| field.insert(word, value)),
    }
}
