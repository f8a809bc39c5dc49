//! What words do to a Fuji FRENIC: FRENIC-Ace manual (easymanua.ls fuji-electric frenic-ace-series), p. 563; FRENIC-HVAC/AQUA RS-485
//! manual 24A7-E-0021 (manualslib 1367373), pp. 45 and 46. Words are typed by hand; the bits of S06 are from memory.

use crate::bench::Bench;

const S05: u16 = 0x0705;
const S06: u16 = 0x0706;

fn told(bench: &mut Bench, word: u16) -> ([u16; 1], [u16; 1]) {
    bench.write(S06, word);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    (bench.read::<1>(0x080E), bench.read::<1>(0x0809))
}

#[test]
fn it_turns_both_ways_and_says_so_by_a_sign() {
    let mut bench = Bench::of("frenic");
    bench.write(S05, 1_000);
    assert_eq!(told(&mut bench, 1), ([0x1021], [1_000]));
    assert_eq!(told(&mut bench, 0), ([0x1028], [0]));
    assert_eq!(told(&mut bench, 2), ([0x1022], [0xFC18]));
    assert_eq!(told(&mut bench, 3), ([0x1028], [0]));
}

#[test]
fn an_alarm_is_told_and_reset_at_s14() {
    let mut bench = Bench::of("frenic");
    bench.drive().trip(0x0E).unwrap();
    assert_eq!((bench.read::<1>(0x080E), bench.read::<1>(0x0810)), ([0x1828], [0x000E]));
    bench.write(0x070E, 1);
    assert_eq!((bench.read::<1>(0x080E), bench.read::<1>(0x0810)), ([0x1028], [0x000E]));
}

#[test]
fn an_unused_code_is_zero_and_another_group_is_refused() {
    let mut bench = Bench::of("frenic");
    for address in [0x0028, 0x0063, 0x0100, 0x1001, 0x1363] {
        assert_eq!(bench.read::<1>(address), [0], "{address:04X}H");
    }
    for address in [0x0064, 0x2100, 0x2103, 0x7000] {
        bench.refuses_read(address, 1, 0x02);
    }
}
