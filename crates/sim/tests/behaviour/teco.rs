//! What words do to a Teco E510: E510 communication addendum, pp. 1-3 to 1-14; the frames at 2501H are those of a F510 (its manual,
//! p. 455). Words are typed by hand.

use crate::bench::{Bench, hex};

fn asks(bench: &mut Bench, pdu: &str, answer: &str) {
    assert_eq!(bench.ask(1, &hex(pdu)), Some(hex(answer)), "{pdu}");
}

/// One that obeys the bus.
fn obeying() -> Bench {
    let mut bench = Bench::of("e510");
    asks(&mut bench, "06 00 02 00 02", "06 00 02 00 02");
    asks(&mut bench, "06 00 05 00 05", "06 00 05 00 05");
    bench
}

fn go(bench: &mut Bench, pdu: &str) {
    asks(bench, pdu, pdu);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
}

#[test]
fn it_runs_by_bit_0_and_bit_1_is_the_direction_alone() {
    let mut bench = obeying();
    go(&mut bench, "06 25 02 03 e8");
    go(&mut bench, "06 25 01 00 01");
    // Run, ready; no fault; setpoint and output frequency, 10.00 Hz.
    assert_eq!(bench.read::<5>(0x2520), [0x0005, 0, 0, 1_000, 1_000]);
    go(&mut bench, "06 25 01 00 03");
    assert_eq!(bench.read::<1>(0x2520), [0x0007]);
    go(&mut bench, "06 25 01 00 02");
    assert_eq!(bench.read::<1>(0x2520), [0x0004]);
    go(&mut bench, "06 25 01 00 02");
    assert_eq!(bench.read::<1>(0x2524), [0]);
}

#[test]
fn a_run_and_its_frequency_go_in_one_request() {
    let mut bench = obeying();
    asks(&mut bench, "10 25 01 00 02 04 00 01 13 88", "10 25 01 00 02");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<1>(0x2524), [5_000]);
    go(&mut bench, "06 25 01 00 00");
    assert_eq!(bench.read::<2>(0x2520), [0x0004, 0]);
}

#[test]
fn a_fault_has_its_number_until_bit_3() {
    let mut bench = obeying();
    bench.drive().trip(13).unwrap();
    assert_eq!(bench.read::<2>(0x2520), [0x0008, 13]);
    go(&mut bench, "06 25 01 00 08");
    assert_eq!(bench.read::<2>(0x2520), [0x0004, 0]);
}

#[test]
fn it_refuses_by_its_table() {
    let mut bench = Bench::of("e510");
    asks(&mut bench, "04 25 20 00 01", "84 01");
    asks(&mut bench, "03 20 00 00 01", "83 02");
    asks(&mut bench, "03 01 23 00 01", "83 02");
    asks(&mut bench, "03 25 20 00 11", "83 03");
    asks(&mut bench, "06 25 02 fd e9", "86 04");
    asks(&mut bench, "06 25 20 00 00", "86 05");
    asks(&mut bench, "08 00 00 a5 37", "08 00 00 a5 37");
}

#[test]
fn the_examples_of_its_addendum_set_parameters() {
    let mut bench = obeying();
    bench.drive().take_writes();
    let before = bench.drive().eeprom_writes();
    go(&mut bench, "06 01 02 17 70");
    go(&mut bench, "06 01 01 00 01");
    assert_eq!(bench.read::<1>(0x2520), [0x0004]);
    assert_eq!(bench.drive().eeprom_writes(), before + 2);
}

/// F510 communication addendum, pp. 1-5 to 1-7 and 1-42: the same words, obeyed with 00-05 = 3. Bit 14 of its state says that 00-02 does
/// not obey the bus.
#[test]
fn an_f510_takes_the_words_of_an_e510() {
    let mut bench = Bench::of("f510");
    assert_eq!(bench.read::<1>(0x2520), [0x4004]);
    go(&mut bench, "06 25 01 00 01");
    assert_eq!(bench.read::<1>(0x2524), [0]);
    go(&mut bench, "06 25 01 00 00");
    asks(&mut bench, "06 00 02 00 02", "06 00 02 00 02");
    asks(&mut bench, "06 00 05 00 03", "06 00 05 00 03");
    go(&mut bench, "06 25 02 03 e8");
    go(&mut bench, "06 25 01 00 03");
    assert_eq!(bench.read::<5>(0x2520), [0x0007, 0, 0, 1_000, 1_000]);
    go(&mut bench, "06 25 01 00 02");
    assert_eq!(bench.read::<1>(0x2524), [0]);
    bench.drive().trip(1).unwrap();
    assert_eq!(bench.read::<2>(0x2520), [0x0008, 1]);
    go(&mut bench, "06 25 01 00 08");
    assert_eq!(bench.read::<2>(0x2520), [0x0004, 0]);
}

/// Pp. 1-4 and 1-14 to 1-24: its groups go up to 24, and those of an E510 to 14.
#[test]
fn an_f510_has_more_parameters() {
    let mut bench = Bench::of("f510");
    for last in ["00 38", "02 22", "0b 41", "0c 4c", "0e 2f", "10 25", "14 23", "17 3a", "18 06"] {
        asks(&mut bench, &format!("03 {last} 00 01"), "03 02 00 00");
    }
    for none in ["00 39", "02 14", "0d 0e", "13 00", "17 3b", "18 07", "25 03", "25 2e"] {
        asks(&mut bench, &format!("03 {none} 00 01"), "83 02");
    }
    asks(&mut bench, "06 25 02 9c 41", "86 04");
    asks(&mut bench, "06 25 20 00 00", "86 04");
    for group in ["14", "17"] {
        asks(&mut Bench::of("e510"), &format!("03 {group} 00 00 01"), "83 02");
    }
}
