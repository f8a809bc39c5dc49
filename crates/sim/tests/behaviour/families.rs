//! What the families have in common and where they differ, as their manuals print it, in tables of one row a family.

use drivebus_line::Line;
use drivebus_sim::Options;

use crate::bench::{Bench, framed, pdu, write_many_pdu};

/// How one family is brought to run at 10.00 Hz, and how its commands are coded.
struct Way {
    family: &'static str,
    /// What makes it obey the bus.
    control: &'static [(u16, u16)],
    command: u16,
    speed: u16,
}

const GOODRIVE350: &[(u16, u16)] = &[(0x0001, 2), (0x0002, 0), (0x0006, 8)];

const GOODRIVE600: &[(u16, u16)] = &[(0x0001, 2), (0x0006, 8)];

const WAYS: [Way; 11] = [
    Way { family: "gd350", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd35", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd35-h1", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd300", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd10", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    // P00.01 and no P00.02: GD20 manual, p. 140.
    Way { family: "gd20", control: GOODRIVE600, command: 0x2000, speed: 0x2001 },
    Way { family: "gd100", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd200a", control: GOODRIVE350, command: 0x2000, speed: 0x2001 },
    Way { family: "gd600", control: GOODRIVE600, command: 0x2000, speed: 0x2001 },
    Way { family: "gd3000", control: GOODRIVE600, command: 0x2000, speed: 0x2001 },
    Way { family: "vfd500", control: &[(0x0002, 2)], command: 0x7000, speed: 0x7001 },
];

/// The way of one family.
fn way(family: &str) -> &'static Way {
    WAYS.iter().find(|way| way.family == family).unwrap()
}

impl Way {
    /// A drive of the family that obeys the bus and has 10.00 Hz set.
    fn bench(&self) -> Bench {
        let mut bench = Bench::of(self.family);
        for &(address, value) in self.control.iter().chain([&(self.speed, 1_000)]) {
            bench.write(address, value);
        }
        bench
    }

    fn command(&self, bench: &mut Bench, code: u16) {
        bench.write(self.command, code);
        let begin = bench.taken();
        bench.go_to(begin, 1.0);
    }
}

/// Output in tenths of a hertz, state and whether the shaft turns.
fn seen(bench: &Bench) -> (i32, &'static str, bool) {
    let drive = bench.drive();
    #[expect(clippy::cast_possible_truncation, reason = "tenths of a hertz are small")]
    let tenths = (drive.frequency() * 10.0).round() as i32;
    (tenths, drive.state(), drive.speed() != 0.0)
}

const STILL: (i32, &str, bool) = (0, "stopped", false);
const AT_TEN: (i32, &str, bool) = (100, "forward", true);
const SLOWING: (i32, &str, bool) = (50, "forward", true);
const COASTING: (i32, &str, bool) = (0, "stopped", true);

/// What each code does to a motor at standstill and to one that turns forward at 10 Hz, a second later; ramps change
/// the output by 5 Hz in a second, and a jog goes up to 5 Hz.
type Effects = [(u16, (i32, &'static str, bool), (i32, &'static str, bool))];

const GOODRIVE: &Effects = &[
    (1, (50, "forward", true), AT_TEN),
    (2, (-50, "reverse", true), SLOWING),
    (3, (50, "forward", true), AT_TEN),
    (4, (-50, "reverse", true), AT_TEN),
    (5, STILL, SLOWING),
    (6, STILL, COASTING),
    (7, STILL, AT_TEN),
    (8, STILL, AT_TEN),
];

const VFD500: &Effects = &[
    (0, STILL, AT_TEN),
    (1, (50, "forward", true), AT_TEN),
    (2, (-50, "reverse", true), SLOWING),
    (3, (50, "forward", true), AT_TEN),
    (4, (-50, "reverse", true), AT_TEN),
    (5, STILL, COASTING),
    (6, STILL, SLOWING),
    (7, STILL, STILL),
    (8, STILL, AT_TEN),
];

#[test]
fn each_code_does_what_its_family_says() {
    for way in &WAYS {
        let effects = if way.family == "vfd500" { VFD500 } else { GOODRIVE };
        for &(code, from_standstill, from_ten) in effects {
            let mut bench = way.bench();
            way.command(&mut bench, code);
            assert_eq!(seen(&bench), from_standstill, "{} {code} at standstill", way.family);

            let mut bench = way.bench();
            way.command(&mut bench, 1);
            let reached = bench.taken();
            bench.go_to(reached, 3.0);
            way.command(&mut bench, code);
            assert_eq!(seen(&bench), from_ten, "{} {code} at 10 Hz", way.family);
        }
    }
}

#[test]
fn a_code_that_the_family_does_not_know_is_out_of_range_and_does_nothing() {
    for way in &WAYS {
        let codes: &[u16] = if way.family == "vfd500" { &[9, 10, 0x0100] } else { &[0, 9, 10, 0xFFFF] };
        let mut bench = way.bench();
        let before = bench.drive().words_written();
        for &code in codes {
            bench.refuses_write(way.command, code, 0x04);
        }
        assert_eq!((bench.drive().words_written(), seen(&bench)), (before, STILL), "{}", way.family);
    }
}

#[test]
fn only_its_own_reset_ends_a_fault_and_nothing_starts_before() {
    for way in &WAYS {
        let reset = if way.family == "vfd500" { 8 } else { 7 };
        let last = if way.family == "vfd500" { 7 } else { 8 };
        let mut bench = way.bench();
        bench.drive().trip(4).unwrap();
        for code in (1..=last).filter(|&code| code != reset) {
            way.command(&mut bench, code);
            assert_eq!((bench.drive().fault(), seen(&bench)), (4, (0, "fault", false)), "{} {code}", way.family);
        }
        way.command(&mut bench, reset);
        assert_eq!((bench.drive().fault(), seen(&bench)), (0, STILL), "{}", way.family);
    }
}

#[test]
fn commands_for_another_family_reach_nothing() {
    for code in 0..=9 {
        let mut bench = way("vfd500").bench();
        for address in [0x2000, 0xA000, 0x2001, 0x2009, 0x200A] {
            bench.refuses_write(address, code, 0x02);
        }
        assert_eq!(bench.ask(1, &write_many_pdu(0x2000, &[code, 1_000])), Some(vec![0x90, 0x02]));
        assert_eq!(seen(&bench), STILL, "vfd500 {code}");
        for way in WAYS.iter().filter(|way| way.family != "vfd500") {
            let mut bench = way.bench();
            for address in [0x7000, 0xF000, 0x7001] {
                bench.refuses_write(address, code, 0x02);
            }
            assert_eq!(seen(&bench), STILL, "{} {code}", way.family);
        }
    }
}

#[test]
fn each_family_is_known_by_its_code_or_by_having_none() {
    for (family, code) in [
        ("gd350", 0x01A0),
        ("gd35", 0x0108),
        ("gd35-h1", 0x0109),
        ("gd300", 0x010A),
        // GD10 manual, p. 90, and for GD100; GD20 manual, p. 140; GD200A manual V2.6, p. 147.
        ("gd10", 0x010D),
        ("gd20", 0x0106),
        ("gd100", 0x010B),
        ("gd200a", 0x0107),
    ] {
        let mut bench = Bench::of(family);
        assert_eq!((bench.read::<1>(0x2103), bench.read::<1>(0x3016)), ([code], [code]), "{family}");
    }
    for family in [
        "gd600",
        "gd600-rectifier",
        "gd3000",
        "gd3000-rectifier",
        "vfd500",
        "chf100a",
        "chv100",
        "a1000",
        "saj8000m",
        "sunfar-e300",
        "fc51",
        "fc202",
        "atv312",
        "atv12",
        "atv600",
        "atv71",
        "v20",
        "acs355",
        "acs580",
        "h100",
        "yl620",
        "md500",
        "fr-d700",
        "j1000",
        "e510",
        "f510",
        "vf-s15",
        "cfw500",
        "nowforever",
        "frenic",
        "optidrive-e3",
        "optidrive-p2",
        "dc1",
        "smd",
        "starvert",
        "sj200",
        "x200",
    ] {
        Bench::of(family).refuses_read(0x2103, 1, 0x02);
    }
    // It refuses no read.
    assert_eq!(Bench::of("atv320").read::<1>(0x2103), [0x8000]);
    // It has a code of its own for that.
    Bench::of("eds300").refuses_read(0x2103, 1, 0x03);
    // Their output frequency stands there.
    for family in ["ms300", "vfd-e"] {
        assert_eq!(Bench::of(family).read::<1>(0x2103), [0], "{family}");
    }
}

#[test]
fn a_goodrive35_is_ready_by_a_zero_and_takes_nine_inputs() {
    for (family, ready, faulty, inputs) in
        [("gd350", 0xC01, 0xC00, 0x3FF), ("gd300", 1, 0, 0x1FF), ("gd35", 0, 1, 0x1FF), ("gd35-h1", 0, 1, 0x1FF)]
    {
        let mut bench = Bench::of(family);
        assert_eq!(bench.read::<1>(0x2101), [ready], "{family}");
        bench.drive().trip(4).unwrap();
        assert_eq!(bench.read::<1>(0x2101), [faulty], "{family}");
        bench.write(0x200A, inputs);
        bench.refuses_write(0x200A, inputs + 1, 0x04);
    }
}

#[test]
fn bit_15_means_what_the_family_says() {
    // The family, whether a plain address and one with bit 15 are kept; `None`: there is no such address.
    let rules = [
        ("gd350", 0x000B, true, Some(false)),
        ("gd35", 0x000B, true, Some(false)),
        ("gd300", 0x000B, true, Some(false)),
        ("gd10", 0x000B, true, Some(false)),
        ("gd20", 0x000B, true, Some(false)),
        ("gd100", 0x000B, true, Some(false)),
        ("gd200a", 0x000B, true, Some(false)),
        ("gd600", 0x000A, true, None),
        ("gd3000", 0x0114, true, None),
        ("vfd500", 0x0007, false, Some(true)),
    ];
    for (family, parameter, plain, with_bit) in rules {
        for (address, kept) in [(parameter, Some(plain)), (parameter | 0x8000, with_bit)] {
            let mut bench = Bench::of(family);
            let [factory] = bench.read::<1>(parameter);
            let Some(kept) = kept else {
                bench.refuses_write(address, 40, 0x02);
                continue;
            };
            bench.write(address, 40);
            assert_eq!(bench.read::<1>(parameter), [40], "{family} {address:04X}");
            let drive = bench.drive();
            let worn = u64::from(kept);
            let counts = (drive.eeprom_writes(), drive.eeprom_writes_of(parameter), drive.eeprom_writes_of(address));
            assert_eq!(counts, (worn, worn, worn), "{family} {address:04X}");
            drive.power_cycle();
            assert_eq!(bench.read::<1>(parameter), [if kept { 40 } else { factory }], "{family} {address:04X}");
        }
        Bench::of(family).refuses_read(parameter | 0x8000, 1, 0x02);
    }
}

#[test]
fn a_factory_reset_takes_every_parameter_back_and_wears_nothing() {
    for (family, parameter) in [("gd350", 0x000B), ("gd600", 0x000A), ("gd3000", 0x0114), ("vfd500", 0x8007)] {
        let mut bench = Bench::line_of(&[(1, family), (7, family)], Options::default());
        let [factory] = bench.read::<1>(parameter & 0x7FFF);
        bench.write(parameter, 40);
        bench.drive().trip(4).unwrap();
        let worn = bench.drive().eeprom_writes();
        bench.drive().factory_reset().unwrap();
        bench.drive().power_cycle();
        assert_eq!(bench.read::<1>(parameter & 0x7FFF), [factory], "{family}");
        assert_eq!(bench.drive().eeprom_writes(), worn, "{family}");
    }
    // The address and the history of faults stay; a motor that is fed is not reset under way.
    let mut bench = way("gd350").bench();
    bench.drive().trip(4).unwrap();
    bench.drive().factory_reset().unwrap();
    assert_eq!((bench.read::<1>(0x0E00), bench.read::<1>(0x071B), bench.read::<1>(0x0001)), ([1], [4], [0]));
    let mut bench = way("gd350").bench();
    way("gd350").command(&mut bench, 1);
    let refused = bench.drive().factory_reset().unwrap_err().to_string();
    assert_eq!(refused, "unit 1 is running; stop it before its parameters get their factory values");
    assert_eq!(bench.read::<1>(0x0001), [2]);
}

#[test]
fn a_silent_bus_has_the_number_of_the_family() {
    for (family, control, timeout, fault) in [
        ("gd350", GOODRIVE350, 0x0E04, 18),
        ("gd300", GOODRIVE350, 0x0E04, 18),
        ("gd10", GOODRIVE350, 0x0E04, 18),
        ("gd20", GOODRIVE600, 0x0E04, 18),
        ("gd100", GOODRIVE350, 0x0E04, 18),
        ("gd200a", GOODRIVE350, 0x0E04, 18),
        ("gd3000", GOODRIVE600, 0x0E04, 18),
        ("vfd500", way("vfd500").control, 0x1E05, 34),
    ] {
        let mut bench = Bench::of(family);
        for &(address, value) in control {
            bench.write(address, value);
        }
        bench.write(timeout, 20);
        let begin = bench.taken();
        bench.go_to(begin, 1.9);
        assert_eq!(bench.drive().fault(), 0, "{family}");
        bench.go_to(begin, 2.1);
        assert_eq!((bench.drive().fault(), bench.drive().state()), (fault, "fault"), "{family}");
    }
}

#[test]
fn an_overload_has_the_number_of_the_family() {
    for way in &WAYS {
        let mut bench = way.bench();
        way.command(&mut bench, 1);
        bench.drive().set_load(2.0).unwrap();
        let begin = bench.taken();
        bench.go_to(begin, 60.0);
        assert_eq!((bench.drive().fault(), bench.drive().state()), (11, "fault"), "{}", way.family);
    }
}

#[test]
fn four_families_on_one_line_each_take_their_own_codes() {
    let units = [(1, "gd350"), (2, "vfd500"), (3, "gd600"), (4, "gd3000")];
    let mut bench = Bench::line_of(&units, Options::default());
    assert_eq!(bench.simulator.name(), "sim:1=gd350,2=vfd500,3=gd600,4=gd3000");
    for (unit, family) in units {
        let way = way(family);
        for &(address, value) in way.control.iter().chain([&(way.speed, 1_000), &(way.command, 1)]) {
            bench.write_to(unit, address, value);
        }
    }
    let later = bench.line.now() + std::time::Duration::from_secs(3);
    bench.line.sleep(later);
    let drives = |bench: &Bench| {
        units.map(|(unit, _)| {
            let drive = bench.simulator.drive(unit).unwrap();
            (drive.state(), drive.frequency() > 9.9)
        })
    };
    assert_eq!(drives(&bench), [("forward", true); 4]);

    // A broadcast of Goodrive's 6 coasts the Goodrives; the VFD500 has no such address and turns on.
    bench.exchange(&framed(0, &pdu(0x06, &[0x2000, 6])));
    assert_eq!(drives(&bench), [("stopped", false), ("forward", true), ("stopped", false), ("stopped", false)]);
    // 6 at its own address ramps it down.
    bench.write_to(2, 0x7000, 6);
    let later = bench.line.now() + std::time::Duration::from_secs(3);
    bench.line.sleep(later);
    assert_eq!(drives(&bench), [("stopped", false); 4]);
}

#[test]
fn a_rectifier_feeds_and_drives_no_motor() {
    for family in ["gd600-rectifier", "gd3000-rectifier"] {
        let mut bench = Bench::of(family);
        for code in [0, 2, 3, 4, 6, 8, 10] {
            bench.refuses_write(0x2000, code, 0x04);
        }
        bench.refuses_write(0x2001, 1_000, 0x02);
        for (code, word, state) in [(9, 3, "stopped"), (1, 1, "running"), (5, 3, "stopped"), (1, 1, "running")] {
            bench.write(0x2000, code);
            assert_eq!((bench.read::<1>(0x2100), bench.drive().state()), ([word], state), "{family} {code}");
        }
        bench.drive().trip(2).unwrap();
        assert_eq!((bench.read::<1>(0x2100), bench.drive().state()), ([4], "fault"), "{family}");
        bench.write(0x2000, 7);
        assert_eq!((bench.read::<1>(0x2100), bench.drive().fault()), ([3], 0), "{family}");
        assert_eq!((bench.drive().frequency().to_bits(), bench.drive().speed().to_bits()), (0, 0), "{family}");
        let refused = bench.drive().set_load(0.5).unwrap_err().to_string();
        assert_eq!(refused, format!("{family} drives no motor, so it has no load to set"));
    }
}

/// Altivar 71 integrated Modbus (Schneider 1755863), p. 39. 3209, thd, is in the list of parameters (S383, V6.7), and 3210 is not.
#[test]
fn an_altivar_71_has_8000h_for_what_it_has_not_among_others_of_a_read() {
    let mut bench = Bench::of("atv71");
    let [thermal, absent] = bench.read(3209);
    assert_ne!(thermal, 0x8000);
    assert_eq!(absent, 0x8000);
    bench.refuses_read(3210, 1, 0x02);
}
