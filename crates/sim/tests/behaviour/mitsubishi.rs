//! What a Mitsubishi FR-D700 does by the bits of 0008H: bbctrl-firmware, vfd_spindle.c, fr_d700_regs. Words are typed by hand.

use crate::bench::{Bench, hex};

const COMMAND: u16 = 0x0008;

/// One that obeys the bus: Pr.340 is 1; with 10 Hz set.
fn obeying() -> Bench {
    let mut bench = Bench::of("fr-d700");
    bench.write(0x053B, 1);
    bench.write(0x000D, 1_000);
    bench
}

fn told(bench: &mut Bench, word: u16) -> ([u16; 2], [u16; 1]) {
    bench.write(COMMAND, word);
    let begin = bench.taken();
    bench.go_to(begin, 30.0);
    (bench.read::<2>(COMMAND), bench.read::<1>(0x00C8))
}

#[test]
fn one_register_is_the_command_and_the_state() {
    let mut bench = obeying();
    // The mode beside it is the bus's, 4.
    assert_eq!(told(&mut bench, 2), ([0x0003, 4], [1_000]));
    assert_eq!(told(&mut bench, 1), ([0x0000, 4], [0]));
    assert_eq!(told(&mut bench, 4), ([0x0005, 4], [1_000]));
    assert_eq!(told(&mut bench, 0), ([0x0000, 4], [0]));
    // Both ways at once are none.
    assert_eq!(told(&mut bench, 6), ([0x0000, 4], [0]));
    bench.drive().trip(16).unwrap();
    assert_eq!(bench.read::<1>(COMMAND), [0x8000]);
}

#[test]
fn of_two_setpoints_one_is_kept() {
    let mut bench = obeying();
    let before = bench.drive().eeprom_writes();
    // 05 06 00 0D 17 70 is 60 Hz: the manual, p. 206, as PortDock quotes it.
    let request = hex("06 00 0D 17 70");
    assert_eq!(bench.ask(1, &request), Some(request));
    assert_eq!(bench.drive().eeprom_writes(), before);
    bench.write(0x000E, 6_000);
    assert_eq!(bench.drive().eeprom_writes(), before + 1);
}

#[test]
fn without_the_network_mode_nothing_moves() {
    let mut bench = Bench::of("fr-d700");
    bench.write(0x000D, 1_000);
    assert_eq!(told(&mut bench, 2), ([0, 0], [0]));
}

#[test]
fn what_sets_parameters_back_takes_no_chance_word() {
    let mut bench = obeying();
    for address in [0x0002, 0x0003, 0x0005, 0x0006] {
        for word in [0, 1, 2] {
            bench.refuses_write(address, word, 0x03);
        }
        bench.refuses_read(address, 1, 0x02);
    }
}
