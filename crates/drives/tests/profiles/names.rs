//! Names as people type them.

use drivebus_drives::{NameError, Profile, ProfileError};
use proptest::prelude::*;

use crate::folder::Folder;

#[test]
fn registers_codes_and_addresses_are_found() {
    let profile = Profile::builtin("gd350").unwrap();
    for (name, address) in [
        ("output_current", 0x3004),
        ("Output_Current", 0x3004),
        (" output_current ", 0x3004),
        ("0x3004", 0x3004),
        ("3004H", 0x3004),
        ("3004h", 0x3004),
        ("p00.11", 0x000B),
        ("P0.11", 0x000B),
        ("p00-11", 0x000B),
        ("P0011", 0x000B),
        ("0x000B", 0x000B),
    ] {
        assert_eq!(profile.find(name).unwrap().address(), Some(address), "{name:?}");
    }
}

/// A spreadsheet takes P00.10 for a number, and drops the 0.
#[test]
fn a_code_that_lacks_a_digit_stands_for_none() {
    let profile = Profile::builtin("gd350").unwrap();
    for name in ["P00.1", "p0.1", "P00-1", "P00,1", "r00.1"] {
        assert!(matches!(profile.find(name), Err(NameError::Unclear { .. })), "{name}");
    }
    assert_eq!(profile.find("P00.1").unwrap_err().to_string(), "\"P00.1\" may be P00.01 or P00.10; write both digits");
    assert_eq!(profile.find("P4.0").unwrap().name(), profile.find("P04.00").unwrap().name());
}

#[test]
fn what_is_not_found_is_explained() {
    let profile = Profile::builtin("gd350").unwrap();
    let closest = |name: &str| match profile.find(name) {
        Err(NameError::Unknown { closest, .. }) => closest.join(", "),
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(closest("output_curent"), "output_current");
    assert_eq!(closest("setfrequency"), "set_frequency");
    assert!(closest("output_frequency").starts_with("running_frequency"), "{}", closest("output_frequency"));
    assert_eq!(closest("P00.13"), "P00.03", "the first of those one character away");
    assert_eq!(
        closest("frequency"),
        "set_frequency, fwd_upper_frequency, rev_upper_frequency, running_frequency, set_frequency_actual",
        "all that it may be a part of"
    );
    assert!(closest("curent").contains("output_current"), "{}", closest("curent"));
    for nothing_near in ["", "zzz", "nonsense"] {
        assert_eq!(closest(nothing_near), "", "{nothing_near:?}");
    }
    assert_eq!(profile.find("zzz").unwrap_err().to_string(), "gd350 has no \"zzz\"");
    for (number, said) in [
        ("40001", "; 40001 is register 0000H: name it 0x0000"),
        ("412289", "; 412289 is register 3000H: name it 0x3000"),
    ] {
        assert_eq!(profile.find(number).unwrap_err().to_string(), format!("gd350 has no \"{number}\"{said}"));
    }
    assert_eq!(
        profile.find("output_curent").unwrap_err().to_string(),
        "gd350 has no \"output_curent\"; the closest is \"output_current\""
    );
    assert!(matches!(profile.find("P99.01"), Err(NameError::Closed { .. })));
    assert!(matches!(profile.find("0x6301"), Err(NameError::Closed { .. })));
    assert!(matches!(profile.find("0x1234"), Err(NameError::UnknownAddress { address: 0x1234, .. })));
    let error = profile.find("8007H").unwrap_err();
    assert_eq!(error, NameError::WriteForm { address: 0x8007, name: "P00.07".to_owned() });
}

#[test]
fn builtin_profiles_go_by_name() {
    let names: Vec<&str> = Profile::builtin_names().collect();
    assert_eq!(names[..8], ["gd350", "gd35", "gd35-h1", "gd300", "gd10", "gd20", "gd100", "gd200a"]);
    assert_eq!(Profile::builtin("GD350").unwrap().title(), "INVT Goodrive350");
    let unknown = ProfileError::Unknown { name: "gd305".to_owned(), closest: "gd35".to_owned() };
    assert_eq!(Profile::builtin("gd305").unwrap_err(), unknown);
    for name in Profile::builtin_names() {
        assert_eq!(Profile::builtin(name).unwrap().name(), name);
    }
}

/// What stands on drives, and the profile that it leads to.
const CALLED: &[(&str, &str)] = &[
    ("Schneider Altivar 312", "atv312"),
    ("Altivar 12", "atv12"),
    ("ATV 12", "atv12"),
    ("Altivar 600", "atv600"),
    ("ATV630", "atv600"),
    ("Altivar 71", "atv71"),
    ("ATV 71", "atv71"),
    ("ATV61", "atv71"),
    ("altivar 61", "atv71"),
    ("Altivar 320", "atv320"),
    ("ATV320", "atv320"),
    ("Altivar Machine 320", "atv320"),
    ("altivar-312", "atv312"),
    ("ATV 312", "atv312"),
    ("VFD-MS300", "ms300"),
    ("C2000", "ms300"),
    ("C2000 Plus", "ms300"),
    ("cp 2000", "ms300"),
    ("MH300", "ms300"),
    ("gs20", "ms300"),
    ("Delta VFD-E", "vfd-e"),
    ("vfd-el", "vfd-e"),
    ("Mitsubishi FR-D700", "fr-d700"),
    ("Yaskawa J1000", "j1000"),
    ("GA700", "a1000"),
    ("ga-800", "a1000"),
    ("GA500", "a1000"),
    ("v1000", "a1000"),
    ("Q2A", "a1000"),
    ("Toshiba VF-S15", "vf-s15"),
    ("FRENIC-Ace", "frenic"),
    ("frenic mini", "frenic"),
    ("FRENIC-MEGA", "frenic"),
    ("Nowforever D100", "nowforever"),
    ("nowforever e100", "nowforever"),
    ("WEG CFW500", "cfw500"),
    ("CFW-500", "cfw500"),
    ("cfw11", "cfw500"),
    ("CFW 503", "cfw500"),
    ("vf-s11", "vf-s15"),
    ("JZA", "j1000"),
    ("Teco E510", "e510"),
    ("Teco F510", "f510"),
    ("Lenze smd", "smd"),
    ("ac tech smd", "smd"),
    ("LSLV-S100", "starvert"),
    ("ig5a", "starvert"),
    ("H100", "h100"),
    ("AutomationDirect GS2", "gs2"),
    ("gs3", "gs2"),
    ("GS4", "gs4"),
    ("VFD-B", "vfd-b"),
    ("Delta VFD-B", "vfd-b"),
    ("DURApulse GS4", "gs4"),
    ("AutomationDirect GS4", "gs4"),
    ("VACON 10", "vacon10"),
    ("m-max", "vacon10"),
    ("Teco-Westinghouse E510", "e510"),
    ("Teco-Westinghouse F510", "f510"),
    ("FR-D740", "fr-d700"),
    ("fr e740", "fr-d700"),
    ("FR-E800", "fr-d700"),
    ("fr-a800", "fr-d700"),
    ("FR CS80", "fr-d700"),
    ("Inovance MD500", "md500"),
    ("md500-plus", "md500"),
    ("Mollom G70", "md500"),
    ("Yalang YL620", "yl620"),
    ("YL620-A", "yl620"),
    ("yl600", "yl620"),
    ("acs550", "acs355"),
    ("ACH550", "acs355"),
    ("ABB ACS580", "acs580"),
    ("ACS180", "acs580"),
    ("Invertek Optidrive E3", "optidrive-e3"),
    ("ODE-3", "optidrive-e3"),
    ("Invertek Optidrive P2", "optidrive-p2"),
    ("ODP-2", "optidrive-p2"),
    ("PowerXL DC1", "dc1"),
    ("Eaton DC1", "dc1"),
    ("DE1", "dc1"),
    ("PowerXL DE1", "dc1"),
    ("Hitachi SJ200", "sj200"),
    ("Hitachi L200", "sj200"),
    ("Hitachi X200", "x200"),
    ("FC 202", "fc202"),
    ("VLT FC 102", "fc202"),
    ("FC-302", "fc202"),
    ("Goodrive35-H1", "gd35-h1"),
    ("GOODRIVE 350", "gd350"),
    ("SINAMICS V20", "v20"),
    ("huanyang gt", "chf100a"),
    ("Huanyang HY", "huanyang-hy"),
    ("HY02D223B", "huanyang-hy"),
    ("Dema D5M", "huanyang-hy"),
    ("Fuling DZB200", "chf100a"),
];

/// What stands on a drive leads to its profile, whatever its case, blanks and signs.
#[test]
fn builtin_profiles_go_by_what_their_drives_are_called() {
    for &(called, name) in CALLED {
        assert_eq!(Profile::builtin(called).unwrap().name(), name, "{called}");
    }
    for unknown in
        ["", " - ", "INVT", "Altivar", "Huanyang", "GT", "ATV340", "GS10", "FR-D800", "Goodrive3500", "Goodrive600"]
    {
        assert!(matches!(Profile::builtin(unknown), Err(ProfileError::Unknown { .. })), "{unknown}");
    }
}

/// No two families go by one name, and each other name says why it is one.
#[test]
fn each_name_of_a_drive_leads_to_one_family() {
    let folded = |name: &str| name.chars().filter(|one| one.is_alphanumeric()).collect::<String>().to_lowercase();
    let mut homes = std::collections::BTreeMap::new();
    for family in Profile::builtin_names() {
        let profile = Profile::builtin(family).unwrap();
        let called = profile.called();
        let alone = profile.title().strip_prefix(&called.maker).unwrap();
        let aliases = called.aliases.iter().map(|alias| &*alias.name);
        for name in
            [family, profile.title(), alone].into_iter().chain(called.models.iter().map(|name| &**name)).chain(aliases)
        {
            let other = homes.insert(folded(name), family);
            assert!(other.is_none_or(|other| other == family), "{name} is {other:?} and {family}");
        }
        assert!(called.aliases.iter().all(|alias| !alias.source.is_empty() && !alias.note.is_empty()), "{family}");
    }
}

/// A sister family has names of its own; what adds to a profile keeps them.
#[test]
fn names_go_with_the_family() {
    let folder = Folder::new("called", &[]);
    let write = |text: &str| folder.write("profile.toml", text);
    write("name = \"mine\"\nsource = \"own\"\n[overlay]\nprofile = \"chf100a\"\n");
    assert_eq!(folder.load().unwrap().called(), Profile::builtin("chf100a").unwrap().called());
    let sister = "version = 1\n[extends]\nprofile = \"chf100a\"\nassumption = \"a sister\"\n";
    write(&format!("name = \"mine\"\nsource = \"own\"\nmodels = [\"X-1\"]\n{sister}"));
    let loaded = folder.load().unwrap();
    let called = loaded.called();
    assert_eq!((&*called.maker, called.models.clone(), called.aliases.len()), ("INVT", vec!["X-1".to_owned()], 0));
    for (wrong, line) in
        [("maker = \"-\"", 3), ("models = [\"a\", \" \"]", 3), ("[[aliases]]\nname = \"A\"\nsource = \" \"", 3)]
    {
        write(&format!("name = \"mine\"\nsource = \"own\"\n{wrong}\n[overlay]\nprofile = \"chf100a\"\n"));
        let [ProfileError::Broken { line: at, .. }] = &Profile::check(&folder.0)[..] else { panic!("{wrong}") };
        assert_eq!(*at, line, "{wrong}");
    }
}

proptest! {
    #[test]
    fn no_name_panics(name in ".*") {
        let profile = Profile::builtin("gd350").unwrap();
        if let Err(error) = profile.find(&name) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
