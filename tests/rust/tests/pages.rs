//! The first page of each published crate says what it is, shows an example, and tells its features and its limits; the
//! features are those of its `Cargo.toml`, here and in its README.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

const PUBLISHED: [&str; 5] = ["rtu", "line", "drives", "sim", "drivebus"];

fn read(published: &str, path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates").join(published).join(path)).unwrap()
}

/// What `cargo doc` shows first: the words at the top of `lib.rs`, or the README where that is included there.
fn page(published: &str) -> String {
    let source = read(published, "src/lib.rs");
    if source.starts_with("#![doc = include_str!(") {
        return read(published, "README.md");
    }
    let lines =
        source.lines().map_while(|line| line.strip_prefix("//!")).map(|line| line.strip_prefix(' ').unwrap_or(line));
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// What stands under a heading, up to the next one of the same rank or a higher one.
fn section<'a>(page: &'a str, title: &str) -> Option<&'a str> {
    let (_, rest) = page.split_once(&format!("# {title}\n"))?;
    rest.split("\n# ").next()?.split("\n## ").next()
}

fn features(published: &str) -> BTreeSet<String> {
    let manifest: toml::Table = toml::from_str(&read(published, "Cargo.toml")).unwrap();
    let features = manifest.get("features").and_then(|features| features.as_table());
    features.into_iter().flat_map(toml::Table::keys).filter(|name| *name != "default").cloned().collect()
}

#[test]
fn each_page_has_its_parts() {
    for published in PUBLISHED {
        let page = page(published);
        let mut paragraphs = page.split("\n\n").filter(|paragraph| !paragraph.starts_with('#'));
        assert!(
            paragraphs.next().is_some_and(|first| first.trim_end().ends_with('.')),
            "{published} opens with a sentence"
        );
        assert!(page.contains("\n```"), "{published} has an example");
        for title in ["Features", "Limits"] {
            assert!(section(&page, title).is_some_and(|text| text.len() > 20), "{published}: {title}");
        }
    }
}

#[test]
fn the_features_are_those_of_the_manifest() {
    for published in PUBLISHED {
        let page = page(published);
        let told = section(&page, "Features").unwrap();
        let readme = read(published, "README.md");
        let line = readme.lines().find(|line| line.starts_with("Feature")).unwrap_or_default();
        let features = features(published);
        if features.is_empty() {
            assert!(told.trim_start().starts_with("None"), "{published}: {told}");
        }
        for feature in features {
            let quoted = format!("`{feature}`");
            assert!(told.contains(&quoted), "{published}: the page leaves out {quoted}");
            assert!(line.contains(&quoted), "{published}: the README leaves out {quoted}");
        }
    }
}
