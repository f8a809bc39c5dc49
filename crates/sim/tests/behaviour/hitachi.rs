//! What frames do to a Hitachi SJ200 and to an X200. SJ200 manual, pp. B-12, B-13 and B-19 (manualsonline sj200_series, p. 226; manualsdump 112379, p. 227;
//! manualslib 68018, p. 233). Words are typed by hand.

use crate::bench::Bench;

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
    bench.obeys(RUN);
    assert_eq!(seen(&mut bench), ([2], [200]));
    bench.obeys(STOP);
    assert_eq!(seen(&mut bench), ([0], [0]));
    bench.obeys(FORWARD);
    assert_eq!(seen(&mut bench), ([0], [0]));
    bench.obeys(RUN);
    assert_eq!(seen(&mut bench), ([1], [200]));
    assert!((bench.drive().frequency() - 20.0).abs() < 0.01);
    bench.obeys(REVERSE);
    assert_eq!(seen(&mut bench), ([2], [200]));
}

#[test]
fn the_numbers_of_its_manual_are_the_addresses() {
    let mut bench = Bench::of("sj200");
    // "50Hz" in A020.
    bench.answers("06 00 3A 01 F4", "06 00 3A 01 F4");
    // Coil 0000h is reserved, and no register is at 1003H, where a WJ200 has d003.
    bench.answers("05 00 00 FF 00", "85 02");
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
    bench.answers("01 00 14 00 01", "01 01 01");
    bench.obeys("05 00 04 FF 00");
    bench.answers("01 00 14 00 01", "01 01 00");
}

/// X200 manual (manualsdir 355636), p. 262: coil 0001h runs, 0002h is 1 for forward, and each is one less on the wire. Coil 000Fh tells the way, 1 for
/// reverse.
#[test]
fn an_x200_has_a_wj200s_coils_and_an_sj200s_direction() {
    let mut bench = Bench::of("x200");
    bench.write(0x0001, 200);
    bench.obeys("05 00 00 FF 00");
    bench.answers("01 00 0D 00 02", "01 01 03");
    assert_eq!((bench.read::<1>(0x1003), bench.read::<1>(0x1001)), ([2], [200]));
    bench.obeys("05 00 01 FF 00");
    bench.answers("01 00 0D 00 02", "01 01 01");
    assert!((bench.drive().frequency() - 20.0).abs() < 0.01);
    bench.obeys("05 00 00 00 00");
    bench.answers("01 00 0D 00 01", "01 01 00");
    assert_eq!((bench.read::<1>(0x1003), bench.read::<1>(0x1001)), ([0], [0]));
}

/// Pp. B-13 and B-16 (azmanual 355636, pp. 256 and 259).
#[test]
fn an_x200_is_written_at_the_numbers_less_one() {
    let mut bench = Bench::of("x200");
    bench.answers("06 10 28 01 F4", "06 10 28 01 F4");
    bench.answers("10 10 13 00 02 04 00 04 93 E0", "10 10 13 00 02");
    assert_eq!(bench.read::<2>(0x1013), [0x0004, 0x93E0]);
    // Where a WJ200 has A001, and an SJ200 A020.
    bench.refuses_read(0x1200, 1, 0x02);
    bench.refuses_read(0x003A, 1, 0x02);
    bench.refuses_write(0x0001, 4_001, 0x21);
    bench.refuses_write(0x1001, 1, 0x22);
    bench.drive().trip(1).unwrap();
    bench.answers("01 00 13 00 01", "01 01 01");
    bench.obeys("05 00 03 FF 00");
    bench.answers("01 00 13 00 01", "01 01 00");
}
