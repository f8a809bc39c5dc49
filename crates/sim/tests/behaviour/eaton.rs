//! What words do to an Eaton PowerXL DC1: MN04020003Z-EN 12/13, pp. 149 to 153. Words are typed by hand.

use crate::bench::Bench;

const COMMAND: u16 = 0x0000;
const SETPOINT: u16 = 0x0001;
const STATUS: u16 = 0x0005;
const SPEED: u16 = 0x0006;

/// One that obeys the bus, with 20.0 Hz set.
fn obeying() -> Bench {
    let mut bench = Bench::of("dc1");
    bench.write(0x008B, 3);
    bench.write(SETPOINT, 200);
    bench
}

/// The status word and the frequency `seconds` after `word`.
fn told(bench: &mut Bench, word: u16, seconds: f64) -> (u16, u16) {
    bench.write(COMMAND, word);
    let begin = bench.taken();
    bench.go_to(begin, seconds);
    (bench.read::<1>(STATUS)[0], bench.read::<1>(SPEED)[0])
}

#[test]
fn bit_0_runs_and_bit_1_says_which_way() {
    let mut bench = obeying();
    assert_eq!(told(&mut bench, 0, 1.0), (0x0001, 0));
    assert_eq!(told(&mut bench, 1, 60.0), (0x0003, 200));
    assert!(bench.drive().frequency() > 0.0);
    let (status, speed) = told(&mut bench, 0, 1.0);
    assert!(status == 0x0003 && (1..200).contains(&speed), "{status:04X}H, {speed}");
    assert_eq!(told(&mut bench, 0, 60.0), (0x0001, 0));
    assert_eq!(told(&mut bench, 3, 60.0), (0x0007, 200));
    assert!(bench.drive().frequency() < 0.0);
    // The direction alone runs nothing.
    assert_eq!(told(&mut bench, 2, 60.0).1, 0);
}

#[test]
fn bit_3_coasts() {
    for word in [8, 9, 0x0B] {
        let mut bench = obeying();
        assert_eq!(told(&mut bench, 1, 60.0), (0x0003, 200));
        assert_eq!(told(&mut bench, word, 0.1), (0x0001, 0), "{word}");
        assert!(bench.drive().speed() > 0.0, "{word}: the shaft coasts");
    }
}

#[test]
fn the_number_of_a_fault_is_the_high_byte_and_a_reset_starts_nothing() {
    let mut bench = obeying();
    bench.drive().trip(14).unwrap();
    assert_eq!(bench.read::<1>(STATUS), [0x0E08]);
    assert_eq!(told(&mut bench, 1, 1.0), (0x0E08, 0));
    assert_eq!(told(&mut bench, 4, 60.0), (0x0001, 0));
}

#[test]
fn it_obeys_only_by_p_12_and_has_no_register_of_an_optidrive() {
    let mut bench = Bench::of("dc1");
    bench.write(SETPOINT, 200);
    assert_eq!(told(&mut bench, 1, 60.0), (0x0001, 0));
    bench.refuses_write(SETPOINT, 5_001, 0x03);
    bench.refuses_write(STATUS, 0, 0x02);
    bench.refuses_read(0x07D0, 1, 0x02);
    bench.refuses_read(0x2103, 1, 0x02);
    // kW, a DC1.
    assert_eq!(bench.read::<1>(0x000B)[0] & 0x00FF, 0x0040);
}
