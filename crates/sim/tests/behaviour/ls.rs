//! What words do to a LS drive: ACtionMaster manual (CMC; manualsonline and azmanual 65346), p. 81, and what a M100 tells by
//! The-Intrigued-Engineer/RPi-Modbus-VFD. Addresses are one less than printed: LSLV-S100 manual (easymanua.ls lsis s100), p. 141. Words are
//! typed by hand.

use crate::bench::Bench;

#[test]
fn it_runs_by_the_words_of_a_program_for_a_m100() {
    let mut bench = Bench::of("starvert");
    assert_eq!(bench.read::<1>(0x000D), [24_577]);
    // The setpoint and the command in one request.
    bench.answers("10 00 04 00 02 04 07 d0 00 02", "10 00 04 00 02");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!((bench.read::<1>(0x0009), bench.read::<1>(0x000D)), ([2_000], [0x6002]), "20.00 Hz, forward");
    bench.obeys("06 00 05 00 04");
    assert_eq!((bench.read::<1>(0x0009), bench.read::<1>(0x000D)), ([2_000], [0x6004]), "in reverse");
    bench.obeys("06 00 05 00 01");
    assert_eq!((bench.read::<1>(0x0009), bench.read::<1>(0x000D)), ([0], [24_577]));
}

#[test]
fn a_word_of_no_bits_or_of_two_directions_moves_nothing() {
    let mut bench = Bench::of("starvert");
    bench.obeys("06 00 04 07 d0");
    for word in ["06 00 05 00 06", "06 00 05 00 00", "06 00 05 00 20"] {
        bench.obeys(word);
        assert_eq!(bench.read::<1>(0x000D), [24_577], "{word}");
    }
    bench.obeys("06 00 05 00 02");
    bench.obeys("06 00 05 00 00");
    assert_eq!(bench.read::<1>(0x000D), [0x6002], "it still runs");
    bench.obeys("06 00 05 00 03");
    assert_eq!(bench.read::<1>(0x000D), [24_577], "bit 0 counts");
}

#[test]
fn a_trip_shows_bits_and_is_reset_by_bit_3() {
    let mut bench = Bench::of("starvert");
    bench.drive().trip(1 << 1).unwrap();
    assert_eq!((bench.read::<1>(0x000D), bench.read::<1>(0x000E)), ([0x6009], [2]), "overvoltage");
    bench.obeys("06 00 05 00 08");
    assert_eq!((bench.read::<1>(0x000D), bench.read::<1>(0x000E)), ([24_577], [0]));
}

#[test]
fn it_reads_the_same_by_04h_and_refuses_by_its_list() {
    let mut bench = Bench::of("starvert");
    bench.obeys("06 00 04 07 d0");
    bench.answers("04 00 04 00 01", "04 02 07 d0");
    bench.answers("04 00 0d 00 01", "04 02 60 01");
    bench.answers("08 00 00 a5 37", "88 01");
    bench.answers("03 21 03 00 01", "83 02");
    bench.answers("03 ff ff 00 01", "83 02");
    bench.answers("06 00 04 9c 41", "86 03");
    bench.answers("06 00 09 00 01", "86 14");
}
