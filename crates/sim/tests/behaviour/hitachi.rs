//! What frames do to a Hitachi SJ200: its manual, pp. B-12, B-13 and B-19 (manualsonline sj200_series, p. 226; manualsdump 112379, p. 227;
//! manualslib 68018, p. 233). Words are typed by hand.

use crate::bench::{Bench, hex};

/// Asks it, and lets a minute pass.
fn told(bench: &mut Bench, request: &str) {
    assert_eq!(bench.ask(1, &hex(request)), Some(hex(request)), "{request}");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
}

/// d003 and d001.
fn seen(bench: &mut Bench) -> ([u16; 1], [u16; 1]) {
    (bench.read::<1>(0x000C), bench.read::<1>(0x000A))
}

const RUN: &str = "05 00 01 FF 00";
const STOP: &str = "05 00 01 00 00";
const FORWARD: &str = "05 00 02 FF 00";
const REVERSE: &str = "05 00 02 00 00";

#[test]
fn one_is_forward_and_a_run_alone_turns_in_reverse() {
    let mut bench = Bench::of("sj200");
    bench.write(0x0001, 200);
    told(&mut bench, RUN);
    assert_eq!(seen(&mut bench), ([2], [200]));
    told(&mut bench, STOP);
    assert_eq!(seen(&mut bench), ([0], [0]));
    told(&mut bench, FORWARD);
    assert_eq!(seen(&mut bench), ([0], [0]));
    told(&mut bench, RUN);
    assert_eq!(seen(&mut bench), ([1], [200]));
    assert!((bench.drive().frequency() - 20.0).abs() < 0.01);
    told(&mut bench, REVERSE);
    assert_eq!(seen(&mut bench), ([2], [200]));
}

#[test]
fn the_numbers_of_its_manual_are_the_addresses() {
    let mut bench = Bench::of("sj200");
    // "50Hz" in A020.
    assert_eq!(bench.ask(1, &hex("06 00 3A 01 F4")), Some(hex("06 00 3A 01 F4")));
    // Coil 0000h is reserved, and no register is at 1003H, where a WJ200 has d003.
    assert_eq!(bench.ask(1, &hex("05 00 00 FF 00")), Some(hex("85 02")));
    bench.refuses_read(0x1003, 1, 0x02);
    // 21H and 22H: L200 manual (manualsonline l200), p. 233 (B-17).
    bench.refuses_write(0x0001, 4_001, 0x21);
    bench.refuses_write(0x000A, 1, 0x22);
}

#[test]
fn a_trip_is_told_by_a_coil_and_reset_by_another() {
    let mut bench = Bench::of("sj200");
    bench.drive().trip(1).unwrap();
    // Coil 0014H, alarm.
    assert_eq!(bench.ask(1, &hex("01 00 14 00 01")), Some(hex("01 01 01")));
    told(&mut bench, "05 00 04 FF 00");
    assert_eq!(bench.ask(1, &hex("01 00 14 00 01")), Some(hex("01 01 00")));
}
