//! The figures in the README of `drivebus-rtu` are those of the code: bytes by `size_of`, instructions by what `make counts`
//! holds.
#![cfg(target_pointer_width = "64")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use drivebus_rtu::{Agreement, Conversation, Framer, Known, Master, Slave, Sniffer};

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).unwrap()
}

/// The first two columns of the table under `title`: what is in backquotes, and a number written with spaces.
fn table(title: &str) -> BTreeMap<String, usize> {
    let readme = read("crates/rtu/README.md");
    let (_, section) = readme.split_once(&format!("\n## {title}\n")).unwrap();
    let rows = section.lines().take_while(|line| !line.starts_with("## ")).filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| {
        let (name, rest) = row.split_once('`').unwrap();
        let cells: Vec<_> = rest.split('|').map(str::trim).collect();
        (name.to_owned(), cells[1].replace(' ', "").parse().unwrap())
    })
    .collect()
}

#[test]
fn the_readme_says_the_bytes_of_each_state_machine() {
    let sizes = [
        ("Master", size_of::<Master>()),
        ("Known<1, 16>", size_of::<Known<1, 16>>()),
        ("Known<4, 16>", size_of::<Known<4, 16>>()),
        ("Known<247, 1024>", size_of::<Known<247, 1024>>()),
        ("Conversation", size_of::<Conversation<'static>>()),
        ("Slave", size_of::<Slave>()),
        ("Framer", size_of::<Framer>()),
        ("Sniffer", size_of::<Sniffer>()),
        ("Agreement", size_of::<Agreement>()),
    ];
    assert_eq!(table("RAM"), sizes.map(|(name, size)| (name.to_owned(), size)).into());
}

#[test]
fn the_readme_says_the_instructions_that_are_counted() {
    let counts = read("benches/rust/counts.txt");
    let counted: BTreeMap<_, usize> = counts
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter_map(|(name, count)| Some((name, count.trim().parse().ok()?)))
        .collect();
    let told = table("Instructions");
    assert!(told.len() >= 6, "{told:?}");
    for (name, instructions) in told {
        let bound = counted[name.as_str()];
        // Rounded for people, and a count goes up and down a little with every change.
        assert!(
            instructions.abs_diff(bound) * 20 <= bound,
            "{name}: the README says {instructions}, {bound} are counted"
        );
    }
}
