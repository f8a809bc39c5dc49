//! What words do to a WEG CFW500: CFW-11 serial communication manual (WEG 0899.5741); a program for a real CFW500 (cfw500_modbus.py). Words
//! are typed by hand.

use crate::bench::{Bench, hex};

const CONTROL: u16 = 682;

fn asks(bench: &mut Bench, pdu: &str, answer: &str) {
    assert_eq!(bench.ask(1, &hex(pdu)), Some(hex(answer)), "{pdu}");
}

/// P0683 as on p. 26: 06 02 AB 10 00, half of the synchronous speed: 25 Hz. Bits of P0680: p. 14.
#[test]
fn it_runs_either_way_and_its_stop_is_2() {
    let mut bench = Bench::of("cfw500");
    asks(&mut bench, "06 02 AB 10 00", "06 02 AB 10 00");
    asks(&mut bench, "06 02 AA 00 07", "06 02 AA 00 07");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<2>(0x0005), [250, 1]);
    assert_eq!(bench.read::<2>(680), [0x0700, 0x1000]);
    bench.write(CONTROL, 3);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<2>(680), [0x0300, 0xF000]);
    bench.write(CONTROL, 2);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<2>(0x0005), [0, 0]);
    assert_eq!(bench.drive().eeprom_writes(), 0);
}

/// P. 29: 99 is no parameter, and what can only be read is a wrong value. P. 27: two ramps in one request.
#[test]
fn it_refuses_and_takes_as_printed() {
    let mut bench = Bench::of("cfw500");
    asks(&mut bench, "06 00 63 00 00", "86 02");
    asks(&mut bench, "06 02 A8 00 00", "86 03");
    asks(&mut bench, "08 00 00 12 34", "88 01");
    asks(&mut bench, "03 00 08 00 01", "83 02");
    asks(&mut bench, "10 00 64 00 02 04 00 0A 00 14", "10 00 64 00 02");
}

#[test]
fn no_bit_runs_it_without_the_enable() {
    let mut bench = Bench::of("cfw500");
    bench.write(683, 0x1000);
    for word in [0, 1, 4, 5, 0x85] {
        bench.write(CONTROL, word);
        let begin = bench.taken();
        bench.go_to(begin, 5.0);
        assert_eq!(bench.read::<2>(0x0005), [0, 0], "{word}");
    }
}
