//! Of each public type of the published crates it is decided whether it may grow: it is `#[non_exhaustive]`, or docs/developers/growing-types.md
//! says why it is whole. Read from the source, so that a new type is asked, too.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const PUBLISHED: [&str; 5] = ["rtu", "line", "drives", "sim", "drivebus"];

/// A public enum, or a struct of which at least one field is public.
struct Found {
    name: String,
    is_non_exhaustive: bool,
    /// The lines of its body.
    body: Vec<String>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The public types of one source file. rustfmt writes an item's first and last line at its margin, and `unreachable_pub`
/// has it that what is `pub` can be reached.
fn types(source: &str) -> Vec<Found> {
    let lines: Vec<_> = source.lines().collect();
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let text = line.trim_start();
        let Some(item) = text.strip_prefix("pub enum ").or_else(|| text.strip_prefix("pub struct ")) else { continue };
        let margin = line.len() - text.len();
        let end = format!("{:margin$}}}", "");
        let body: Vec<_> = if line.ends_with('{') {
            lines[at + 1..].iter().take_while(|line| **line != end).map(|line| (*line).to_owned()).collect()
        } else {
            item.split_once('(').map(|(_, fields)| fields.to_owned()).into_iter().collect()
        };
        let is_open = |line: &String| line.trim_start().starts_with("pub ");
        if text.starts_with("pub enum ") || body.iter().any(is_open) {
            let attributes = lines[..at].iter().rev().take_while(|line| !line.is_empty() && !line.ends_with('}'));
            found.push(Found {
                name: item.chars().take_while(|letter| letter.is_alphanumeric()).collect(),
                is_non_exhaustive: attributes.into_iter().any(|line| line.trim() == "#[non_exhaustive]"),
                body,
            });
        }
    }
    found
}

fn types_of(published: &str) -> Vec<Found> {
    let mut paths = Vec::new();
    files(&root().join("crates").join(published).join("src"), &mut paths);
    paths.iter().flat_map(|path| types(&fs::read_to_string(path).unwrap())).collect()
}

/// The names in the first column of the table under "What may grow".
fn whole_by_nature() -> BTreeSet<String> {
    let page = fs::read_to_string(root().join("docs/developers/growing-types.md")).unwrap();
    let (_, section) = page.split_once("\n## What may grow\n").unwrap();
    let rows = section.lines().take_while(|line| !line.starts_with("## ")).filter(|line| line.starts_with("| `"));
    let cells = rows.map(|row| row.split('|').nth(1).unwrap());
    cells.flat_map(|cell| cell.split('`').filter(|part| part.contains("::"))).map(str::to_owned).collect()
}

#[test]
fn each_public_type_may_grow_or_is_said_to_be_whole() {
    let mut whole = BTreeSet::new();
    for published in PUBLISHED {
        let found = types_of(published);
        whole.extend(found.iter().filter(|one| !one.is_non_exhaustive).map(|one| format!("{published}::{}", one.name)));
    }
    assert_eq!(whole, whole_by_nature());
}

#[test]
fn the_examples_know_each_variant_and_each_field() {
    let examples = fs::read_to_string(root().join("tests/rust/src/may_grow.rs")).unwrap();
    let calls = examples.split("!(").skip(1).map(|call| call.split_once(");").map_or("", |(call, _)| call));
    let mut known = 0;
    for call in calls.filter(|call| call.contains("\"drivebus::")) {
        let parts: Vec<_> = call.split(',').map(str::trim).collect();
        let path = parts[1].trim_matches('"').strip_prefix("drivebus::").unwrap();
        let (published, name) = path.split_once("::").unwrap();
        let all = types_of(published);
        let one = all.iter().find(|one| one.name == name).unwrap();
        let fields = one.body.iter().filter_map(|line| line.strip_prefix("    pub ")?.split(':').next());
        let variants = one.body.iter().filter_map(|line| line.strip_prefix("    ")).filter_map(|line| {
            let name = line.split(|letter: char| !letter.is_alphanumeric()).next()?;
            name.starts_with(|first: char| first.is_uppercase()).then_some(name)
        });
        let wanted: Vec<_> = fields.chain(variants).collect();
        let word = |part: &&str| part.trim_matches('"').split([' ', '(']).next().unwrap().to_owned();
        let given: Vec<_> = parts[2..].iter().filter(|part| !part.is_empty()).map(word).collect();
        assert_eq!(given, wanted, "{path}");
        known += 1;
    }
    assert!(known >= 12, "the examples are found: {known}");
}
