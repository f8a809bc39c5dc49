//! What words do to a Lenze AC Tech SMD: RG-SDMOD (Lenze AC Tech), its printed pages 5, 6, 10, 13, 15 and 27. Words are typed by hand.

use crate::bench::Bench;

#[test]
fn it_takes_nothing_until_it_is_unlocked() {
    let mut bench = Bench::of("smd");
    for refused in ["06 00 01 00 04", "06 00 28 00 c8", "06 00 99 00 01"] {
        bench.answers(refused, "86 01");
    }
    // It can be read all the same: 69, and stopped.
    assert_eq!((bench.read::<1>(19), bench.read::<1>(26)), ([69], [0x2A03]));
    bench.obeys("06 00 30 00 00");
    bench.obeys("06 00 28 00 c8");
    // Bit 1 of register 1 locks it again.
    bench.obeys("06 00 01 00 02");
    bench.answers("06 00 28 00 c8", "86 01");
}

#[test]
fn it_turns_the_way_that_it_was_told_last_and_its_stop_coasts() {
    let mut bench = Bench::of("smd");
    for word in ["06 00 30 00 00", "06 00 28 00 c8", "06 00 01 00 40", "06 00 01 00 08"] {
        bench.obeys(word);
    }
    assert_eq!(
        [24, 25, 26, 27].map(|register| bench.read::<1>(register)[0]),
        [200, 200, 0x2A06, 0x0100],
        "20.0 Hz in reverse"
    );
    bench.obeys("06 00 01 00 80");
    assert_eq!(bench.read::<1>(27), [0]);
    bench.answers("06 00 01 00 04", "06 00 01 00 04");
    assert_eq!((bench.read::<1>(25), bench.read::<1>(26)), ([0], [0x2A03]));
    assert!(bench.drive().speed() > 0.0);
}

#[test]
fn a_loss_of_power_locks_it() {
    let mut bench = Bench::of("smd");
    bench.obeys("06 00 30 00 00");
    bench.drive().power_cycle();
    bench.answers("06 00 01 00 04", "86 01");
}

#[test]
fn it_refuses_by_its_list() {
    let mut bench = Bench::of("smd");
    bench.obeys("06 00 30 00 00");
    bench.answers("08 00 00 a5 37", "88 01");
    bench.answers("03 21 03 00 01", "83 02");
    bench.answers("06 00 28 09 61", "86 03");
    bench.answers("03 00 18 00 02", "83 04");
}
