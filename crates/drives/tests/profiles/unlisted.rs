//! Codes that no row lists: where they are, by hand for some and by the rule for all, and never where something else is.

use std::collections::BTreeSet;

use drivebus_drives::{Entry, Evidence, NameError, Profile, Store};

#[test]
fn a_code_tells_its_address() {
    for (family, code, called, address) in [
        ("gd350", "P05.01", "P05.01", 0x0501),
        ("gd350", "p5.01", "P05.01", 0x0501),
        ("gd350", "P98-99", "P98.99", 0x6263),
        ("gd600", "P10.10", "P10.10", 0x0A0A),
        ("gd3000", " P0501 ", "P05.01", 0x0501),
        // 2000H is a parameter's address in this family, and no command.
        ("vfd500", "P32.00", "P32.00", 0x2000),
        ("vfd500", "r27.30", "P27.30", 0x1B1E),
    ] {
        let profile = Profile::builtin(family).unwrap();
        let entry = profile.resolve(code).unwrap();
        assert_eq!(
            (entry.name(), entry.address(), entry.is_listed()),
            (called, Some(address), false),
            "{family} {code}"
        );
        assert_eq!((entry.evidence(), entry.quantity().unit(), entry.words()), (Evidence::Unverified, "raw", 1));
        assert_eq!((entry.encode(0xFFFF).unwrap(), entry.decode(0x8000).to_string()), (0xFFFF, "32768".to_owned()));
        assert!(entry.encode(65_536).is_err());
        assert!(matches!(profile.find(code), Err(NameError::Unknown { .. })), "{family} {code}: no row");
    }
}

#[test]
fn it_is_written_by_the_rule_of_its_family() {
    let places = |family: &str, code: &str| {
        let profile = Profile::builtin(family).unwrap();
        let entry = profile.resolve(code).unwrap();
        (profile.write_address(&entry, Store::Ram).ok(), profile.write_address(&entry, Store::Eeprom).ok())
    };
    // Opposite rules: bit 15 means RAM only here, and EEPROM there.
    assert_eq!(places("gd350", "P05.01"), (Some(0x8501.into()), Some(0x0501.into())));
    assert_eq!(places("vfd500", "P05.01"), (Some(0x0501.into()), Some(0x8501.into())));
    assert_eq!(places("gd3000", "P05.01"), (None, Some(0x0501.into())));
    // Nobody knows where this family takes its commands: P16.00 might be a start.
    assert_eq!(places("chv100", "P16.00"), (None, None));
    assert_eq!(Profile::builtin("chv100").unwrap().resolve("P16.00").unwrap().address(), Some(0x1000));
}

#[test]
fn what_is_no_code_of_the_family_stays_unknown() {
    let refused = |family: &str, name: &str| Profile::builtin(family).unwrap().resolve(name).unwrap_err().to_string();
    for (family, name, said) in [
        ("gd350", "P99.01", "the maker's own"),
        // It may be P05.10 as well.
        ("gd350", "P05.1", "may be P05.01 or P05.10"),
        ("gd350", "F0-12", "gd350 has no \"F0-12\""),
        ("gd350", "P100.01", "gd350 has no"),
        ("gd350", "P05.100", "gd350 has no"),
        // 2000H is the command register here.
        ("gd350", "P32.00", "gd350 has no"),
        ("gd350", "0x0501", "knows nothing at 0501H"),
        ("gd350", "0x8501", "knows nothing at 8501H"),
        ("gd350", "outputcurrent", "the closest is \"output_current\""),
        // The second word of r16.00.
        ("vfd500", "r16.01", "vfd500 has no"),
    ] {
        assert!(refused(family, name).contains(said), "{family} {name}: {}", refused(family, name));
    }
}

#[test]
fn in_every_family_each_code_without_a_row_is_where_nothing_else_is() {
    for name in Profile::builtin_names() {
        let profile = Profile::builtin(name).unwrap();
        let rows: BTreeSet<u16> = profile.entries().filter_map(Entry::address).collect();
        // Beyond 99 there is none, and no row has an index between 60 and 98: some numbers stand for all of these. What is
        // no code takes longest, for it looks for the closest name; so each group has three indices, others each time.
        let groups = (0..=100).chain([127, 128, 255_u8]);
        let indices = |group: u8| (group % 21..=60).step_by(21).chain([0, 1, 98, 99, 100, 128, 255]);
        for (group, index) in groups.flat_map(|group| indices(group).map(move |index| (group, index))) {
            let Ok(entry) = profile.resolve(&format!("P{group}.{index:02}")) else { continue };
            let address = entry.address().unwrap_or_else(|| panic!("{name} {}", entry.name()));
            if entry.is_listed() {
                continue;
            }
            assert_eq!(address, u16::from(group) << 8 | u16::from(index), "{name} {}", entry.name());
            assert!(group < 100 && index < 100, "{name} {}", entry.name());
            assert!(!rows.contains(&address), "{name} {}", entry.name());
            assert!(!profile.is_closed(address) && !profile.is_command(address), "{name} {}", entry.name());
            assert_eq!(profile.resolve(entry.name()).unwrap(), entry);
        }
    }
}
