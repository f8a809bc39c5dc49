//! What words do to a Toshiba VF-S15: its RS485 manual E6581913, pp. 26 and 31; the bits of LinuxCNC's vfs11_vfd. Words are typed by
//! hand.

use crate::bench::{Bench, hex};

const COMMAND: u16 = 0xFA00;

fn told(bench: &mut Bench, word: u16) -> ([u16; 1], [u16; 1]) {
    bench.write(COMMAND, word);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    (bench.read::<1>(0xFD01), bench.read::<1>(0xFD00))
}

#[test]
fn both_high_bits_are_in_every_command() {
    let mut bench = Bench::of("vf-s15");
    bench.write(0xFA01, 1_000);
    assert_eq!(told(&mut bench, 0xC400), ([0x0400], [1_000]));
    assert_eq!(told(&mut bench, 0xC000), ([0x0000], [0]));
    assert_eq!(told(&mut bench, 0xC600), ([0x0600], [1_000]));
    assert_eq!(told(&mut bench, 0xC800), ([0x0000], [0]));
    for word in [0, 0x0400, 0x4400, 0x8400] {
        bench.refuses_write(COMMAND, word, 0x03);
    }
}

#[test]
fn a_trip_is_told_and_reset() {
    let mut bench = Bench::of("vf-s15");
    bench.drive().trip(0x0E).unwrap();
    assert_eq!((bench.read::<1>(0xFD01), bench.read::<1>(0xFC90)), ([0x0003], [0x000E]));
    assert_eq!(told(&mut bench, 0xE000), ([0x0000], [0]));
}

#[test]
fn it_refuses_as_its_manual_says() {
    let mut bench = Bench::of("vf-s15");
    for (request, answer) in
        [("06 FF FF 00 00", "86 02"), ("03 FD 00 00 02", "83 03"), ("10 FA 00 00 01 02 C4 00", "90 01")]
    {
        assert_eq!(bench.ask(1, &hex(request)), Some(hex(answer)), "{request}");
    }
    // 60 Hz, as the manual writes it.
    assert_eq!(bench.ask(1, &hex("06 FA 01 17 70")), Some(hex("06 FA 01 17 70")));
}
