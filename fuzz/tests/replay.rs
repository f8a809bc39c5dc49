//! Every file of the corpus through its target, as an ordinary test.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, panic};

use drivebus_fuzz::{TARGETS, Target};

/// More than this does not belong into the repository.
const MOST_BYTES: u64 = 1024 * 1024;

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

fn replay(name: &str) {
    let (_, target): (_, Target) = *TARGETS.iter().find(|(known, _)| *known == name).unwrap();
    let files: Vec<PathBuf> = fs::read_dir(corpus().join(name)).unwrap().map(|file| file.unwrap().path()).collect();
    assert!(files.len() >= 4, "{name}: the corpus has only {} files", files.len());
    for file in files {
        let data = fs::read(&file).unwrap();
        let outcome = panic::catch_unwind(|| target(&data));
        assert!(outcome.is_ok(), "{} breaks the invariant of {name}", file.display());
    }
}

macro_rules! replays {
    ($($name:ident)*) => {
        $(#[test] fn $name() { replay(stringify!($name)); })*

        #[test]
        fn every_target_is_replayed_and_has_a_program() {
            let here = BTreeSet::from([$(stringify!($name)),*]);
            let targets: BTreeSet<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
            assert_eq!(targets, here);
            for name in targets {
                assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("targets/{name}.rs")).is_file(), "{name}");
            }
        }
    };
}

replays!(bus conversation frame framer gateway guest listener master operation profile slave sniffer);

#[test]
fn the_corpus_stays_small() {
    let folders = fs::read_dir(corpus()).unwrap().map(|folder| folder.unwrap().path());
    let files = folders.flat_map(|folder| fs::read_dir(folder).unwrap());
    let bytes: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
    assert!(bytes < MOST_BYTES, "{bytes} bytes");
}
