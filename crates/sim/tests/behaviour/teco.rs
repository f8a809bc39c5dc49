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
