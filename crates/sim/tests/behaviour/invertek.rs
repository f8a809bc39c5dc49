//! What words do to an Invertek Optidrive E3: ODE-3 fieldbus guide 1.00, p. 35; E3 advanced technical manual, p. 35. Words are typed by hand.

use crate::bench::Bench;

const CONTROL: u16 = 0x0000;
const SETPOINT: u16 = 0x0001;
const STATUS: u16 = 0x0005;
const FREQUENCY: u16 = 0x0006;

/// One that obeys the bus, with 20.0 Hz set.
fn obeying() -> Bench {
    let mut bench = Bench::of("optidrive-e3");
    bench.write(0x008B, 3);
    bench.write(SETPOINT, 200);
    bench
}

/// The status word and the output frequency `seconds` after `word`.
fn told(bench: &mut Bench, word: u16, seconds: f64) -> ([u16; 1], [u16; 1]) {
    bench.write(CONTROL, word);
    let begin = bench.taken();
    bench.go_to(begin, seconds);
    (bench.read::<1>(STATUS), bench.read::<1>(FREQUENCY))
}

#[test]
fn bit_0_runs_and_its_zero_stops_along_the_ramp() {
    let mut bench = obeying();
    assert_eq!(told(&mut bench, 1, 60.0), ([0x0041], [200]));
    let (status, frequency) = told(&mut bench, 0, 1.0);
    assert!(status == [0x0041] && frequency[0] > 0 && frequency[0] < 200, "{frequency:?}");
    assert_eq!(told(&mut bench, 0, 60.0), ([0x0040], [0]));
}

/// "For example if user set command as 0x0009, drive will do a coast stop rather than run" (p. 35).
#[test]
fn the_higher_bit_wins() {
    for word in [8, 9, 0x0B] {
        let mut bench = obeying();
        assert_eq!(told(&mut bench, word, 60.0), ([0x0040], [0]), "{word}");
        assert_eq!(told(&mut bench, 1, 60.0), ([0x0041], [200]));
        assert_eq!(told(&mut bench, word, 0.1), ([0x0040], [0]), "{word}");
        assert!(bench.drive().speed() > 0.0, "{word}: the shaft coasts");
    }
    for word in [2, 3] {
        let mut bench = obeying();
        assert_eq!(told(&mut bench, word, 60.0), ([0x0040], [0]), "{word}");
        assert_eq!(told(&mut bench, 1, 60.0), ([0x0041], [200]));
        assert_eq!(told(&mut bench, word, 60.0), ([0x0040], [0]), "{word}");
    }
}

#[test]
fn the_number_of_a_fault_is_the_high_byte_and_a_reset_starts_nothing() {
    let mut bench = obeying();
    bench.drive().trip(14).unwrap();
    assert_eq!((bench.read::<1>(STATUS), bench.read::<1>(0x07DF)), ([0x0E02], [14]));
    // Bit 2 of the extended status word.
    assert_eq!(bench.read::<1>(0x07D0), [0x0004]);
    assert_eq!(told(&mut bench, 1, 1.0), ([0x0E02], [0]));
    assert_eq!(told(&mut bench, 4, 60.0), ([0x0040], [0]));
    // The bit has to rise.
    bench.drive().trip(3).unwrap();
    assert_eq!(told(&mut bench, 4, 1.0), ([0x0302], [0]));
    assert_eq!(told(&mut bench, 0, 1.0), ([0x0302], [0]));
    assert_eq!(told(&mut bench, 4, 1.0), ([0x0040], [0]));
}

#[test]
fn it_obeys_only_by_p_12_and_takes_no_setpoint_above_p_01() {
    let mut bench = Bench::of("optidrive-e3");
    bench.write(SETPOINT, 200);
    assert_eq!(told(&mut bench, 1, 60.0), ([0x0040], [0]));
    bench.refuses_write(SETPOINT, 5_001, 0x03);
    bench.refuses_write(STATUS, 0, 0x02);
    bench.refuses_read(0x2103, 1, 0x02);
}
