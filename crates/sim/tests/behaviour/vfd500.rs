//! Veikong VFD500: its words and refusals, as manual pages 96, 97 and 131 to 137 print them or as is assumed of them.

use crate::bench::{Bench, hex, pdu, write_many_pdu};

fn obedient() -> Bench {
    let mut bench = Bench::of("vfd500");
    bench.write(0x0002, 2);
    bench
}

#[test]
fn frames_made_of_what_the_manual_prints_are_answered() {
    let mut bench = Bench::of("vfd500");
    // P00.07 = 40.00 Hz to RAM and to EEPROM; coast and ramp stop; the echo
    for frame in [
        "01 06 00 07 0F A0 3D 83",
        "01 06 80 07 0F A0 14 43",
        "01 06 70 00 00 05 53 09",
        "01 06 70 00 00 06 13 08",
        "01 08 00 00 12 34 ED 7C",
    ] {
        assert_eq!(bench.exchange(&hex(frame)), hex(frame), "{frame}");
    }
    bench.drive().trip(34).unwrap();
    assert_eq!(bench.exchange(&hex("01 03 19 00 00 01 83 56")), hex("01 03 02 00 22 38 5D"), "r25.00");
}

#[test]
fn each_refusal_has_one_of_five_codes() {
    let mut bench = obedient();
    for (request, code) in [
        (pdu(0x04, &[0x1900, 1]), 0x01),
        (pdu(0x08, &[0x0001, 0]), 0x01),
        (pdu(0x03, &[0x2100, 1]), 0x02), // state word 1 of a Goodrive
        (pdu(0x03, &[0x2103, 1]), 0x02), // and its identification
        (pdu(0x03, &[0x3000, 1]), 0x02), // and its monitor block
        (pdu(0x03, &[0x8007, 1]), 0x02), // bit 15 is for writes
        (pdu(0x03, &[0x1900, 2]), 0x02), // past the last of group 25
        (pdu(0x03, &[0x1B13, 16]), 0x02),
        (pdu(0x03, &[0x18FF, 2]), 0x02), // across the end of a group
        (pdu(0x06, &[0x8600, 0]), 0x02), // no EEPROM for r06.00
        (pdu(0x06, &[0xF000, 1]), 0x02), // nor for the command block
        (pdu(0x03, &[0x1B00, 0]), 0x03),
        (pdu(0x03, &[0x1B00, 17]), 0x03),
        (write_many_pdu(0x7000, &[0; 17]), 0x03),
        (pdu(0x06, &[0x7001, 60_001]), 0x04),
        (pdu(0x06, &[0x7002, 30_001]), 0x04),
        (pdu(0x06, &[0x7005, 3_001]), 0x04),
        (pdu(0x06, &[0x7007, 10_001]), 0x04),
        (pdu(0x06, &[0x7009, 1_001]), 0x04),
        (pdu(0x06, &[0x1E04, 0]), 0x04),
        (pdu(0x06, &[0x1E04, 21]), 0x04),
        (pdu(0x06, &[0x1900, 0]), 0x04), // read only; assumed
        (pdu(0x06, &[0x1E06, 0]), 0x04),
        (pdu(0x03, &[0x7000, 1]), 0x05),
        (pdu(0x03, &[0x7001, 10]), 0x05),
    ] {
        assert_eq!(bench.ask(1, &request), Some(vec![request[0] | 0x80, code]), "{request:02X?}");
    }
    bench.write(0x7001, 1_000);
    bench.write(0x7000, 1);
    bench.refuses_write(0x0106, 6_000, 0x04); // while it runs; assumed
}

#[test]
fn the_speed_is_in_the_unit_that_is_set() {
    // P30.14, 7001H, and what comes of it: Hz, from a maximum of 50.00 Hz
    for (unit, word, hertz) in [
        (0_u16, 5_000_u16, 25.0), // 50.00 %
        (0, (-2_000_i16).cast_unsigned(), -10.0),
        (0, 10_000, 50.0),
        (1, 1_234, 12.34),
        (1, 60_000, 50.0), // cut to P01.06
        (2, 600, 20.0),    // rpm of a motor with two pole pairs
        (2, 65_535, 50.0),
    ] {
        let mut bench = obedient();
        bench.write(0x1E0E, unit);
        bench.write_many(0x7000, &[1, word]);
        let begin = bench.taken();
        bench.go_to(begin, 30.0);
        assert!((bench.drive().frequency() - hertz).abs() < 1e-6, "{unit} {word} {}", bench.drive().frequency());
    }
    let mut bench = obedient();
    for (unit, taken, refused) in [(0, 0xD8F0, 0xD8EF), (0, 10_000, 10_001), (1, 60_000, 60_001)] {
        bench.write(0x1E0E, unit);
        for register in [0x7001, 0x7003, 0x7004] {
            bench.write(register, taken);
            bench.refuses_write(register, refused, 0x04);
        }
    }
    bench.refuses_write(0x1E0E, 3, 0x04);
}

#[test]
fn it_obeys_the_bus_only_when_it_is_set_to() {
    for (channel, hertz) in [(0, 0.0), (1, 0.0), (2, 10.0)] {
        let mut bench = Bench::of("vfd500");
        bench.write(0x0002, channel);
        bench.write_many(0x7000, &[1, 1_000]);
        let begin = bench.taken();
        bench.go_to(begin, 5.0);
        assert!((bench.drive().frequency() - hertz).abs() < 1e-6, "{channel}");
        assert_eq!(bench.read::<1>(0x1B13), [channel], "bits 0 and 1 of status word 2");
    }
}

#[test]
fn group_27_and_the_fault_show_what_the_motor_does() {
    let mut bench = obedient();
    assert_eq!(bench.read::<1>(0x1B12), [0b100], "ready");
    bench.write_many(0x7000, &[1, 1_000]);
    let begin = bench.taken();
    bench.go_to(begin, 1.0);
    assert_eq!(bench.read::<1>(0x1B12), [0b101 | 1 << 10], "run, ready, accelerating");
    bench.go_to(begin, 3.0);
    assert_eq!(bench.read::<3>(0x1B00), [1_000, 1_000, 0]);
    assert_eq!(bench.read::<1>(0x1B12), [0b101 | 3 << 10], "at constant speed");
    bench.write(0x7000, 2);
    let begin = bench.taken();
    bench.go_to(begin, 1.0);
    assert_eq!(bench.read::<1>(0x1B12), [0b101 | 2 << 10], "decelerating");
    bench.go_to(begin, 5.0);
    assert_eq!(bench.read::<3>(0x1B00), [1_000, 1_000, 0b01], "the sign of the running frequency");
    assert_eq!(bench.read::<1>(0x1B12), [0b111 | 3 << 10], "reverse");
    bench.write(0x7000, 7);
    assert_eq!(bench.read::<1>(0x1B12), [0b100]);
    bench.write(0x7000, 3);
    let begin = bench.taken();
    bench.go_to(begin, 2.0);
    assert_eq!(bench.read::<1>(0x1B12), [0b101 | 1 << 6 | 3 << 10], "a jog");
    bench.write(0x7000, 6);
    let begin = bench.taken();
    bench.go_to(begin, 2.0);
    assert_eq!(bench.read::<1>(0x1B12), [0b100], "a ramp stop ends it");
    bench.drive().trip(2).unwrap();
    assert_eq!((bench.read::<1>(0x1B12), bench.read::<1>(0x1900)), ([0b1000], [2]));
    bench.drive().set_inputs(0b1_0010).unwrap();
    assert_eq!(bench.read::<1>(0x0600), [0x12], "r06.00");
}

#[test]
fn a_negative_speed_has_its_sign_in_the_direction_word() {
    let mut bench = obedient();
    bench.write(0x1E0E, 0);
    bench.write_many(0x7000, &[1, (-2_000_i16).cast_unsigned()]);
    let begin = bench.taken();
    bench.go_to(begin, 5.0);
    assert_eq!(bench.read::<3>(0x1B00), [1_000, 1_000, 0b11]);
    assert_eq!(bench.drive().state(), "reverse");
}

#[test]
fn the_energy_meter_counts_in_two_words_the_low_one_first() {
    let mut bench = obedient();
    bench.drive().set_load(1.0).unwrap();
    assert_eq!(bench.read::<2>(0x1000), [0, 0]);
    bench.write_many(0x7000, &[1, 5_000]);
    let begin = bench.taken();
    // 4 kW for 20 hours, less the half of the 10 s ramp (torque 1.2 of rated there: 2 s × 5 Hz/s ÷ 50 Hz more).
    bench.go_to(begin, 20.0 * 3_600.0);
    let words = bench.read::<2>(0x1000);
    let counts = u32::from(words[1]) << 16 | u32::from(words[0]);
    assert_eq!((words[1], counts), (1, 79_995), "{words:?}");
    bench.drive().power_cycle();
    assert_eq!(bench.read::<2>(0x1000), words, "it outlives the power");
}

#[test]
fn frames_are_counted() {
    let mut bench = Bench::of("vfd500");
    assert_eq!(bench.read::<3>(0x1E06), [1, 0, 0], "this very request, not yet answered");
    bench.exchange(&hex("01 03 19 00 00 01 83 57")); // a wrong CRC
    bench.exchange(&hex("00 06 70 01 13 88 CE 4D")); // to all
    bench.exchange(&hex("02 06 00 04 13 88 C5 6E")); // to another unit
    assert_eq!(bench.read::<3>(0x1E06), [3, 1, 1]);
}
