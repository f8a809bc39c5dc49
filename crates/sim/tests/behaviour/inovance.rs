//! What words do to an Inovance MD500: MD500 manual, pp. 142 and 143; MD500 user manual, pp. 225 and 226. Words are typed by hand.

use crate::bench::Bench;

const COMMAND: u16 = 0x2000;
const SPEED: u16 = 0x1000;
const STATE: u16 = 0x3000;

/// One that obeys the bus, with 10 Hz set: 20 % of the 50 Hz of F0-10.
fn obeying() -> Bench {
    let mut bench = Bench::of("md500");
    for (address, word) in [(0xF002, 2), (0xF003, 9), (SPEED, 2_000)] {
        bench.write(address, word);
    }
    bench
}

fn hertz(bench: &Bench) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "hertz are small")]
    let hertz = bench.drive().frequency().round() as i32;
    hertz
}

fn told(bench: &mut Bench, code: u16, seconds: f64) -> (u16, i32, bool) {
    bench.write(COMMAND, code);
    let begin = bench.taken();
    bench.go_to(begin, seconds);
    let [state] = bench.read::<1>(STATE);
    (state, hertz(bench), bench.drive().speed() != 0.0)
}

#[test]
fn five_coasts_and_six_stops_along_the_ramp() {
    let mut bench = obeying();
    assert_eq!(told(&mut bench, 1, 60.0), (1, 10, true));
    // From 10 Hz the ramp takes two seconds: 10 s are for all of F0-10.
    assert_eq!(told(&mut bench, 6, 1.0), (1, 5, true));
    assert_eq!(told(&mut bench, 6, 60.0), (3, 0, false));
    assert_eq!(told(&mut bench, 2, 60.0), (2, -10, true));
    assert_eq!(told(&mut bench, 5, 0.1), (3, 0, true));
}

#[test]
fn a_setpoint_is_a_share_of_the_highest_frequency_either_way() {
    for (highest, share, expected) in [(5_000, 2_000, 10), (40_000, 500, 20), (10_000, 10_000, 100)] {
        let mut bench = obeying();
        for (address, word) in [(0xF00A, highest), (0xF00C, highest), (SPEED, share)] {
            bench.write(address, word);
        }
        assert_eq!(told(&mut bench, 1, 100.0), (1, expected, true), "{highest} {share}");
    }
    let mut bench = obeying();
    // -20.00 %
    bench.write(SPEED, 0xF830);
    assert_eq!(told(&mut bench, 1, 60.0), (2, -10, true));
    // More than 100.00 %
    bench.refuses_write(SPEED, 10_001, 0x03);
}

#[test]
fn what_is_written_at_00_is_read_at_f0_until_the_power_goes() {
    let mut bench = Bench::of("md500");
    bench.write(0x0002, 2);
    assert_eq!(bench.read::<1>(0xF002), [2]);
    assert_eq!(bench.drive().eeprom_writes(), 0);
    bench.write(0xF002, 1);
    assert_eq!((bench.read::<1>(0xF002), bench.drive().eeprom_writes()), ([1], 1));
    bench.refuses_read(0x0002, 1, 0x02);
}

#[test]
fn a_fault_is_a_number_at_8000_and_seven_resets_it() {
    let mut bench = obeying();
    bench.drive().trip(5).unwrap();
    assert_eq!((bench.read::<1>(STATE), bench.read::<1>(0x8000)), ([3], [5]));
    assert_eq!(told(&mut bench, 7, 0.1), (3, 0, false));
    assert_eq!(bench.read::<1>(0x8000), [0]);
}

#[test]
fn a_read_has_one_word() {
    let mut bench = obeying();
    assert_eq!(bench.read::<1>(0x7001), [1_000]);
    bench.refuses_read(0x7000, 2, 0x03);
    bench.refuses_write(COMMAND, 8, 0x03);
    bench.refuses_read(COMMAND, 1, 0x02);
}
