//! Parameters whose codes say nothing of their addresses, as most makers number them.

use drivebus_drives::{NameError, Store};

use crate::folder::{FAULTS, Folder, REGISTERS};

const TOML: &str = r#"
name = "ex3"
title = "Example Drives EX-3"
kind = "inverter"
version = 1
source = "EX-3 manual, 1st edition"
[requests]
functions = [0x03, 0x06]
max_words = 8
source = "p. 9"
[parameters]
address = "listed"
serial = ["H5"]
motor = ["E2-01"]
last = ["b1-02"]
source = "p. 12"
[parameters.memory]
bit = 15
means = "ram"
verified = true
source = "p. 12"
[faults]
history = ["U2-02"]
"#;

const HEAD: &str =
    "code,address,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";

const ROWS: &str = "\
b1-02,0181H,Run command from,,1,no,0,,2,,1,stop,0=keypad;2=bus,yes,,p. 20
C1-01,0200H,Acceleration,s,10,no,0,,6000,,10.0,run,,yes,,p. 21
E2-01,030EH,Motor rated current,A,100,no,,,,,,stop,,yes,,p. 22
H5-01,0425H,Address,,1,no,0,,32,,31,stop,,yes,,p. 23
P00.11,0007H,Not at 000BH,,1,no,0,,9,C1-01,,run,,yes,,p. 24
U2-02,0081H,Last fault,,1,no,,,,,,ro,,yes,,p. 25
";

fn folder_of(name: &str, toml: &str, parameters: &str) -> Folder {
    let files =
        [("profile.toml", toml), ("parameters.csv", parameters), ("registers.csv", REGISTERS), ("faults.csv", FAULTS)];
    Folder::new(&format!("listed-{name}"), &files)
}

#[test]
fn each_row_says_its_own_address() {
    let folder = folder_of("own", TOML, &format!("{HEAD}{ROWS}"));
    let profile = folder.load().unwrap();
    for (code, address) in
        [("C1-01", 0x0200), ("c1-01", 0x0200), ("b1-02", 0x0181), ("P00.11", 0x0007), ("p0.11", 0x0007)]
    {
        assert_eq!(profile.find(code).unwrap().address(), Some(address), "{code}");
    }
    let acceleration = profile.find("0200H").unwrap();
    assert_eq!((acceleration.code(), acceleration.encode(2.5)), (Some("C1-01"), Ok(25)));
    assert_eq!(profile.write_address(acceleration, Store::Ram), Ok(0x8200.into()));
    let group =
        |entries: Vec<&drivebus_drives::Entry>| entries.iter().map(|entry| entry.name()).collect::<Vec<_>>().join(" ");
    assert_eq!(group(profile.serial_parameters().collect()), "H5-01");
    assert_eq!(group(profile.motor_parameters().collect()), "E2-01");
    assert_eq!(group(profile.last_parameters().collect()), "b1-02");
}

/// A code that another maker would find at an address of the rule must not find what is there.
#[test]
fn a_code_by_the_rule_finds_no_parameter_that_has_another() {
    let folder = folder_of("rule", TOML, &format!("{HEAD}{ROWS}"));
    let profile = folder.load().unwrap();
    assert_eq!(profile.find("0007H").unwrap().code(), Some("P00.11"));
    for code in ["P00.07", "P02.00", "P01.129"] {
        assert!(matches!(profile.find(code), Err(NameError::Unknown { .. })), "{code}");
    }
}

#[test]
fn what_is_wrong_is_said() {
    for (row, reason) in [
        ("C1-02,,", "each row says where C1-02 is"),
        ("P00.12,,", "each row says where P00.12 is"),
        ("C1-02,512,", "address \"512\" must be hex such as 0x0200"),
        ("C1 02,0201H,", "code \"C1 02\" must be 2 to 16 letters and digits"),
        ("C1.02.1,0201H,", "at most one dot"),
        ("C102H,0201H,", "and no address"),
        ("-C1,0201H,", "code \"-C1\""),
        ("C1-01,0201H,", "C1-01 is there twice"),
        ("c1-01,0201H,", "c1-01 is there twice"),
        ("C1-02,0200H,", "where C1-01 is already"),
        ("C1-02,8201H,", "bit 15 says where a write is kept"),
    ] {
        let rows = format!("{HEAD}{ROWS}{row}Another,s,10,no,,,,,,run,,yes,,p. 21\n");
        let [only] = folder_of("wrong", TOML, &rows).reasons().try_into().unwrap();
        assert!(only.contains("parameters.csv, line 8: ") && only.contains(reason), "{only}");
    }
}

/// Where codes do say their addresses, a parameter may still be elsewhere, and another code must say where.
#[test]
fn the_rule_has_exceptions_that_say_so() {
    let toml = TOML.replace("\"listed\"", "\"group.index\"").replace("\"H5\"", "\"P05\"");
    let rows =
        "P05.06,,By the rule,s,10,no,,,,,,run,,yes,,p. 21\nP05.7,0x1234,Elsewhere,s,10,no,,,,,,run,,yes,,p. 21\n";
    let rows = format!("{HEAD}{}{rows}", ROWS.replace("P00.11", "P00.01"));
    let folder = folder_of("exception", &toml, &rows);
    let profile = folder.load().unwrap();
    for (code, address) in [("P05.06", 0x0506), ("P05.07", 0x1234), ("C1-01", 0x0200)] {
        assert_eq!(profile.find(code).unwrap().address(), Some(address), "{code}");
    }
    let without = format!("{rows}C1-02,,No address,s,10,no,,,,,,run,,yes,,p. 21\n");
    let [only] = folder_of("without", &toml, &without).reasons().try_into().unwrap();
    assert!(only.contains("must be like P05.06; of any other the row must say the \"address\""), "{only}");
}
