//! One address that tells a state when it is read and takes a command when it is written: two rows, each for its way.
//!
//! The address is that of Mitsubishi's inverters (0008H: "inverter status/control input instruction"); the drive does not
//! exist.

use std::path::Path;

use drivebus_drives::{Access, AccessError, Command, Profile, State, Store};

use crate::folder::{FAULTS, Folder};

const TOML: &str = r#"
name = "ex8"
title = "Example Drives EX-8"
kind = "inverter"
version = 1
source = "EX-8 manual"
[requests]
functions = [0x03, 0x06]
max_words = 8
source = "p. 9"
[parameters]
address = "listed"
source = "p. 9"
[commands]
register = "order"
moves = ["order"]
source = "p. 10"
[commands.codes]
run_forward = 2
stop = 0
[state]
register = "status"
source = "p. 11"
[state.codes]
forward = 3
stopped = 0
"#;

const REGISTERS: &str = "address,name,label,unit,scale,signed,words,low,high,high_from,access,verified,note,source\n";

const ROWS: &str = "\
0x0007,before,Before,,1,no,,,,,ro,yes,,p. 1
0x0008,order,Command,,1,no,,0,7,,wo,yes,,p. 1
0x0008,status,State,,1,no,,,,,ro,no,The numbers of its bits are not printed.,p. 1
0x0009,after,After,,1,no,,,,,ro,yes,,p. 1
";

fn files(toml: &str, rows: &str) -> [(&'static str, String); 4] {
    let parameters = "code,address,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";
    [
        ("profile.toml", toml.to_owned()),
        ("registers.csv", format!("{REGISTERS}{rows}")),
        ("parameters.csv", parameters.to_owned()),
        ("faults.csv", FAULTS.to_owned()),
    ]
}

fn folder_of(name: &str, toml: &str, rows: &str) -> Folder {
    let files = files(toml, rows);
    Folder::new(&format!("two-ways-{name}"), &files.each_ref().map(|(file, text)| (*file, text.as_str())))
}

/// An overlay over the profile in `folder`, with other rows.
fn under(folder: &Folder, head: &str, rows: &str) -> Profile {
    let toml = format!("name = \"over\"\nsource = \"p. 90\"\nversion = 2\n{head}\n[overlay]\nprofile = \"../\"\n");
    for (file, text) in files(&toml, rows) {
        folder.write(&format!("over/{file}"), text);
    }
    load(&folder.0.join("over"))
}

fn load(folder: &Path) -> Profile {
    Profile::load(folder).unwrap()
}

fn names_at(profile: &Profile, address: u16) -> (&str, &str) {
    (profile.entry_at(address).unwrap().name(), profile.written_entry_at(address).unwrap().name())
}

#[test]
fn what_is_read_there_and_what_is_written_there_are_two_rows() {
    let folder = folder_of("both", TOML, ROWS);
    let profile = load(&folder.0);
    assert_eq!(names_at(&profile, 0x0008), ("status", "order"));
    assert_eq!(names_at(&profile, 0x0009), ("after", "after"));
    let (order, status) = (profile.find("order").unwrap(), profile.find("status").unwrap());
    assert_eq!(profile.find("0008H").unwrap().name(), "status", "an address is what is read there");
    assert_eq!((order.access(), status.access()), (Access::Wo, Access::Ro));

    assert_eq!(profile.command(Command::RunForward), Some((0x0008.into(), 2)));
    assert_eq!((profile.is_command(0x0008), profile.command_reason(Command::Stop)), (true, None));
    assert_eq!((profile.state(3), profile.state_word().unwrap().register.as_str()), (State::Forward, "status"));
    assert_eq!(profile.write_address(order, Store::Ram), Ok(0x0008.into()));
    assert!(matches!(profile.write_address(status, Store::Ram), Err(AccessError::ReadOnly { .. })));
    // A command that could be read back would be the state.
    assert_eq!(profile.read_back(order), None);

    // A read runs across it, and holds the state.
    let wanted = ["before", "status", "after"].map(|name| profile.find(name).unwrap());
    let reads: Vec<_> = profile.plan(wanted).unwrap().iter().map(|read| (read.address, read.count)).collect();
    assert_eq!(reads, [(0x0007, 3)]);
    let [before, _, after] = wanted;
    let reads: Vec<_> = profile.plan([before, after]).unwrap().iter().map(|read| (read.address, read.count)).collect();
    assert_eq!(reads, [(0x0007, 3)], "what is read there is known to be readable");
    assert!(matches!(profile.plan([order]), Err(AccessError::WriteOnly { .. })));
}

#[test]
fn any_other_two_rows_at_one_address_are_refused() {
    for (row, other) in [
        ("0x0008,third,Third,,1,no,,,,,ro,yes,,p. 1", "status"),
        ("0x0008,third,Third,,1,no,,,,,wo,yes,,p. 1", "order"),
        ("0x0008,third,Third,,1,no,,,,,rw,yes,,p. 1", "order"),
        ("0x0009,third,Third,,1,no,,,,,rw,yes,,p. 1", "after"),
        ("0x0009,third,Third,,1,no,,,,,unknown,yes,,p. 1", "after"),
        // The second of two words is nobody else's.
        ("0x0006,third,Third,,1,no,2,,,,ro,yes,,p. 1", "before"),
    ] {
        let folder = folder_of("other", TOML, &format!("{ROWS}{row}\n"));
        let [only] = Profile::check(&folder.0).try_into().unwrap();
        let reason = format!("H, where {other} is already");
        assert!(only.to_string().contains(&reason), "{only}");
    }
    let wide = "0x0020,wide,Wide,,1,no,2,,,,ro,yes,,p. 1\n0x0020,narrow,Narrow,,1,no,,,,,wo,yes,,p. 1\n";
    let folder = folder_of("wide", TOML, &format!("{ROWS}{wide}"));
    assert_eq!(Profile::check(&folder.0).len(), 1, "of two words one alone is not written");
}

#[test]
fn a_row_of_an_overlay_takes_the_place_of_the_one_that_goes_its_way() {
    let row = |name: &str, access: &str| format!("0x0008,{name},New,,1,no,,0,7,,{access},yes,,p. 90\n");
    let base = || folder_of("over", TOML, ROWS);
    let read = under(&base(), "", &row("state_word", "ro"));
    assert_eq!(names_at(&read, 0x0008), ("state_word", "order"));
    assert_eq!(read.state_word().unwrap().register, "state_word");
    assert_eq!(read.command(Command::RunForward), Some((0x0008.into(), 2)));

    let written = under(&base(), "", &row("new_order", "wo"));
    assert_eq!(names_at(&written, 0x0008), ("status", "new_order"));
    assert_eq!((written.command(Command::Stop), written.is_command(0x0008)), (Some((0x0008.into(), 0)), true));

    // One that goes both ways leaves no room for either.
    let both = under(&base(), "", &row("status", "rw"));
    assert_eq!(names_at(&both, 0x0008), ("status", "status"));
    assert!(both.find("order").is_err());
}

#[test]
fn where_the_state_moves_to_the_commands_do_not_follow() {
    let moved = under(&folder_of("moved", TOML, ROWS), "", "0x0030,status,State,,1,no,,,,,ro,yes,,p. 90\n");
    assert_eq!(moved.find("status").unwrap().address(), Some(0x0030));
    assert_eq!((moved.command(Command::RunForward), moved.is_command(0x0008)), (Some((0x0008.into(), 2)), true));
    assert!(!moved.is_command(0x0030));
    let order = under(&folder_of("order", TOML, ROWS), "", "0x0031,order,Command,,1,no,,0,7,,wo,yes,,p. 90\n");
    assert_eq!((order.command(Command::RunForward), order.is_command(0x0031)), (Some((0x0031.into(), 2)), true));
    assert_eq!((order.state_word().unwrap().register.as_str(), order.is_command(0x0008)), ("status", false));
}

#[test]
fn what_is_dropped_takes_only_its_own_way_with_it() {
    let no_state = under(&folder_of("no-state", TOML, ROWS), "drop = [\"status\"]", "");
    assert_eq!(names_at(&no_state, 0x0008), ("order", "order"));
    assert!(no_state.state_word().is_none());
    assert_eq!((no_state.command(Command::RunForward), no_state.is_command(0x0008)), (Some((0x0008.into(), 2)), true));
    let no_order = under(&folder_of("no-order", TOML, ROWS), "drop = [\"order\"]", "");
    assert_eq!(names_at(&no_order, 0x0008), ("status", "status"));
    assert_eq!((no_order.command(Command::RunForward), no_order.is_command(0x0008)), (None, false));
    assert_eq!(no_order.state(3), State::Forward);
}
