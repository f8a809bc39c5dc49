//! What the same words do to a Delta VFD-E and to a Yalang YL620, which count hertz by hundredths and by tenths.
//!
//! CP2000 manual, p. 514; VFD-E manual (04EE), pp. 4-117 and 4-126; YL620-A manual, p. 27. Words are typed by hand.

use crate::bench::{Bench, pdu};

const COMMAND: u16 = 0x2000;
const SPEED: u16 = 0x2001;

/// One that obeys the bus, and was told 5 Hz as a Delta drive counts.
fn bench(family: &str, settings: [(u16, u16); 2]) -> Bench {
    let mut bench = Bench::of(family);
    for (address, word) in settings {
        bench.write(address, word);
    }
    bench.write(SPEED, 500);
    bench
}

fn vfd_e() -> Bench {
    bench("vfd-e", [(0x0201, 3), (0x0200, 3)])
}

fn yl620() -> Bench {
    bench("yl620", [(0x0001, 3), (0x0708, 5)])
}

/// What it does some time after `word`, and whole hertz.
fn after(mut bench: Bench, word: u16) -> (&'static str, i32) {
    bench.write(COMMAND, word);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    #[expect(clippy::cast_possible_truncation, reason = "hertz are small")]
    let hertz = bench.drive().frequency().round() as i32;
    (bench.drive().state(), hertz)
}

#[test]
fn the_same_words_are_ten_times_the_speed() {
    for (word, delta, yalang) in [
        (0x12, ("forward", 5), ("forward", 50)),
        (0x22, ("reverse", -5), ("reverse", -50)),
        // By 6 a Goodrive coasts, by 5 it stops.
        (6, ("forward", 5), ("forward", 50)),
        (5, ("stopped", 0), ("stopped", 0)),
        (1, ("stopped", 0), ("stopped", 0)),
    ] {
        assert_eq!(after(vfd_e(), word), delta, "{word:04X}H");
        assert_eq!(after(yl620(), word), yalang, "{word:04X}H");
    }
}

#[test]
fn each_resets_in_its_own_way() {
    let mut bench = vfd_e();
    bench.drive().trip(7).unwrap();
    assert_eq!(bench.read::<1>(0x2100), [7]);
    bench.write(0x2002, 2);
    assert_eq!(bench.read::<2>(0x2100), [0, 0x400]);
    // Where the other one takes its reset, this one takes an acceleration time.
    let mut bench = yl620();
    bench.drive().trip(4).unwrap();
    bench.write(0x2002, 2);
    assert_eq!(bench.read::<2>(0x2008), [4, 0]);
    for reset in [0x40, 0x80] {
        bench.drive().trip(4).unwrap();
        bench.write(COMMAND, reset);
        assert_eq!(bench.read::<2>(0x2008), [0, 0], "{reset:04X}H");
    }
}

#[test]
fn each_refuses_what_its_table_does_not_have() {
    for address in [0x2104, 0x2106, 0x2108, 0x2109, 0x3000] {
        Bench::of("yl620").refuses_read(address, 1, 0x02);
    }
    for address in [0x2008, 0x200B, 0x2012, 0x2105, 0x2106, 0x3000] {
        Bench::of("vfd-e").refuses_read(address, 1, 0x02);
    }
}

/// p. 4-117 reads two words from 2102H; two parameters are not read at once, by a table that names the manual.
#[test]
fn a_vfd_e_reads_one_parameter_at_a_time() {
    let mut bench = vfd_e();
    assert_eq!(bench.read::<2>(0x2102), [500, 0]);
    assert_eq!((bench.read::<1>(0x0200), bench.read::<1>(0x0201)), ([3], [3]));
    bench.refuses_read(0x0200, 2, 0x03);
    bench.refuses_read(0x2100, 8, 0x03);
    assert_eq!(bench.ask(1, &pdu(0x08, &[0, 0x1770])), Some(pdu(0x08, &[0, 0x1770])));
}
