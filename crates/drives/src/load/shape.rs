//! All that is wrong with the shape of `profile.toml`, where reading it ends at the first mistake.
//!
//! What is wrong is cut out, and the rest read again, until it is right: nobody has to mend one to see the next.

use std::mem;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, Deserializer, Error};

use super::problems::MOST;
use crate::text::closest;

/// What each profile has, and hardly another file has both of.
const OF_EACH: [&str; 2] = ["name", "source"];

/// What is wrong with `text` as a `T`: the place in it, and the reason. Nothing if it is one.
pub(super) fn problems<T: DeserializeOwned>(text: &str) -> Vec<(usize, String)> {
    let (mut table, errors) = DeTable::parse_recoverable(text);
    let place = |error: &Error| error.span().map_or(0, |span| span.start);
    if let Some(first) = errors.first() {
        // What the parser says after its first mistake may only follow from that.
        return vec![(place(first), in_words(first.message()))];
    }
    // What says neither its name nor its source may be anybody's file: nothing of it is repeated.
    let lacks = |wanted: &str| !table.get_ref().keys().any(|key| key.get_ref() == wanted);
    let lacking: Vec<_> =
        OF_EACH.into_iter().filter(|key| lacks(key)).map(|key| (0, missing(&format!("\"{key}\"")))).collect();
    if !lacking.is_empty() {
        return lacking;
    }
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut gone: Vec<String> = Vec::new();
    while let Err(error) = T::deserialize(Deserializer::from(table.clone())) {
        let reason = in_words(error.message());
        // What is misspelt is not missing too.
        gone.extend(reason.split_once("closest is ").map(|(_, quoted)| missing(quoted)));
        found.push((place(&error), reason));
        match cut_out(table.get_mut(), place(&error)) {
            Some(key) if found.len() < MOST => gone.push(missing(&format!("\"{key}\""))),
            _ => break,
        }
    }
    found.retain(|(_, reason)| !gone.contains(reason));
    found.sort();
    found
}

/// Takes the smallest part that has `place` in it out of `table`; the key that it had there.
fn cut_out(table: &mut DeTable<'_>, place: usize) -> Option<String> {
    let mut cut = None;
    for (key, value) in table.iter_mut() {
        if !key.span().contains(&place) {
            if let Some(inside) = cut_out_inside(value, place) {
                return Some(inside);
            }
            if !value.span().contains(&place) {
                continue;
            }
        }
        cut = Some(key.clone());
        break;
    }
    let key = cut?;
    table.remove(&key);
    Some(key.into_inner().into_owned())
}

fn cut_out_inside(value: &mut Spanned<DeValue<'_>>, place: usize) -> Option<String> {
    match value.get_mut() {
        DeValue::Table(table) => cut_out(table, place),
        DeValue::Array(items) => {
            if let Some(inside) = items.iter_mut().find_map(|item| cut_out_inside(item, place)) {
                return Some(inside);
            }
            let before = items.len();
            let all = mem::replace(items, DeArray::new());
            *items = all.into_iter().filter(|item| !item.span().contains(&place)).collect();
            (items.len() < before).then(String::new)
        }
        _ => None,
    }
}

fn missing(quoted: &str) -> String {
    format!("{quoted} is missing")
}

/// What the reader says of a key or a word that it does not know, with the closest that it knows.
fn in_words(message: &str) -> String {
    let message = message.trim();
    let mut quoted = message.split('`').skip(1).step_by(2);
    let said = |start: &str| message.starts_with(start);
    match quoted.next() {
        Some(wrong) if said("unknown field") => match closest(wrong, quoted) {
            Some(closest) => format!("unknown key \"{wrong}\"; the closest is \"{closest}\""),
            None => format!("unknown key \"{wrong}\""),
        },
        Some(wrong) if said("unknown variant") => {
            let known: Vec<&str> = quoted.collect();
            let closest = closest(wrong, known.iter().copied()).unwrap_or_default();
            format!("\"{wrong}\" must be one of {}; the closest is \"{closest}\"", known.join(", "))
        }
        Some(key) if said("missing field") => missing(&format!("\"{key}\"")),
        Some("\"") if said("invalid basic string") => "text has no closing \" in its line".to_owned(),
        _ => [("u8", "a number, 0 to 255"), ("u16", "a number, 0 to 65535"), ("u32", "a number from 0")]
            .iter()
            .find_map(|(kind, plain)| {
                Some(format!("{}expected {plain}", message.strip_suffix(&format!("expected {kind}"))?))
            })
            .unwrap_or_else(|| message.to_owned()),
    }
}
