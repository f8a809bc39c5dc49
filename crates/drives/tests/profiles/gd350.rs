//! The GD350 profile against a table typed from the manual: GD350 operation manual, chapter 9.4 (INVT ebook 2645).
//!
//! The table is not produced by the code. Where the manual misprints, the row says what is right.

use std::collections::BTreeSet;
use std::sync::Arc;

use drivebus_drives::{Access, BitField, Command, Entry, Kind, Profile, State, Store};

fn gd350() -> Arc<Profile> {
    Profile::builtin("gd350").unwrap()
}

/// Address, name, unit, counts per unit, signed, lowest word, highest word, writable. Section 9.4.5.
///
/// Ranges up to Fmax are given with the highest Fmax that P00.03 takes, 630.00 Hz. "-" is a range that is not printed.
const REGISTERS: &str = "
    2000 control_command            -   1   u 0001 0008 rw
    2001 set_frequency              Hz  100 u 0000 F618 rw
    2002 pid_reference              %   10  u 0000 03E8 rw
    2003 pid_feedback               %   10  u 0000 03E8 rw
    2004 torque_setting             %   10  s F448 0BB8 rw
    2005 fwd_upper_frequency        Hz  100 u 0000 F618 rw
    2006 rev_upper_frequency        Hz  100 u 0000 F618 rw
    2007 motoring_torque_limit      %   10  u 0000 0BB8 rw
    2008 braking_torque_limit       %   10  u 0000 0BB8 rw
    2009 special_control_word       -   1   u 0000 003F rw
    200A virtual_input              -   1   u 0000 03FF rw
    200B virtual_output             -   1   u 0000 000F rw
    200C vf_separation_voltage      %   10  u 0000 03E8 rw
    200D ao_setting_1               %   10  s FC18 03E8 rw
    200E ao_setting_2               %   10  s FC18 03E8 rw
    2100 status_word_1              -   1   u 0001 0006 ro
    2101 status_word_2              -   1   u -    -    ro
    2102 fault_code                 -   1   u 0000 -    ro
    2103 identification_code        -   1   u -    -    ro
    3000 running_frequency          Hz  100 u 0000 F618 ro
    3001 set_frequency_actual       Hz  100 u 0000 F618 ro
    3002 bus_voltage                V   10  u 0000 4E20 ro
    3003 output_voltage             V   1   u 0000 04B0 ro
    3004 output_current             A   10  u 0000 7530 ro
    3005 rotation_speed             rpm 1   u 0000 FFFF ro
    3006 output_power               %   10  s F448 0BB8 ro
    3007 output_torque              %   10  s F63C 09C4 ro
    3008 closed_loop_setting        %   10  s FC18 03E8 ro
    3009 closed_loop_feedback       %   10  s FC18 03E8 ro
    300A input_state                -   1   u 0000 003F ro
    300B output_state               -   1   u 0000 000F ro
    300C analog_input_1             V   100 u 0000 03E8 ro
    300D analog_input_2             V   100 s FC18 03E8 ro
    300E analog_input_3             V   100 s FC18 03E8 ro
    300F analog_input_4             raw -   u -    -    ro
    3010 hdi_frequency_1            kHz 100 u 0000 1388 ro
    3011 hdi_frequency_2            kHz 100 u 0000 1388 ro
    3012 multistep_index            -   1   u 0000 000F ro
    3013 external_length            -   1   u 0000 FFFF ro
    3014 external_count             -   1   u 0000 FFFF ro
    3015 torque_setting_actual      %   10  s F448 0BB8 ro
    3016 identification_code_compat -   1   u -    -    ro
    5000 fault_code_compat          -   1   u 0000 -    ro
";

/// Code and address of every parameter.
const PARAMETERS: &str = "
    P00.01 0001  P00.02 0002  P00.03 0003  P00.04 0004  P00.06 0006  P00.07 0007  P00.10 000A  P00.11 000B  P00.12 000C
    P00.14 000E  P00.15 000F  P00.16 0010  P01.08 0108  P01.19 0113  P01.20 0114  P01.21 0115  P02.01 0201  P02.06 0206
    P02.07 0207  P02.08 0208  P04.00 0400  P04.01 0401  P04.02 0402  P04.27 041B  P05.13 050D  P05.24 0518  P05.26 051A
    P07.00 0700  P07.07 0707  P07.27 071B  P07.28 071C  P07.29 071D  P07.30 071E  P07.31 071F  P07.32 0720  P08.06 0806
    P08.07 0807  P08.08 0808  P09.00 0900  P09.01 0901  P09.02 0902  P09.03 0903  P09.04 0904  P10.00 0A00  P10.01 0A01
    P11.51 0B33  P14.00 0E00  P14.01 0E01  P14.02 0E02  P14.03 0E03  P14.04 0E04  P14.05 0E05  P15.13 0F0D  P27.00 1B00
";

/// Mnemonics of the faults 1 to 69, in order. 70 is listed without a readable mnemonic.
const FAULTS: &str = "
    OUt1 OUt2 OUt3 OC1 OC2 OC3 OV1 OV2 OV3 UV OL1 OL2 SPI SPO OH1 OH2 EF CE ItE tE EEP PIDE bCE END OL3 PCE UPE DNE
    E-DP E-NET E-CAN ETH1 ETH2 dEu STo LL ENC1o ENC1d ENC1Z STO STL1 STL2 STL3 CrCE P-E1 P-E2 P-E3 P-E4 P-E5 P-E6 P-E7
    P-E8 P-E9 P-E10 E-Err ENCU E-PN SECAN OT F1-Er F2-Er F3-Er C1-Er C2-Er C3-Er E-CAT E-BAC E-DEV S-Err
";

fn hex(text: &str) -> u16 {
    u16::from_str_radix(text, 16).unwrap()
}

#[test]
fn registers_are_those_of_the_manual() {
    let profile = gd350();
    let mut listed = Vec::new();
    for row in REGISTERS.lines().map(str::trim).filter(|row| !row.is_empty()) {
        let [address, name, unit, scale, sign, low, high, access] = row.split_whitespace().collect::<Vec<_>>()[..]
        else {
            panic!("{row}");
        };
        let entry = profile.entry_at(hex(address)).unwrap();
        let quantity = entry.quantity();
        assert_eq!((entry.name(), entry.kind(), entry.access().name()), (name, Kind::Register, access));
        assert_eq!(quantity.unit(), unit.trim_matches('-'), "{name}");
        assert_eq!(quantity.scale(), scale.parse().ok(), "{name}");
        assert_eq!(quantity.is_signed(), sign == "s", "{name}");
        for (word, bound) in [(low, quantity.low()), (high, quantity.high())] {
            assert_eq!(bound, (word != "-").then(|| entry.decode(hex(word))), "{name}");
        }
        listed.push(hex(address));
    }
    let registers = profile.entries().filter(|entry| entry.kind() == Kind::Register);
    assert_eq!(registers.filter_map(Entry::address).collect::<Vec<_>>(), listed);
    assert_eq!(listed.len(), 43);
}

#[test]
fn parameters_have_the_address_of_group_and_index() {
    let profile = gd350();
    let words: Vec<&str> = PARAMETERS.split_whitespace().collect();
    let listed: Vec<(&str, u16)> = words.chunks_exact(2).map(|pair| (pair[0], hex(pair[1]))).collect();
    let parameters = profile.entries().filter(|entry| entry.kind() == Kind::Parameter);
    assert_eq!(parameters.map(|entry| (entry.name(), entry.address().unwrap())).collect::<Vec<_>>(), listed);
    assert_eq!(listed.len(), 54);
    for (code, address) in [("P05.06", 0x0506), ("P10.01", 0x0A01), ("P07.27", 0x071B), ("P00.07", 0x0007)] {
        if let Ok(entry) = profile.find(code) {
            assert_eq!(entry.address(), Some(address));
        }
    }
}

#[test]
fn parameters_of_the_manual_have_its_ranges_defaults_and_access() {
    let profile = gd350();
    // Code, unit, low, high, default word, access: sections 9.4.5, 9.4.6 and 9.4.8.
    for (code, unit, low, high, default, access) in [
        ("P00.01", "", "0", "2", None, Access::Unknown),
        ("P00.03", "Hz", "10.00", "630.00", Some(5000), Access::Stop),
        ("P00.11", "s", "0.0", "3600.0", None, Access::Run),
        ("P00.12", "s", "0.0", "3600.0", None, Access::Run),
        ("P01.20", "s", "0.0", "3600.0", Some(0), Access::Unknown),
        ("P01.21", "", "0", "1", Some(0), Access::Unknown),
        ("P10.00", "", "0", "2", Some(0), Access::Run),
        ("P10.01", "", "0", "1", Some(0), Access::Run),
    ] {
        let entry = profile.find(code).unwrap();
        let quantity = entry.quantity();
        assert_eq!(quantity.unit(), unit, "{code}");
        assert_eq!(quantity.low().unwrap().to_string(), low, "{code}");
        assert_eq!(quantity.high().unwrap().to_string(), high, "{code}");
        assert_eq!((entry.default_raw(), entry.access(), entry.verified()), (default, access, true), "{code}");
    }
    assert_eq!(profile.find("P00.03").unwrap().quantity().low_from(), Some("P00.04"));
    for name in
        ["set_frequency", "fwd_upper_frequency", "rev_upper_frequency", "running_frequency", "set_frequency_actual"]
    {
        assert_eq!(profile.find(name).unwrap().quantity().high_from(), Some("P00.03"), "{name}");
    }
    // The manual only reads the fault history; that it cannot be written is our assumption, and the rows say so.
    for code in ["P07.27", "P07.28", "P07.29", "P07.30", "P07.31", "P07.32"] {
        assert_eq!(profile.find(code).unwrap().access(), Access::Ro, "{code}");
    }
}

#[test]
fn values_scale_as_in_the_manuals_examples() {
    let profile = gd350();
    // Section 9.4.6: 50.12 Hz is 1394H, 5.0 s is 0032H. Section 9.4.8: 100 Hz is 2710H, 10 s 0064H, 20 s 00C8H, 10 Hz 03E8H.
    for (name, value, raw) in [
        ("set_frequency", 50.12, 0x1394),
        ("P01.20", 5.0, 0x0032),
        ("P00.03", 100.0, 0x2710),
        ("P00.11", 10.0, 0x0064),
        ("P00.12", 20.0, 0x00C8),
        ("set_frequency", 10.0, 0x03E8),
    ] {
        let entry = profile.find(name).unwrap();
        assert_eq!(entry.encode(value), Ok(raw));
        assert!((entry.decode(raw).to_f64() - value).abs() < f64::EPSILON);
    }
}

#[test]
fn faults_are_numbered_as_in_the_lists() {
    let profile = gd350();
    let codes: Vec<u16> = profile.faults().map(|fault| fault.code).collect();
    assert_eq!(codes, (0..=70).collect::<Vec<u16>>());
    let mnemonics: Vec<&str> = FAULTS.split_whitespace().collect();
    assert_eq!(mnemonics.len(), 69);
    for (code, mnemonic) in (1..).zip(mnemonics) {
        assert_eq!(profile.fault(code).mnemonic, mnemonic, "fault {code}");
    }
    assert_eq!(profile.fault(70).mnemonic, "");
    // Case tells these two apart: section 9.4.8 shows 0023H = 35 = STo, maladjustment.
    assert_eq!(
        (profile.fault(35).label.as_str(), profile.fault(40).label.as_str()),
        ("Maladjustment", "Safe torque off")
    );
    // Numbers 1 to 10 and readings of mnemonics rest on no GD350 page.
    for (code, verified) in [(1, false), (10, false), (11, true), (18, true), (35, true), (37, false), (70, false)] {
        assert_eq!(profile.fault(code).verified(), verified, "fault {code}");
    }
    assert_eq!(profile.fault(999).label, "Unknown fault 999");
}

#[test]
fn commands_and_states_are_those_of_section_9_4_5() {
    let profile = gd350();
    for (command, code) in [
        (Command::RunForward, 1),
        (Command::RunReverse, 2),
        (Command::JogForward, 3),
        (Command::JogReverse, 4),
        (Command::Stop, 5),
        (Command::Coast, 6),
        (Command::ResetFault, 7),
        (Command::JogStop, 8),
    ] {
        assert_eq!(profile.command(command), Some((0x2000.into(), code)));
        assert_eq!(profile.command_of(code), Some(command));
        assert_eq!(command.name().parse(), Ok(command));
        assert_eq!(profile.find("control_command").unwrap().encode(command.name()), Ok(code));
    }
    assert_eq!((profile.command_of(0), profile.command_of(9)), (None, None));
    for (raw, state) in [
        (0, State::Unknown),
        (1, State::Forward),
        (2, State::Reverse),
        (3, State::Stopped),
        (4, State::Fault),
        (5, State::PowerOff),
        (6, State::PreExciting),
        (7, State::Unknown),
    ] {
        assert_eq!(profile.state(raw), state);
    }
    let moving: Vec<u16> = (0..=u16::MAX).filter(|&address| address < 0x8000 && profile.is_command(address)).collect();
    assert_eq!(moving, [0x2000, 0x2009, 0x200A]);
}

#[test]
fn bits_of_status_word_2_are_those_of_the_manual() {
    let profile = gd350();
    let entry = profile.find("status_word_2").unwrap();
    let fields: Vec<(&str, u16)> = entry.bits().iter().map(|field| (field.name(), field.mask())).collect();
    let expected = [
        ("ready", 0x0001),
        ("motor", 0x0006),
        ("motor_type", 0x0008),
        ("overload_alarm", 0x0010),
        ("control_channel", 0x0060),
        ("torque_control", 0x0100),
        ("position_control", 0x0200),
        ("control_mode", 0x0C00),
    ];
    assert_eq!(fields, expected);
    let channel = &entry.bits()[4];
    assert_eq!(channel.extract(0x0041), 2);
    assert_eq!(channel.values()[&2], "communication");
    assert_eq!((channel.meaning(0x0041), channel.meaning(0x0061)), ("communication".into(), "3".into()));
    assert_eq!(channel.insert(0x0001, 2), 0x0041);
    assert!(!entry.bits()[7].verified(), "bits 10 and 11 are inferred");
    let outputs = profile.find("output_state").unwrap();
    let on: Vec<&str> = outputs.bits().iter().filter(|bit| bit.meaning(0x0009) == "on").map(BitField::name).collect();
    assert_eq!(on, ["Y1", "RO2"]);
}

#[test]
fn rules_are_those_of_the_manual() {
    let profile = gd350();
    assert_eq!((profile.max_words(), profile.functions()), (16, [0x03, 0x06, 0x08, 0x10].as_slice()));
    let serial = profile.serial().unwrap();
    assert_eq!((serial.baud_rate, serial.data_bits, serial.parity, serial.stop_bits), (19_200, 8, 'E', 1));
    assert_eq!((serial.unit, serial.bits_per_char(), serial.verified), (Some(1), 11, false));

    let acceleration = profile.find("P00.11").unwrap();
    assert_eq!(profile.write_address(acceleration, Store::Ram), Ok(0x800B.into()));
    assert_eq!(profile.write_address(acceleration, Store::Eeprom), Ok(0x000B.into()));
    assert_eq!(profile.stored_address(0x8007), Some(0x0007));
    assert_eq!(profile.stored_address(0x0007), None);
    let setpoint = profile.find("set_frequency").unwrap();
    assert_eq!(profile.write_address(setpoint, Store::Ram), Ok(0x2001.into()));
    let refused = profile.write_address(setpoint, Store::Eeprom).unwrap_err().to_string();
    assert!(refused.contains("set_frequency") && refused.contains("EEPROM"), "{refused}");
    let current = profile.find("output_current").unwrap();
    let refused = profile.write_address(current, Store::Ram).unwrap_err().to_string();
    assert!(refused.contains("output_current") && refused.contains("read"), "{refused}");

    for address in [0x6300, 0x63FF, 0xE300] {
        assert!(profile.is_closed(address), "{address:04X}");
    }
    for address in [0x0000, 0x2000, 0x62FF, 0x6400, 0xFFFF] {
        assert!(!profile.is_closed(address), "{address:04X}");
    }

    let control: Vec<(&str, u16, bool)> =
        profile.control().iter().map(|row| (&*row.code, row.raw, row.verified)).collect();
    assert_eq!(control, [("P00.01", 2, true), ("P00.02", 0, false), ("P00.06", 8, true)]);
    let monitor: Vec<u16> = profile.monitor().filter_map(Entry::address).collect();
    assert_eq!(monitor, (0x3000..=0x3016).collect::<Vec<u16>>());
    let history: Vec<u16> = profile.fault_history().filter_map(Entry::address).collect();
    assert_eq!(history, (0x071B..=0x0720).collect::<Vec<u16>>());
}

#[test]
fn identification_codes_are_those_of_the_lists() {
    let profile = gd350();
    assert_eq!(profile.role("identification").unwrap().address(), Some(0x2103));
    for (code, family) in [(0x0180, "sd1"), (0x01A0, "gd350"), (0x01A1, "gd350"), (0x01A2, "gd350")] {
        assert_eq!(profile.identify(code).unwrap().family, family, "{code:04X}");
    }
    assert_eq!(profile.identifications().len(), 4);
    assert!(profile.identifications().iter().all(|row| row.verified));
    // What has a profile of its own stands there and nowhere else. 0110H, in a sentence of the GD200A manual, is a
    // misprint: its table says 010CH.
    for code in [0x0106, 0x0107, 0x0108, 0x0109, 0x010A, 0x010B, 0x010C, 0x010D, 0x0110, 0x01A3] {
        assert_eq!(profile.identify(code), None, "{code:04X}");
    }
}

#[test]
fn exceptions_are_those_of_section_9_4_7() {
    let profile = gd350();
    for (code, name) in (1..).zip([
        "illegal_command",
        "illegal_address",
        "illegal_value",
        "operation_failed",
        "password_error",
        "frame_error",
        "read_only",
        "locked_while_running",
        "password_protected",
    ]) {
        let exception = profile.exception(code);
        assert_eq!((exception.name.as_str(), exception.meaning.is_empty()), (name, false));
    }
    assert_eq!(profile.exception(0x0A).name, "unknown");
    assert!(profile.exception(0x0A).meaning.contains("0AH"));
}

#[test]
fn every_row_names_its_source_and_every_doubt_its_reason() {
    let profile = gd350();
    let mut names = BTreeSet::new();
    for entry in profile.entries() {
        assert!(!entry.source().is_empty() && !entry.label().is_empty(), "{}", entry.name());
        assert!(entry.verified() || !entry.note().is_empty(), "{}", entry.name());
        assert!(names.insert(entry.name()), "{}", entry.name());
    }
    for fault in profile.faults() {
        assert!(!fault.source.is_empty(), "fault {}", fault.code);
        assert!(fault.verified() || !fault.note.is_empty(), "fault {}", fault.code);
    }
}

/// GD300 manual (easymanua.ls gd300-015g-4), p. 122: P14.05 = 0 alarms and coasts, 3 stops whoever is in control.
#[test]
fn the_watchdog_is_p14_04_and_p14_05() {
    let profile = gd350();
    let watchdog = profile.watchdog().unwrap();
    assert_eq!((watchdog.timeout.as_str(), watchdog.action.as_deref()), ("P14.04", Some("P14.05")));
    assert_eq!((watchdog.coast, watchdog.stop, watchdog.verified), (Some(0), Some(3), false));
}

#[test]
fn what_acts_cannot_be_read_back() {
    let profile = gd350();
    let read_back = |name| profile.read_back(profile.find(name).unwrap());
    assert_eq!(read_back("P00.11"), Some(0x000B.into()));
    assert_eq!(read_back("set_frequency"), Some(0x2001.into()));
    for name in ["P00.15", "P07.00", "control_command", "virtual_input"] {
        assert_eq!(read_back(name), None, "{name}");
    }
}
