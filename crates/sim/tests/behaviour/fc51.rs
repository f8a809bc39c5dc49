//! What a Danfoss FC 51 does by the bits of its control word: operating instructions MG.02.A4.02, p. 28.
//!
//! Words and bytes are typed by hand. 4000H is 100 % of the reference, which is 50 Hz from the factory; the ramp takes 10 s
//! for these 50 Hz.

use crate::bench::{Bench, hex, pdu};

const CONTROL_WORD: u16 = 0xC34F;
const REFERENCE: u16 = 0xC359;
const STATUS_WORD: u16 = 0xC417;

/// Tenths of a hertz, state, and whether the shaft turns.
fn seen(bench: &Bench) -> (i32, &'static str, bool) {
    let drive = bench.drive();
    #[expect(clippy::cast_possible_truncation, reason = "tenths of a hertz are small")]
    let tenths = (drive.frequency() * 10.0).round() as i32;
    (tenths, drive.state(), drive.speed() != 0.0)
}

/// With 20 % for a reference: 10 Hz.
fn bench() -> Bench {
    let mut bench = Bench::of("fc51");
    bench.write(REFERENCE, 0x0CCD);
    bench
}

fn command(bench: &mut Bench, word: u16, seconds: f64) {
    bench.write(CONTROL_WORD, word);
    let begin = bench.taken();
    bench.go_to(begin, seconds);
}

/// A second after each word: at standstill, and at 10 Hz forward.
#[test]
fn each_bit_does_what_it_says() {
    const STILL: (i32, &str, bool) = (0, "stopped", false);
    const RUNS: (i32, &str, bool) = (50, "forward", true);
    const GOES_ON: (i32, &str, bool) = (100, "forward", true);
    const SLOWS: (i32, &str, bool) = (50, "forward", true);
    for (word, at_standstill, at_ten) in [
        (0x043C, STILL, SLOWS),                   // ramp stop
        (0x047C, RUNS, GOES_ON),                  // start
        (0x847C, (-50, "reverse", true), SLOWS),  // start in reverse
        (0x0434, STILL, (0, "stopped", true)),    // coast
        (0x0474, STILL, (0, "stopped", true)),    // coast, whatever the start bit says
        (0x042C, STILL, SLOWS),                   // quick stop
        (0x046C, STILL, SLOWS),                   // quick stop, whatever the start bit says
        (0x0438, STILL, STILL),                   // DC brake
        (0x045C, STILL, GOES_ON),                 // frozen output
        (0x053C, (50, "forward", true), GOES_ON), // jog
        (0x007C, STILL, GOES_ON),                 // start, but the word does not count
        (0x0000, STILL, GOES_ON),                 // nothing counts
        (0x0034, STILL, GOES_ON),                 // nor does a coast without bit 10
        (0x04BC, STILL, GOES_ON),                 // reset
    ] {
        let mut bench = bench();
        command(&mut bench, word, 1.0);
        assert_eq!(seen(&bench), at_standstill, "{word:04X}H at standstill");
        let mut bench = self::bench();
        command(&mut bench, 0x047C, 3.0);
        assert_eq!(seen(&bench), (100, "forward", true));
        command(&mut bench, word, 1.0);
        assert_eq!(seen(&bench), at_ten, "{word:04X}H at 10 Hz");
    }
}

#[test]
fn a_reset_is_the_rise_of_its_bit() {
    let mut bench = bench();
    command(&mut bench, 0x047C, 1.0);
    bench.drive().hold_fault(4).unwrap();
    assert_eq!(bench.read::<1>(STATUS_WORD), [0x0609]);
    for word in [0x043C, 0x0434, 0x047C] {
        command(&mut bench, word, 0.1);
        assert_eq!(seen(&bench).1, "fault", "{word:04X}H");
    }
    // The cause is still there; when it is gone the bit has to rise again.
    command(&mut bench, 0x04BC, 0.1);
    bench.drive().release_fault();
    command(&mut bench, 0x04BC, 0.1);
    assert_eq!(seen(&bench).1, "fault");
    command(&mut bench, 0x043C, 0.1);
    command(&mut bench, 0x04BC, 0.1);
    assert_eq!((seen(&bench).1, bench.read::<1>(STATUS_WORD)), ("stopped", [0x0607]));
    // With the bit for a start it resets, and does not start.
    bench.drive().trip(4).unwrap();
    command(&mut bench, 0x043C, 0.1);
    command(&mut bench, 0x04FC, 1.0);
    assert_eq!((seen(&bench), bench.drive().fault()), ((0, "stopped", false), 0));
}

#[test]
fn a_reference_is_a_share_with_a_sign() {
    for (word, tenths) in [(0x4000, 500), (0x2000, 250), (0xE000, -250), (0xC000, -500), (0x7FFF, 500)] {
        let mut bench = Bench::of("fc51");
        bench.write(REFERENCE, word);
        command(&mut bench, 0x047C, 11.0);
        assert_eq!(seen(&bench).0, tenths, "{word:04X}H");
        // The status word has no direction; the main actual value has.
        assert_eq!(bench.read::<1>(STATUS_WORD), [0x0E07]);
        let cut = if word == 0x7FFF { 0x4000 } else { word };
        assert_eq!(bench.read::<1>(0xC421), [cut]);
        assert_eq!(bench.read::<1>(0x3F01), [u16::try_from(tenths.abs()).unwrap()]);
        assert_eq!(bench.read::<1>(REFERENCE), [word]);
    }
}

/// The request and the answer are those of page 33, for parameter number 342; here the time is 10.00 s.
#[test]
fn a_parameter_stands_at_ten_times_its_number_less_one_with_the_high_word_first() {
    let mut bench = Bench::of("fc51");
    let answer = bench.ask(1, &hex("03 0D 5B 00 02"));
    assert_eq!(answer, Some(hex("03 04 00 00 03 E8")));
    assert_eq!(bench.read::<2>(0x0BD5), [0, 50_000]);
    // "Write 1 to PNU3", on the same page.
    bench.write(0x001D, 1);
    assert_eq!((bench.read::<1>(0x001D), bench.drive().eeprom_writes()), ([1], 1));
    for address in [0x0BD5, STATUS_WORD, 0x3F01] {
        bench.refuses_write(address, 1, 0x02);
    }
}

#[test]
fn it_has_no_address_of_the_others_and_no_loop_back() {
    let mut bench = Bench::of("fc51");
    for address in [0x2000, 0x7000, 0x1000, 0x2001, 0x7001, 0x2103] {
        bench.refuses_read(address, 1, 0x02);
        bench.refuses_write(address, 1, 0x02);
    }
    assert_eq!(bench.ask(1, &pdu(0x08, &[0, 0x12AB])), Some(vec![0x88, 0x01]));
    for family in ["gd350", "gd600", "gd3000", "vfd500", "chf100a"] {
        let mut bench = Bench::of(family);
        for address in [CONTROL_WORD, REFERENCE] {
            bench.refuses_write(address, 0x047C, 0x02);
        }
        bench.refuses_read(STATUS_WORD, 1, 0x02);
    }
}
