//! Profiles over profiles: what an overlay adds, what a sister family takes over, and how much of it is then trusted.

use drivebus_drives::{Command, Evidence, Profile, State, Store};

use crate::folder::{FAULTS, Folder, REGISTERS};

#[test]
fn a_bit_without_values_is_off_or_on_and_several_are_a_number() {
    let bits = "[bits]\nstatus_word_1 = [{ name = \"mode\", bits = [1, 0] }, { name = \"lamp\", bits = [2, 2] }]\n";
    let toml = format!("name = \"x\"\nsource = \"Plant 7\"\n[overlay]\nprofile = \"gd350\"\n{bits}");
    let folder = Folder::new("bits", &[("profile.toml", &toml)]);
    let profile = folder.load().unwrap();
    let told = |word| {
        profile
            .find("status_word_1")
            .unwrap()
            .bits()
            .iter()
            .map(|field| field.meaning(word).into_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(told(0b001), ["1", "off"]);
    assert_eq!(told(0b111), ["3", "on"]);
}

#[test]
fn an_overlay_adds_and_replaces_and_leaves_the_rest_as_it_is() {
    let base = Profile::builtin("gd350").unwrap();
    let rows = format!(
        "{REGISTERS}0x3004,output_current,Output current of plant 7,A,100,no,0.00,300.00,,ro,yes,,\"Plant 7, sheet 3\"\n\
         0x3020,oil_pressure,Oil pressure,bar,10,no,0.0,20.0,,ro,yes,,\"Plant 7, sheet 4\"\n"
    );
    let overlay = "name = \"plant-7\"\nsource = \"Plant 7\"\n[overlay]\nprofile = \"gd350\"\n";
    let folder = Folder::new("plant", &[("profile.toml", overlay), ("registers.csv", &rows)]);
    let profile = folder.load().unwrap();

    assert_eq!((profile.name(), profile.family(), profile.title()), ("plant-7", "gd350", base.title()));
    assert_eq!(profile.find("output_current").unwrap().decode(1234).to_string(), "12.34");
    assert_eq!(profile.find("oil_pressure").unwrap().address(), Some(0x3020));
    assert_eq!(profile.entries().count(), base.entries().count() + 1);
    for entry in base.entries().filter(|entry| entry.name() != "output_current") {
        assert_eq!(profile.find(entry.name()), Ok(entry));
    }
    assert_eq!(profile.commands(), base.commands());
    assert_eq!(profile.control(), base.control());
    // The code of the drive names the family below, and that is asked for it.
    assert_eq!(profile.identifications(), []);
    assert_eq!(profile.reports_as(), ["gd350"]);
}

#[test]
fn a_sister_family_is_trusted_as_far_as_its_own_documents_go() {
    let manifest = r#"
        name = "gd999"
        title = "Goodrive999"
        source = "GD999 leaflet"
        drop = ["rev_upper_frequency"]
        [extends]
        profile = "gd350"
        assumption = "The leaflet calls it compatible with the GD350."
        confirmed = ["set_frequency", "memory"]
        confirmed_source = "GD999 leaflet, p. 2"
    "#;
    let profile = Folder::new("sister", &[("profile.toml", manifest)]).load().unwrap();

    let setpoint = profile.find("set_frequency").unwrap();
    assert_eq!((setpoint.evidence(), setpoint.source()), (Evidence::Verified, "GD999 leaflet, p. 2"));
    let current = profile.find("output_current").unwrap();
    assert_eq!(current.evidence(), Evidence::Unverified);
    assert!(current.note().starts_with("The leaflet calls it compatible with the GD350."), "{}", current.note());
    assert!(profile.find("rev_upper_frequency").is_err());

    assert_eq!(profile.command(Command::Stop), Some((0x2000.into(), 5)));
    assert_eq!(profile.command_reason(Command::Stop), Some("The leaflet calls it compatible with the GD350."));
    assert!(!profile.state_word().unwrap().verified);
    assert_eq!(profile.state(3), State::Stopped);
    assert!(profile.control().iter().all(|item| !item.verified));
    assert!(profile.memory().unwrap().verified, "it is confirmed");
    assert_eq!(profile.write_address(profile.find("P00.11").unwrap(), Store::Ram), Ok(0x800B.into()));
    assert_eq!((profile.identifications(), profile.family()), ([].as_slice(), "gd999"));
    assert_eq!(profile.reports_as(), ["gd999", "gd350"], "it lists no code of its own");

    let code = "[[identification.codes]]\ncode = 0x0199\nfamily = \"gd999\"\ntitle = \"Goodrive999\"\nverified = true\n\
                source = \"GD999 leaflet, p. 1\"\n";
    let profile = Folder::new("sister-code", &[("profile.toml", &format!("{manifest}\n{code}"))]).load().unwrap();
    assert_eq!(profile.reports_as(), ["gd999"]);
    assert_eq!(Profile::builtin("gd300").unwrap().reports_as(), ["gd300"]);
}

#[test]
fn what_lies_below_must_be_there_and_end_somewhere() {
    let manifest = |table: &str| format!("name = \"mine\"\nsource = \"me\"\n{table}\n");
    for (name, table, reason) in [
        ("unknown", "[overlay]\nprofile = \"gd35o\"", "the closest is \"gd35"),
        ("itself", "[overlay]\nprofile = \"./../itself-PID\"", "leads back to this profile"),
        ("absolute", "[overlay]\nprofile = \"/etc\"", "relative to this one"),
        ("both", "[overlay]\nprofile = \"gd350\"\n[extends]\nprofile = \"gd350\"\nassumption = \"so\"", "not both"),
        ("silent", "[extends]\nprofile = \"gd350\"\nassumption = \" \"", "\"assumption\" is empty"),
        ("nothing", "[extends]\nprofile = \"gd350\"", "assumption"),
        (
            "unsourced",
            "[extends]\nprofile = \"gd350\"\nassumption = \"so\"\nconfirmed = [\"memory\"]",
            "\"confirmed_source\" is missing",
        ),
        (
            "misspelt",
            "[extends]\nprofile = \"gd350\"\nassumption = \"so\"\nconfirmed_source = \"me\"\nconfirmed = [\"memroy\"]",
            "the closest is \"memory\"",
        ),
    ] {
        let table = table.replace("PID", &std::process::id().to_string());
        let folder = Folder::new(name, &[("profile.toml", &manifest(&table))]);
        let reasons = folder.reasons();
        assert!(matches!(&reasons[..], [only] if only.contains(reason)), "{name}: {reasons:?}");
    }
    let dropped = manifest("drop = [\"no_such_row\"]\n[overlay]\nprofile = \"gd350\"");
    let reasons = Folder::new("dropped", &[("profile.toml", &dropped)]).reasons();
    assert!(reasons[0].contains("to drop; the closest is"), "{reasons:?}");
}

#[test]
fn a_rectifier_has_no_command_that_needs_a_motor() {
    let manifest = r#"
        name = "rectifier"
        title = "A rectifier"
        kind = "rectifier"
        version = 1
        source = "leaflet"
        [requests]
        functions = [3, 6]
        max_words = 16
        source = "leaflet"
        [parameters]
        address = "group.index"
        source = "leaflet"
        [commands]
        register = "command"
        moves = ["command"]
        source = "leaflet"
        codes = { run_forward = 1, stop = 5, jog_forward = 3, run_reverse = 2 }
    "#;
    let rows = format!("{REGISTERS}0x2000,command,Command,,1,no,,,,rw,yes,,leaflet\n");
    let parameters =
        "code,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";
    let files =
        [("profile.toml", manifest), ("registers.csv", &rows), ("parameters.csv", parameters), ("faults.csv", FAULTS)];
    let reasons = Folder::new("rectifier", &files).reasons();
    assert_eq!(reasons.len(), 2, "{reasons:?}");
    for (reason, command) in reasons.iter().zip(["run_reverse", "jog_forward"]) {
        assert!(reason.contains("line 18") && reason.ends_with(&format!("it has no {command}")), "{reason}");
    }
}

/// A row whose address nobody knows is described, and cannot be used; an overlay can say where it is.
#[test]
fn a_row_without_an_address_waits_for_one() {
    let manifest = "name = \"partly\"\nsource = \"me\"\n[overlay]\nprofile = \"gd350\"\n";
    let rows = format!("{REGISTERS},oil_pressure,Oil pressure,bar,10,no,,,,ro,assumed,No page says where it is.,\n");
    let folder =
        Folder::new("partly", &[("profile.toml", manifest), ("registers.csv", &rows), ("full/faults.csv", FAULTS)]);
    let partly = folder.load().unwrap();
    let pressure = partly.find("oil_pressure").unwrap();
    assert_eq!((pressure.address(), pressure.evidence()), (None, Evidence::Assumed));
    let refused = partly.plan([pressure]).unwrap_err().to_string();
    assert!(refused.contains("No page says where it is."), "{refused}");

    let own = folder.0.file_name().unwrap().to_string_lossy().into_owned();
    let above = format!("name = \"full\"\nsource = \"me\"\n[overlay]\nprofile = \"../../{own}\"\n");
    folder.write("full/profile.toml", above);
    let row = format!("{REGISTERS}0x3020,oil_pressure,Oil pressure,bar,10,no,,,,ro,yes,,sheet 4\n");
    folder.write("full/registers.csv", row);
    let full = Profile::load(&folder.0.join("full")).unwrap();
    assert_eq!(full.find("oil_pressure").unwrap().address(), Some(0x3020));
    assert_eq!((full.family(), full.entries().count()), ("gd350", partly.entries().count()));
}

#[test]
fn a_row_keeps_the_roles_of_the_one_in_whose_place_it_stands() {
    const PARAMETERS: &str =
        "code,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";
    let manifest = |name: &str, below: &str| format!("name = \"{name}\"\nsource = \"x\"\n{below}");
    let below = r#"
        title = "x"
        kind = "inverter"
        version = 1
        [requests]
        functions = [3, 6]
        max_words = 1
        source = "x"
        [parameters]
        address = "group.index"
        last = ["P05.01"]
        source = "x"
        [commands]
        register = "control_command"
        moves = ["control_command"]
        codes = { stop = 6, coast = 5 }
        source = "x"
        [state]
        register = "status"
        when = [{ is = "fault", fields = { tripped = 1 } }]
        source = "x"
        [bits]
        status = [{ name = "tripped", bits = [3, 3] }]
    "#;
    let command = |place: &str| format!("{REGISTERS}{place},control_command,x,,1,no,,,,wo,yes,,x\n");
    let status = |code: &str| format!("{PARAMETERS}{code},status,x,,1,no,,,,,,ro,,yes,,x\n");
    let folder = Folder::new(
        "roles",
        &[
            ("below/profile.toml", &manifest("below", below)),
            ("below/registers.csv", &command("0x7000")),
            ("below/parameters.csv", &status("P05.01")),
            ("below/faults.csv", FAULTS),
            ("profile.toml", &manifest("over", "[overlay]\nprofile = \"./below\"\n")),
            ("registers.csv", &command("0x7100")),
            ("parameters.csv", &status("P06.02")),
        ],
    );
    let profile = folder.load().unwrap();
    // P06.02 is at 0602H: 6 and 2 in hexadecimal.
    assert_eq!(profile.role("state").unwrap().address(), Some(0x0602));
    assert_eq!(profile.state(8), State::Fault);
    assert_eq!(profile.find("status").unwrap().bits().len(), 1);
    assert_eq!(profile.find("control_command").unwrap().quantity().choices().len(), 2);
    assert_eq!(profile.command_address(), Some(0x7100.into()));
    assert!(profile.is_command(0x7100) && !profile.is_command(0x7000), "the old place is no command register any more");
    assert!(profile.last_parameters().map(drivebus_drives::Entry::name).eq(["P06.02"]));
}

/// What a folder over a shipped profile says of registers, parameters and the rest of `profile.toml`.
fn over(name: &str, below: &str, manifest: &str, registers: &str, parameters: &str) -> Folder {
    const PARAMETERS: &str =
        "code,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";
    let head = format!("name = \"over\"\nsource = \"x\"\n{manifest}\n[overlay]\nprofile = \"{below}\"\n");
    let words = REGISTERS.replace("signed,", "signed,words,variant,");
    let rows = [format!("{words}{registers}"), format!("{PARAMETERS}{parameters}")];
    let files = [("profile.toml", &head), ("registers.csv", &rows[0]), ("parameters.csv", &rows[1])];
    Folder::new(name, &files.map(|(file, text)| (file, text.as_str())))
}

#[test]
fn two_rows_that_changed_places_keep_each_its_own_role() {
    let rows = "0x2001,control_command,x,,1,no,,,1,8,,rw,yes,,x\n0x2000,set_frequency,x,Hz,100,no,,,,,,rw,yes,,x\n\
                0x2110,status_word_1,x,,1,no,,,,,,ro,yes,,x\n0x2100,oil,x,,1,no,,,,,,ro,yes,,x\n";
    let profile = over("places", "gd350", "", rows, "").load().unwrap();
    assert_eq!(profile.command(Command::Stop), Some((0x2001.into(), 5)));
    assert!(profile.is_command(0x2001) && !profile.is_command(0x2000));
    assert_eq!(profile.role("setpoints.frequency").unwrap().address(), Some(0x2000));
    assert_eq!(profile.role("state").unwrap().address(), Some(0x2110));
    assert!(profile.find("oil").unwrap().quantity().choices().is_empty(), "it is no state");
}

/// No page prints that r27.18 is the state of a VFD500: whoever knows that it is something else does not read a state there.
#[test]
fn what_stands_where_a_role_was_only_assumed_does_not_get_it() {
    let rows = "r27.18,output_current,x,A,10,no,,,,,,ro,,yes,,x\n";
    let profile = over("assumed", "vfd500", "", "", rows).load().unwrap();
    assert!(profile.role("state").is_none());
    let current = profile.find("output_current").unwrap();
    assert!(current.bits().is_empty() && profile.status_words().all(|word| word != current));

    // Its state is elsewhere, and what is there now is something else.
    let rows = "r27.18,output_current,x,A,10,no,,,,,,ro,,yes,,x\nr27.00,status_word_1,x,,1,no,,,,,,ro,,yes,,x\n";
    let profile = over("both", "vfd500", "", "", rows).load().unwrap();
    assert_eq!(profile.role("state").unwrap().address(), Some(0x1B00));
    assert!(profile.role("frequency").is_none(), "r27.00 was assumed to be that");
    assert!(profile.find("output_current").unwrap().bits().is_empty());
}

#[test]
fn what_is_not_said_of_parameters_stays_as_it_was() {
    let manifest = "[parameters]\naddress = \"group.index\"\nsource = \"x\"\nmotor = []";
    let profile = over("parameters", "gd350", manifest, "", "").load().unwrap();
    assert!(profile.is_closed(0x6300), "P99");
    assert!(profile.acting().map(drivebus_drives::Entry::name).eq(["P00.15", "P07.00"]));
    assert!(profile.serial_parameters().count() > 0);
    assert_eq!(profile.motor_parameters().count(), 0);
}

#[test]
fn what_came_from_below_must_fit_what_is_said_above() {
    let memory = "[parameters]\naddress = \"group.index\"\nsource = \"x\"\n\
                  memory = { bit = 13, means = \"ram\", verified = true, source = \"x\" }";
    let variant = "[variants.u]\nparameter = \"P00.01\"\nverified = true\nsource = \"x\"\n\
                   choices = { Hz = { value = 1, scale = 100 } }";
    for (name, manifest, registers, reasons) in [
        ("bit", memory, "", &["control_command is at 2000H, and bit 13"] as &[&str]),
        ("wide", "", "0x2000,control_command,x,,1,no,2,,,,,ro,yes,,x\n", &["control_command is the command register"]),
        ("over", "", "0x1FFF,oil,x,,1,no,2,,,,,ro,yes,,x\n", &["another row lies over the command register, 2000H"]),
        ("fixed", "", "0x2001,set_frequency,x,Hz,100,no,,,,,,ro,yes,,x\n", &["set_frequency is a setpoint"]),
        (
            "start",
            "",
            "0x2000,set_frequency,x,Hz,100,no,,,,,,rw,yes,,x\n",
            &["set_frequency is at 2000H, where a word"],
        ),
        ("state", "", "0x2100,status_word_1,x,,1,no,2,,,,,ro,yes,,x\n", &["status_word_1 is the state"]),
        ("two", variant, "0x4000,oil,x,,,no,2,u,,,,ro,yes,,x\n", &["has one word"]),
        ("bound", variant, "0x4000,oil,x,,,no,,u,,,P00.03,rw,yes,,x\n", &["leave those cells empty"]),
    ] {
        let found = over(&format!("fit-{name}"), "gd350", manifest, registers, "").reasons();
        assert_eq!(found.len(), reasons.len(), "{name}: {found:?}");
        assert!(reasons.iter().all(|reason| found.iter().any(|line| line.contains(reason))), "{name}: {found:?}");
    }
}

#[test]
fn what_a_parameter_decides_in_one_family_is_not_verified_in_its_sister() {
    let choices = "\"%\" = { value = 0, scale = 100 }, Hz = { value = 1, scale = 100 }, rpm = { value = 2, scale = 1 }";
    let variant = format!(
        "[variants.speed_unit]\nparameter = \"P30.14\"\nverified = true\nsource = \"x\"\nchoices = {{ {choices} }}"
    );
    let below = over("proved", "vfd500", &variant, "", "");
    assert!(below.load().unwrap().variants()["speed_unit"].verified);
    let own = below.0.file_name().unwrap().to_string_lossy().into_owned();
    let sister = format!(
        "name = \"sister\"\nsource = \"x\"\n[extends]\nprofile = \"../../{own}\"\nassumption = \"So it is said.\"\n"
    );
    below.write("sister/profile.toml", sister);
    let profile = Profile::load(&below.0.join("sister")).unwrap();
    let unit = &profile.variants()["speed_unit"];
    assert!(!unit.verified && unit.note.starts_with("So it is said."), "{}", unit.note);
}

/// Some makers take the reset of a fault where neither run nor stop is written.
#[test]
fn a_command_can_stand_in_another_register() {
    let files = |reset: &str, moves: &str, rest: &str| {
        let manifest = format!(
            r#"
            name = "elsewhere"
            source = "x"
            title = "x"
            kind = "inverter"
            version = 1
            [requests]
            functions = [3, 6]
            max_words = 1
            source = "x"
            [parameters]
            address = "group.index"
            source = "x"
            [commands]
            register = "control_command"
            moves = [{moves}]
            source = "x"
            [commands.codes]
            run_forward = 18
            stop = 1
            [commands.elsewhere]
            reset_fault = {{ register = "{reset}", code = 2 }}
            {rest}
            "#
        );
        let registers = format!(
            "{REGISTERS}0x2000,control_command,x,,1,no,,,,rw,yes,,x\n0x2002,fault_reset,x,,1,no,,3,,rw,yes,,x\n\
             ,nowhere,x,,1,no,,,,rw,assumed,No page says where it is.,\n0x2103,output,x,,1,no,,,,ro,yes,,x\n"
        );
        let parameters =
            "code,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";
        let name = format!("elsewhere-{}", moves.len() + reset.len() + rest.len());
        Folder::new(
            &name,
            &[
                ("profile.toml", manifest.as_str()),
                ("registers.csv", &registers),
                ("parameters.csv", parameters),
                ("faults.csv", FAULTS),
            ],
        )
    };
    let both = r#""control_command", "fault_reset""#;
    let profile = files("fault_reset", both, "").load().unwrap();
    assert_eq!(profile.command(Command::Stop), Some((0x2000.into(), 1)));
    assert_eq!(profile.command(Command::ResetFault), Some((0x2002.into(), 2)));
    assert!(profile.is_command(0x2002));
    // 2 means nothing at 2000H, and 1 nothing at 2002H.
    assert_eq!((profile.command_of(1), profile.command_of(2)), (Some(Command::Stop), None));
    let registers = profile.command_registers();
    assert_eq!(registers.keys().copied().collect::<Vec<_>>(), [0x2000.into(), 0x2002.into()]);
    assert_eq!(registers[&0x2000.into()].keys().copied().collect::<Vec<_>>(), [1, 18]);
    assert_eq!(registers[&0x2002.into()], [(2, "reset_fault")].into());

    let wrong = |reset: &str, moves: &str, rest: &str, says: &str| {
        let reasons = files(reset, moves, rest).reasons();
        assert!(reasons.len() == 1 && reasons[0].contains(says), "{says}: {reasons:?}");
    };
    wrong("fault_reset", r#""control_command""#, "", "\"moves\" must hold \"fault_reset\"");
    wrong("control_command", both, "", "control_command is the command register");
    wrong("nowhere", r#""control_command", "nowhere""#, "", "it needs an address");
    wrong("output", r#""control_command", "output""#, "", "that can be written");
    wrong("fault_reset", both, "coast = { register = \"fault_reset\", code = 2 }", "has the code of");
    wrong("fault_reset", both, "coast = { register = \"fault_reset\", code = 4 }", "4");
    wrong("fault_reset", both, "stop = { register = \"fault_reset\", code = 3 }", "stop is there twice");
    wrong("fault_reset", both, "[setpoints.frequency]\nregister = \"fault_reset\"", "no setpoint can be there");
}
