//! Goodrive600, Goodrive3000, CHF100A and CHV100: the examples their manuals print, and what they do not have.

use crate::bench::{Bench, hex, pdu, write_many_pdu};
use drivebus_sim::Options;

#[test]
fn the_worked_examples_of_goodrive600_come_out_byte_by_byte() {
    let mut bench = Bench::line_of(&[(1, "gd600"), (2, "gd600"), (3, "gd600")], Options::default());
    let examples = [
        // p. 123: 5000 to 0004H
        ("02 06 00 04 13 88 C5 6E", "02 06 00 04 13 88 C5 6E"),
        // p. 133: two words to 0004H; the printed CRC is that of the 06H example, these were computed
        ("02 10 00 04 00 02 04 13 88 00 32 F8 63", "02 10 00 04 00 02 00 3A"),
        // p. 138: P00.01 = 3 is out of range
        ("01 06 00 01 00 03 98 0B", "01 86 04 43 A3"),
        // p. 138: state word 1 of a stopped drive
        ("01 03 21 00 00 01 8E 36", "01 03 02 00 03 F8 45"),
        // p. 140: P00.03 = 100.00 Hz; forward at 10.00 Hz
        ("03 06 00 03 27 10 62 14", "03 06 00 03 27 10 62 14"),
        ("01 10 20 00 00 02 04 00 01 03 E8 3B 10", "01 10 20 00 00 02 4A 08"),
    ];
    for (request, answer) in examples {
        assert_eq!(bench.exchange(&hex(request)), hex(answer), "{request}");
    }
    bench.write(0x0114, 50);
    assert_eq!(bench.read::<1>(0x0114), [50], "p. 137: 5.0 s");
}

#[test]
fn the_worked_examples_of_goodrive3000_come_out_byte_by_byte() {
    let mut bench = Bench::line_of(&[(1, "gd3000"), (2, "gd3000"), (3, "gd3000")], Options::default());
    let examples = [
        // Manual B, p. 257: two words from 0004H; only the answer is printed
        ("01 03 00 04 00 02 85 CA", "01 03 04 13 88 00 00 7E 9D"),
        // Manual B, p. 258
        ("02 06 00 04 13 88 C5 6E", "02 06 00 04 13 88 C5 6E"),
        // Manual A, p. 210: P01.20 = 5.0 s, written and read
        ("01 06 01 14 00 32 49 E7", "01 06 01 14 00 32 49 E7"),
        ("01 03 01 14 00 01 C5 F2", "01 03 02 00 32 39 91"),
        // p. 205: P00.01 = 3 is out of range
        ("01 06 00 01 00 03 98 0B", "01 86 04 43 A3"),
        // Manual A, p. 213 and 214: P00.03 = 100.00 Hz, forward
        ("03 06 00 03 27 10 62 14", "03 06 00 03 27 10 62 14"),
        ("03 06 20 00 00 01 42 28", "03 06 20 00 00 01 42 28"),
    ];
    for (request, answer) in examples {
        assert_eq!(bench.exchange(&hex(request)), hex(answer), "{request}");
    }
}

#[test]
fn goodrive3000_takes_one_word_at_a_time() {
    for (family, address) in [("gd3000", 0x2000), ("gd3000-rectifier", 0x0B03), ("chf100a", 0x3000)] {
        let mut bench = Bench::of(family);
        for words in [&[1][..], &[1, 1]] {
            assert_eq!(bench.ask(1, &write_many_pdu(address, words)), Some(vec![0x90, 0x01]), "{family}");
        }
        assert_eq!((bench.drive().words_written(), bench.drive().state()), (0, "stopped"), "{family}");
    }
}

#[test]
fn what_no_page_shows_is_not_there() {
    for (family, absent) in [
        ("gd10", &[0x2004, 0x2009, 0x200C, 0x200E, 0x300E, 0x300F, 0x3010, 0x3011, 0x3013][..]),
        ("gd20", &[0x3011]),
        ("gd600", &[0x2003, 0x200A, 0x2101, 0x2103, 0x3002, 0x5000, 0x0E04, 0x1900]),
        ("gd600-rectifier", &[0x2001, 0x2101, 0x2102, 0x3000, 0x0B00, 0x0001]),
        ("gd3000", &[0x2002, 0x2101, 0x2103, 0x3002, 0x5000, 0x000A, 0x0E05, 0x0B00]),
        ("gd3000-rectifier", &[0x2001, 0x2101, 0x2102, 0x3000, 0x0E00, 0x0001]),
        ("chf100a", &[0x2001, 0x2100, 0x2103, 0x0000, 0x0001, 0x3017]),
        ("chv100", &[0x1000, 0x2000, 0x2100, 0x0000, 0x0001, 0x3017]),
    ] {
        let mut bench = Bench::of(family);
        for &address in absent {
            bench.refuses_read(address, 1, 0x02);
            bench.refuses_write(address, 1, 0x02);
        }
    }
}

#[test]
fn fault_and_frequencies_of_goodrive600_and_goodrive3000_stand_where_they_are_assumed_to() {
    for family in ["gd600", "gd3000"] {
        let mut bench = Bench::of(family);
        for (address, value) in [(0x0001, 2), (0x0006, 8), (0x2001, 1_000), (0x2000, 2)] {
            bench.write(address, value);
        }
        let begin = bench.taken();
        bench.go_to(begin, 1.0);
        bench.write(0x2001, 2_000);
        assert_eq!((bench.read::<1>(0x2100), bench.read::<1>(0x3001)), ([2], [2_000]), "{family}");
        let begin = bench.taken();
        bench.go_to(begin, 10.0);
        assert_eq!(bench.read::<2>(0x3000), [2_000, 2_000], "{family}");
        bench.drive().trip(1).unwrap();
        assert_eq!((bench.read::<1>(0x2100), bench.read::<1>(0x2102)), ([4], [1]), "{family}");
    }
}

#[test]
fn goodrive600_and_goodrive3000_refuse_as_their_manuals_say() {
    for family in ["gd600", "gd3000"] {
        let mut bench = Bench::of(family);
        bench.refuses_read(0x2100, 17, 0x03);
        bench.refuses_write(0x2100, 3, 0x07);
        bench.refuses_write(0x2001, 5_001, 0x04); // above P00.03
        assert_eq!(bench.ask(1, &pdu(0x04, &[0x2100, 1])), Some(vec![0x84, 0x01]), "{family}");
        for (address, value) in [(0x0001, 2), (0x0006, 8), (0x2001, 1_000), (0x2000, 1)] {
            bench.write(address, value);
        }
        bench.refuses_write(0x0003, 6_000, 0x08); // at standstill only
        bench.write(0x2000, 6);
        bench.write(0x0700, 77);
        bench.refuses_read(0x2100, 1, 0x09);
        bench.refuses_write(0x2000, 1, 0x09);
        bench.refuses_write(0x0700, 78, 0x05);
        bench.write(0x0700, 77);
        assert_eq!(bench.read::<1>(0x2100), [3], "{family}");
    }
}

#[test]
fn the_rectifier_of_goodrive3000_keeps_its_serial_settings_in_group_11() {
    let mut bench = Bench::of("gd3000-rectifier");
    assert_eq!(bench.read::<6>(0x0B00), [1, 4, 1, 5, 0, 0], "p. 214");
    for (address, highest) in [(0x0B00, 247), (0x0B01, 5), (0x0B02, 5), (0x0B03, 200), (0x0B04, 600), (0x0B05, 3)] {
        bench.refuses_write(address, highest + 1, 0x04);
        bench.write(address, highest);
    }
    // P11.05 = 3 stops without alarm when the bus is silent for P11.04, 0 trips.
    bench.write(0x0B03, 5);
    for (action, state, fault) in [(3, "stopped", 0), (1, "running", 0), (0, "fault", 18)] {
        bench.write(0x0B05, action);
        bench.write(0x2000, 1);
        let begin = bench.taken();
        bench.go_to(begin, 61.0);
        assert_eq!((bench.drive().state(), bench.drive().fault()), (state, fault), "{action}");
    }
}

#[test]
fn chf100a_and_chv100_show_the_block_at_3000h() {
    for family in ["chf100a", "chv100"] {
        let mut bench = Bench::of(family);
        let [running, set, bus, ..] = bench.read::<16>(0x3000);
        assert_eq!((running, set, bus), (0, 5_000, 5_370), "{family}");
        bench.refuses_write(0x3000, 1, 0x07);
        bench.drive().trip(3).unwrap();
        assert_eq!(bench.read::<1>(0x5000), [3], "{family}");
    }
}

/// CHF100A manual, p. 107: commands at 1000H, the state at 1001H, a setpoint in percent at 2000H.
#[test]
fn chf100a_takes_commands_at_1000h_and_no_command_at_2000h() {
    let mut bench = Bench::of("chf100a");
    assert_eq!(bench.ask(1, &[0x08, 0, 0, 0x12, 0xAB]), Some(vec![0x88, 0x01]));
    for code in 1..=8 {
        bench.write(0x2000, code); // at most 0.08 %
    }
    bench.refuses_write(0x2000, 10_001, 0x04);
    bench.write(0x2000, (-10_000_i16).cast_unsigned());
    assert_eq!((bench.read::<1>(0x1001), bench.drive().state()), ([3], "stopped"));
    for (code, state) in [(1, 1), (6, 3), (2, 2), (6, 3)] {
        bench.write(0x1000, code);
        assert_eq!(bench.read::<1>(0x1001), [state], "{code}");
        let begin = bench.taken();
        bench.go_to(begin, 120.0); // a coasting motor comes to rest
    }
    for code in [0, 9] {
        bench.refuses_write(0x1000, code, 0x04);
    }
    bench.drive().trip(3).unwrap();
    assert_eq!(bench.read::<1>(0x1001), [4]);
    bench.write(0x1000, 7);
    assert_eq!(bench.read::<1>(0x1001), [3]);
}
