//! The VFD500 profile against tables typed from its manual (easymanua.ls danfoss vfd500-series, pp. 96, 97, 135 to 137).
//!
//! The tables are not produced by the code. Where the manual misprints, the row says what is right.

use std::sync::Arc;

use drivebus_drives::{BitField, Evidence, Profile};

fn vfd500() -> Arc<Profile> {
    Profile::builtin("vfd500").unwrap()
}

fn hex(text: &str) -> u16 {
    u16::from_str_radix(text, 16).unwrap()
}

/// Address, name, unit, counts per unit, signed, lowest word, highest word. Page 135; "-" is not printed, or said by P30.14.
const REGISTERS: &str = "
    7000 control_command         -   1   u 0000 0008
    7001 speed_reference         -   -   u -    -
    7002 torque_setting          %   100 s 8AD0 7530
    7003 upper_frequency_limit   -   -   u -    -
    7004 torque_mode_speed_limit -   -   u -    -
    7005 motoring_torque_limit   %   10  u 0000 0BB8
    7006 braking_torque_limit    %   10  u 0000 0BB8
    7007 pid_reference           %   100 s D8F0 2710
    7008 pid_feedback            %   100 s D8F0 2710
    7009 vf_separation_voltage   %   10  u 0000 03E8
    700A virtual_output          -   1   u -    -
";

/// Code, address, lowest and highest word, and whether a page prints it (i: its number is inferred, n: no page does).
const PARAMETERS: &str = "
    P00.02 0002 0000 0002 n  P00.07 0007 -    -    y  P00.08 0008 0000 0001 n  P01.06 0106 -    -    n
    P01.14 010E -    -    n  r06.00 0600 -    -    y  P07.01 0701 -    -    y  P07.02 0702 -    -    y
    P07.03 0703 -    -    y  P07.04 0704 -    -    y  P07.05 0705 -    -    y  P07.06 0706 -    -    y
    P07.07 0707 -    -    y  P07.08 0708 -    -    y  P07.09 0709 -    -    y  P07.10 070A -    -    y
    P14.01 0E01 -    -    y  r25.00 1900 0000 0026 y  r27.00 1B00 0000 -    n  r27.01 1B01 0000 -    n
    r27.02 1B02 -    -    n  r27.03 1B03 -    -    n  r27.18 1B12 -    -    n  r27.19 1B13 -    -    n
    P30.01 1E01 0001 00F7 i  P30.02 1E02 0000 0007 i  P30.03 1E03 0000 0005 i  P30.04 1E04 0001 0014 i
    P30.05 1E05 0000 0258 i  r30.06 1E06 0000 FFFF i  r30.07 1E07 0000 FFFF i  r30.08 1E08 0000 FFFF i
    P30.09 1E09 0000 0001 y  P30.10 1E0A 0001 0009 y  P30.11 1E0B -    -    y  P30.12 1E0C -    -    y
    P30.14 1E0E -    -    y  P40.04 2804 -    -    y
";

/// Bits of the words of group 27, page 96: name and mask.
const STATUS_WORD_1: [(&str, u16); 13] = [
    ("running", 0x0001),
    ("direction", 0x0002),
    ("ready", 0x0004),
    ("fault", 0x0008),
    ("fault_reaction", 0x0030),
    ("jogging", 0x0040),
    ("autotuning", 0x0080),
    ("dc_brake", 0x0100),
    ("ramp", 0x0C00),
    ("warning", 0x1000),
    ("current_limiting", 0x2000),
    ("overvoltage_stall", 0x4000),
    ("undervoltage_stall", 0x8000),
];
const STATUS_WORD_2: [(&str, u16); 4] =
    [("control_channel", 0x0003), ("motor", 0x000C), ("control_mode", 0x0030), ("running_mode", 0x00C0)];
const DIRECTION_WORD: [(&str, u16); 6] = [
    ("running_frequency", 0x0001),
    ("set_frequency", 0x0002),
    ("main_frequency", 0x0004),
    ("auxiliary_frequency", 0x0008),
    ("up_down_offset", 0x0010),
    ("encoder_frequency", 0x0020),
];

#[test]
fn registers_are_those_of_the_manual() {
    let profile = vfd500();
    let mut listed = Vec::new();
    for row in REGISTERS.lines().map(str::trim).filter(|row| !row.is_empty()) {
        let [address, name, unit, scale, sign, low, high] = row.split_whitespace().collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let entry = profile.entry_at(hex(address)).unwrap();
        let quantity = entry.quantity();
        assert_eq!((entry.name(), entry.access().name()), (name, "wo"));
        // Page 135 prints the address of one row; those of the others are inferred from it.
        let evidence = if address == "7001" { Evidence::Verified } else { Evidence::Unverified };
        assert_eq!(entry.evidence(), evidence, "{name}");
        assert_eq!(quantity.variant().is_some(), scale == "-", "{name}");
        if scale != "-" {
            assert_eq!(quantity.unit(), unit.trim_matches('-'), "{name}");
            assert_eq!(quantity.scale(), scale.parse().ok(), "{name}");
            assert_eq!(quantity.is_signed(), sign == "s", "{name}");
        }
        for (word, bound) in [(low, quantity.low()), (high, quantity.high())] {
            assert_eq!(bound, (word != "-").then(|| entry.decode(hex(word))), "{name}");
        }
        listed.push(entry.name().to_owned());
    }
    let registers = profile.entries().filter(|entry| entry.code().is_none());
    assert_eq!(registers.map(|entry| entry.name().to_owned()).collect::<Vec<_>>(), listed);
}

#[test]
fn parameters_are_those_of_the_manual() {
    let profile = vfd500();
    let words: Vec<&str> = PARAMETERS.split_whitespace().collect();
    let mut listed = Vec::new();
    for row in words.chunks_exact(5) {
        let [code, address, low, high, printed] = *row else { panic!("{row:?}") };
        let entry = profile.find(code).unwrap();
        assert_eq!(entry.address(), Some(hex(address)), "{code}");
        for (word, bound) in [(low, entry.quantity().low()), (high, entry.quantity().high())] {
            assert_eq!(bound, (word != "-").then(|| entry.decode(hex(word))), "{code}");
        }
        let evidence = match printed {
            "y" => Evidence::Verified,
            "i" => Evidence::Unverified,
            _ => Evidence::Assumed,
        };
        assert_eq!(entry.evidence(), evidence, "{code}");
        assert_eq!(entry.access().name() == "ro", code.starts_with('r'), "{code}");
        listed.push(code);
    }
    // One more takes two words: r16.00, the low word first (page 137).
    let energy = profile.find("r16.00").unwrap();
    assert_eq!((energy.address(), energy.words()), (Some(0x1000), 2));
    assert_eq!(energy.quantity().decode_words(&[0x86A0, 0x0001]).unwrap().count(), 100_000);
    assert_eq!(energy.quantity().high().unwrap().count(), 0xFFFF_FFFF);
    let codes: Vec<&str> =
        profile.entries().filter_map(|entry| entry.code()).filter(|code| *code != "r16.00").collect();
    assert_eq!(codes, listed);
}

#[test]
fn bits_are_those_of_page_96() {
    let profile = vfd500();
    let fields = |name: &str| -> Vec<(String, u16)> {
        let entry = profile.find(name).unwrap();
        entry.bits().iter().map(|field| (field.name().to_owned(), field.mask())).collect()
    };
    let typed = |list: &[(&str, u16)]| list.iter().map(|&(name, mask)| (name.to_owned(), mask)).collect::<Vec<_>>();
    assert_eq!(fields("status_word_1"), typed(&STATUS_WORD_1));
    assert_eq!(fields("status_word_2"), typed(&STATUS_WORD_2));
    assert_eq!(fields("direction_word"), typed(&DIRECTION_WORD));
    let channel = &profile.find("status_word_2").unwrap().bits()[0];
    assert_eq!([0, 1, 2].map(|raw| channel.meaning(raw).into_owned()), ["keypad", "terminal", "communication"]);
    // Page 136 reads 0012H as DI1 and DI5; bit 4 is DI5, so bit 1 cannot be DI1.
    let inputs = profile.find("r06.00").unwrap();
    let on: Vec<&str> = inputs.bits().iter().filter(|bit| bit.meaning(0x0012) == "on").map(BitField::name).collect();
    assert_eq!(on, ["DI2", "DI5"]);
}

#[test]
fn rules_are_those_of_the_manual() {
    let profile = vfd500();
    let serial = profile.serial().unwrap();
    assert_eq!((serial.baud_rate, serial.data_bits, serial.parity, serial.stop_bits), (9_600, 8, 'N', 1));
    assert_eq!(serial.unit, None, "the factory address is not printed");
    let codes: Vec<u16> = profile.faults().map(|fault| fault.code).collect();
    assert_eq!(codes, (0..=38).collect::<Vec<u16>>());
    for (code, part) in [(1, "circuit"), (11, "Motor overload"), (34, "Communication timeout"), (38, "User-defined")] {
        assert!(profile.fault(code).label.contains(part), "fault {code}");
    }
    assert_eq!(profile.fault(34).mnemonic, "Er.485");
    // No fault of another family is lent.
    assert_eq!(profile.fault(39).label, "Unknown fault 39");
    let signature = profile.signature().unwrap();
    assert_eq!(
        (&*signature.answers, &*signature.refuses),
        ([0x1900.into(), 0x1E0E.into()].as_slice(), [0x2103.into()].as_slice())
    );
    // A read must not run from one group into the next: r25.00 and r27.00 are two reads, P30.01 to P30.05 are one.
    let plan = |names: &[&str]| {
        let entries: Vec<_> = names.iter().map(|name| profile.find(name).unwrap()).collect();
        profile.plan(entries).unwrap().len()
    };
    assert_eq!(plan(&["r25.00", "r16.00"]), 2);
    assert_eq!(plan(&["r30.06", "r30.07", "r30.08"]), 1);
}
