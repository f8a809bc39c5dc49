//! Broken profiles: file, line and reason, and never a panic.

use std::fs;
use std::path::Path;

use drivebus_drives::{Profile, ProfileError};
use proptest::prelude::*;

use crate::folder::Folder;

const FILES: [&str; 4] = ["profile.toml", "registers.csv", "parameters.csv", "faults.csv"];

fn shipped(file: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles/gd350").join(file)).unwrap()
}

/// A folder with a copy of the shipped profile.
fn copy(name: &str) -> Folder {
    let texts = FILES.map(|file| (file, shipped(file)));
    Folder::new(&format!("broken-{name}"), &texts.each_ref().map(|(file, text)| (*file, text.as_str())))
}

/// The line, from 1, of the first place where `text` holds `part`.
fn line_of(text: &str, part: &str) -> u64 {
    let start = text.find(part).unwrap();
    u64::try_from(text[..start].matches('\n').count()).unwrap() + 1
}

#[test]
fn the_shipped_folder_loads_as_the_shipped_profile() {
    let copy = copy("same");
    assert_eq!(copy.load().unwrap(), *Profile::builtin("gd350").unwrap());
    // Some editors put a mark before UTF-8, and some systems end lines with two characters.
    for file in FILES {
        copy.write(file, format!("\u{feff}{}", shipped(file).replace('\n', "\r\n")));
    }
    assert_eq!(copy.load().unwrap(), *Profile::builtin("gd350").unwrap());
}

#[test]
fn every_mistake_names_file_line_and_reason() {
    let copy = copy("broken");
    for (file, right, wrong, reason) in [
        // The shape of profile.toml.
        ("profile.toml", "title = \"INVT Goodrive350\"", "title = 350", "string"),
        ("profile.toml", "max_words = 16", "max_words = 16\nmin_words = 1", "min_words"),
        ("profile.toml", "max_words = 16", "max_words = ", "string"),
        ("profile.toml", "address = \"group.index\"", "address = \"linear\"", "linear"),
        ("profile.toml", "jog_stop = 8", "jump = 8", "jump"),
        ("profile.toml", "jog_stop = 8", "jog_stop = \"8H\"", "string \"8H\", expected a number, 0 to 65535"),
        ("profile.toml", "pre_exciting = 6", "dreaming = 6", "dreaming"),
        ("profile.toml", "pre_exciting = 6", "unknown = 6", "unknown"),
        // What profile.toml says by itself.
        ("profile.toml", "name = \"gd350\"", "name = \"GD 350\"", "GD 350"),
        ("profile.toml", "max_words = 16", "max_words = 0", "1 to 125"),
        ("profile.toml", "max_words = 16", "max_words = 16\nmax_written = 17", "1 to 16"),
        ("profile.toml", "max_words = 16", "max_words = 16\nmax_written = 0", "1 to 16"),
        ("profile.toml", ", 0x10]\nmax_words = 16\n", "]\nmax_words = 16\n", "\"functions\" has no 0x10"),
        (
            "profile.toml",
            "joined = \"GD350 operation manual, chapter 9.4 (INVT ebook 2645), section 9.4.8\"",
            "joined = \"\"",
            "\"joined\" is empty",
        ),
        ("profile.toml", "bit = 15", "bit = 16", "8 to 15"),
        ("profile.toml", "format = \"8E1\"", "format = \"8X1\"", "8X1"),
        ("profile.toml", "format = \"8E1\"", "format = \"7N2\"", "Modbus RTU has 8 data bits"),
        ("profile.toml", "unit = 1", "unit = 248", "1 to 247"),
        ("profile.toml", "baud_rate = 19200", "baud_rate = 0", "50 to 10000000"),
        // What it says of the tables.
        ("profile.toml", "register = \"control_command\"", "register = \"control_comand\"", "control_command"),
        ("profile.toml", "    \"bus_voltage\",", "    \"buss_voltage\",", "bus_voltage"),
        ("profile.toml", "jog_stop = 8", "jog_stop = 9", "1 to 8"),
        ("profile.toml", "jog_stop = 8", "jog_stop = 7", "has the code of"),
        ("profile.toml", "status_word_2 = [", "status_word_9 = [", "status_word_"),
        ("profile.toml", "bits = [11, 10]", "bits = [10, 11]", "highest and the lowest"),
        ("profile.toml", "bits = [11, 10]", "bits = [11, 9]", "position_control"),
        ("profile.toml", "bits = [11, 10]", "bits = [11, 10, 9]", "the highest and the lowest bit"),
        ("profile.toml", "bits = [11, 10]", "bits = [11]", "the highest and the lowest bit"),
        ("profile.toml", "3 = \"SVPWM\"", "4 = \"SVPWM\"", "does not fit"),
        ("profile.toml", "3 = \"SVPWM\"", "three = \"SVPWM\"", "three"),
        ("profile.toml", "acts = [\"P00.15\"", "acts = [\"P00.99\"", "P00.99"),
        ("profile.toml", "timeout = \"P14.04\"", "timeout = \"P14.44\"", "P14.44"),
        ("profile.toml", "coast = 0", "coast = 4", "0 to 3"),
        ("profile.toml", "coast = 0", "coast = 0\nrun = 1", "run"),
        // Columns and cells.
        ("registers.csv", "address,name", "address,nombre", "nombre"),
        ("registers.csv", "address,name", "name,name", "address"),
        ("registers.csv", "0x2000,", "2000,", "0x3004"),
        ("registers.csv", "0x2000,", "0x2000,extra,", "14 cells where the first line has 13"),
        ("registers.csv", "0x2001,set_frequency", "0x2000,set_frequency", "2000H"),
        ("registers.csv", "0x2001,set_frequency", "0x2001,control_command", "twice"),
        ("registers.csv", "0x2001,set_frequency", "0xA001,set_frequency", "where a write is kept"),
        ("registers.csv", "set_frequency,", "SetFrequency,", "lower-case"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,3,no,0.00,630.00", "scale \"3\""),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,maybe,0.00,630.00", "yes or no"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,0.00,700.00", "does not fit a word"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,-1.00,630.00", "does not fit a word"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,0.00,1e99", "does not fit a word"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,0.001,630.00", "more digits than the scale"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,630.01,630.00", "above"),
        ("registers.csv", "Hz,100,no,0.00,630.00", "Hz,100,no,low,630.00", "not a number"),
        ("registers.csv", "P00.03,rw", "P00.33,rw", "P00.33"),
        ("registers.csv", "P00.03,rw", "P00.03,rx", "rw, ro, wo"),
        ("parameters.csv", "P00.11,", "P99.11,", "closed"),
        ("parameters.csv", "P00.11,", "P0011,", "P05.06"),
        ("parameters.csv", "0=off;1=on", "\"0=off,1=on\"", "by semicolons"),
        ("parameters.csv", "P00.12,", "P00.11,", "twice"),
        ("parameters.csv", "2=communication", "two=communication", "2=communication"),
        ("parameters.csv", "0=off;1=on", "0=off;0=on", "twice"),
        ("parameters.csv", "0=off;1=on", "0=1;1=on", "the number of another choice"),
        ("parameters.csv", ",50.00,stop", ",50.001,stop", "more digits"),
        ("faults.csv", "11,OL1", "ten,OL1", "ten"),
        ("faults.csv", "11,OL1", "10,OL1", "twice"),
        ("faults.csv", "11,OL1,Motor overload", "11,OL1,", "\"label\" is empty"),
    ] {
        let text = shipped(file);
        let broken = text.replacen(right, wrong, 1);
        assert_ne!(broken, text, "{right:?} is not in {file}");
        copy.write(file, &broken);
        match copy.load() {
            Err(ProfileError::Broken { file: named, line, reason: said }) => {
                assert!(named.ends_with(file), "{wrong}: {named}: {said}");
                let added = wrong.matches('\n').count() as u64;
                assert_eq!(line, line_of(&text, right) + added, "{wrong}: {said}");
                assert!(said.contains(reason), "{wrong}: {said}");
            }
            other => panic!("{file} with {wrong:?}: {other:?}"),
        }
        copy.write(file, &text);
    }
}

#[test]
fn repeated_rows_of_the_manifest_are_named_by_their_line() {
    let copy = copy("repeated");
    let text = shipped("profile.toml");
    for (row, reason) in [
        ("[[exceptions]]\ncode = 0x01\nname = \"x\"\nmeaning = \"x\"\nsource = \"x\"\n", "01H is there twice"),
        (
            "[[identification.codes]]\ncode = 0x01A0\nfamily = \"x\"\ntitle = \"x\"\nverified = true\nsource = \"x\"\n",
            "01A0H is there twice",
        ),
        ("[[control]]\ncode = \"P00.1\"\nvalue = 2\nlabel = \"x\"\nverified = true\nsource = \"x\"\n", "P00.01"),
        ("[[control]]\ncode = \"P00.01\"\nvalue = 3\nlabel = \"x\"\nverified = true\nsource = \"x\"\n", "0 to 2"),
    ] {
        copy.write("profile.toml", format!("{text}\n{row}"));
        match copy.load() {
            Err(ProfileError::Broken { line, reason: said, .. }) => {
                let first = text.matches('\n').count() as u64 + 2;
                assert!((first..first + 3).contains(&line), "line {line}, not {first}: {said}");
                assert!(said.contains(reason), "{said}");
            }
            other => panic!("{row}: {other:?}"),
        }
    }
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let copy = copy("unreadable");
    for file in FILES {
        fs::remove_file(copy.0.join(file)).unwrap();
        match copy.load() {
            Err(ProfileError::Unreadable { file: named, .. }) => assert!(named.ends_with(file), "{named}"),
            other => panic!("{file}: {other:?}"),
        }
        copy.write(file, [b"a\nb\n".as_slice(), &[0xFF]].concat());
        match copy.load() {
            Err(ProfileError::Broken { file: named, line: 3, reason }) => {
                assert!(named.ends_with(file) && reason.contains("UTF-8"), "{named}: {reason}");
            }
            other => panic!("{file}: {other:?}"),
        }
        copy.write(file, "");
        assert!(matches!(copy.load(), Err(ProfileError::Broken { line: 1, .. })), "{file}");
        copy.write(file, shipped(file));
    }
}

proptest! {
    // Each loads all files of a profile.
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Whatever is cut out of a file and put in its place: a profile or an error, never a panic.
    #[test]
    fn no_damage_panics(file in 0_usize..4, at in 0.0..1.0, cut in 0_usize..40, put in "[a-z0-9,=\"\\n\\[\\].-]{0,8}") {
        let copy = copy("damaged");
        let text = shipped(FILES[file]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "any place will do")]
        let start = (at * text.len() as f64) as usize;
        let end = (start + cut).min(text.len());
        copy.write(FILES[file], [&text.as_bytes()[..start], put.as_bytes(), &text.as_bytes()[end..]].concat());
        if let Err(error) = copy.load() {
            prop_assert!(error.to_string().contains(FILES[file]) || file > 0, "{}", error);
        }
    }
}

#[test]
fn a_watchdog_may_be_missing_and_must_not_be_empty() {
    let copy = copy("watchdog");
    let text = shipped("profile.toml");
    let (before, rest) = text.split_once("[watchdog]").unwrap();
    let (table, after) = rest.split_once("\n\n").unwrap();
    copy.write("profile.toml", format!("{before}\n\n{after}"));
    assert_eq!(copy.load().unwrap().watchdog(), None);
    let idle = table.replace("coast = 0\nstop = 3\n", "");
    assert_ne!(idle, table);
    copy.write("profile.toml", format!("{before}[watchdog]{idle}\n\n{after}"));
    assert!(copy.load().unwrap_err().to_string().contains("needs the value of \"coast\", \"stop\" or \"trip\""));
}

#[test]
fn what_counts_of_a_word_are_some_of_its_bits_that_nobody_sets_from_here() {
    let copy = copy("bits-of-a-setting");
    let text = shipped("profile.toml");
    let (before, after) = text.split_once("[[control]]\n").unwrap();
    let load = |rows: &str| {
        copy.write("profile.toml", format!("{before}[[control]]\n{rows}\n{after}"));
        copy.load().map(|profile| profile.control().first().map(|row| (row.found(0xFA5F), row.bits)))
    };
    assert_eq!(load("bits = [6, 4]\nby_hand = true").unwrap(), Some((0b101, Some([6, 4]))));
    assert_eq!(load("bits = [15, 0]\nby_hand = true").unwrap(), Some((0xFA5F, Some([15, 0]))));
    assert_eq!(load("").unwrap(), Some((0xFA5F, None)));
    for wrong in [
        "bits = [4, 6]\nby_hand = true",
        "bits = [16, 4]\nby_hand = true",
        "bits = [0, 0]\nby_hand = true", // the value is 2
        "bits = [6, 4]",
        "bits = [6, 4]\nby_hand = true\nsame = [3]",
    ] {
        let said = load(wrong).unwrap_err().to_string();
        assert!(said.contains("\"bits\" are [highest, lowest]"), "{wrong}: {said}");
    }
}
