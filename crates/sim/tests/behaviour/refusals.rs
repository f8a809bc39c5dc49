//! Every refusal, and the manual's worked examples.

use std::time::Duration;

use drivebus_line::Line;
use drivebus_rtu::ExceptionCode;
use drivebus_sim::{Asked, Options, Refusals, SimError};

use crate::bench::{Bench, hex, pdu, write_many_pdu};

#[test]
fn the_worked_examples_of_the_manuals_come_out_byte_by_byte() {
    let mut bench = Bench::new();
    for _ in 0..6 {
        bench.simulator.drive(3).unwrap().trip(35).unwrap();
    }
    let examples = [
        // GD350 operation manual, 9.4.3: echo
        ("01 08 00 00 12 AB AD 14", "01 08 00 00 12 AB AD 14"),
        // 9.4.7, frames in GD300L manual p. 134: P00.01 = 3 is out of range
        ("01 06 00 01 00 03 98 0B", "01 86 04 43 A3"),
        // 9.4.8, frames in GD300L manual p. 134: state word 1 of a stopped drive
        ("01 03 21 00 00 01 8E 36", "01 03 02 00 03 F8 45"),
        // 9.4.8, frames in GD300L manual p. 134: P07.27 to P07.32 after six faults STo (35)
        ("03 03 07 1B 00 06 B5 59", "03 03 0C 00 23 00 23 00 23 00 23 00 23 00 23 5F D2"),
        // GD300 manual p. 231: P00.03 = 100.00 Hz
        ("03 06 00 03 27 10 62 14", "03 06 00 03 27 10 62 14"),
        // GD300 manual p. 231: forward at 10.00 Hz
        ("01 10 20 00 00 02 04 00 01 03 E8 3B 10", "01 10 20 00 00 02 4A 08"),
        // GD300 manual p. 232: P00.11 = 10.0 s, P00.12 = 20.0 s
        ("01 10 00 0B 00 02 04 00 64 00 C8 F2 55", "01 10 00 0B 00 02 30 0A"),
        // GD300 manual p. 227: P01.20 = 5.0 s written (answered by an echo) and read; only the answer of the read is
        // printed, the CRC of its request was computed bit by bit
        ("01 06 01 14 00 32 49 E7", "01 06 01 14 00 32 49 E7"),
        ("01 03 01 14 00 01 C5 F2", "01 03 02 00 32 39 91"),
    ];
    for (request, answer) in examples {
        assert_eq!(bench.exchange(&hex(request)), hex(answer), "{request}");
    }
}

#[test]
fn each_refusal_has_its_code() {
    let mut bench = Bench::new();
    #[rustfmt::skip]
    let table = [
        // 01: functions the drive does not have
        (pdu(0x04, &[0x3000, 1]), 0x01),
        (pdu(0x01, &[0x0000, 1]), 0x01),
        (vec![0x2B, 0x0E, 0x01, 0x00], 0x01),
        (pdu(0x08, &[0x0001, 0]), 0x01),
        // 02: no such address
        (pdu(0x03, &[0x6000, 1]), 0x02),
        (pdu(0x06, &[0x6000, 1]), 0x02),
        (pdu(0x03, &[0x3010, 8]), 0x02),       // 3010H to 3017H: one too far
        (pdu(0x03, &[0x200E, 2]), 0x02),
        (pdu(0x03, &[0xFFFF, 2]), 0x02),       // beyond the last address
        (pdu(0x03, &[0x6300, 1]), 0x02),       // P99.00
        (pdu(0x06, &[0x6300, 1]), 0x02),
        (pdu(0x06, &[0xE300, 1]), 0x02),
        (pdu(0x03, &[0x800B, 1]), 0x02),       // P00.11 in RAM cannot be read
        (pdu(0x06, &[0xA000, 1]), 0x02),       // the 2000H block has no RAM form
        (pdu(0x06, &[0xA100, 1]), 0x02),
        // 03: quantity and structure
        (pdu(0x03, &[0x3000, 0]), 0x03),
        (pdu(0x03, &[0x3000, 17]), 0x03),
        (pdu(0x03, &[0x3000, 126]), 0x03),
        (pdu(0x03, &[0x3000]), 0x03),
        (pdu(0x06, &[0x2001]), 0x03),
        (vec![0x10, 0x20, 0x01, 0x00, 0x01, 0x04, 0, 0, 0, 0], 0x03),
        (vec![0x10, 0x20, 0x01, 0x00, 0x02, 0x04, 0, 0], 0x03),
        (vec![0x10, 0x20, 0x01, 0x00, 0x00, 0x00], 0x03),
        (write_many_pdu(0x2000, &[0; 17]), 0x03),
        (vec![0x08, 0x00, 0x00, 0x12], 0x03),
        // 04: values
        (pdu(0x06, &[0x0001, 3]), 0x04),
        (pdu(0x06, &[0x2000, 0]), 0x04),
        (pdu(0x06, &[0x2000, 9]), 0x04),
        (pdu(0x06, &[0x2001, 5_001]), 0x04),   // above P00.03
        (pdu(0x06, &[0x2004, 3_001]), 0x04),
        (pdu(0x06, &[0x2004, 0xF447]), 0x04),  // -3001
        (pdu(0x06, &[0x0003, 63_001]), 0x04),
        (pdu(0x06, &[0x0003, 4_999]), 0x04),   // below P00.04
        (pdu(0x06, &[0x8003, 4_999]), 0x04),
        (pdu(0x06, &[0x000B, 36_001]), 0x04),
        (pdu(0x06, &[0x0E03, 201]), 0x04),
        // 07: read only
        (pdu(0x06, &[0x2100, 3]), 0x07),
        (pdu(0x06, &[0x2103, 1]), 0x07),
        (pdu(0x06, &[0x3000, 1]), 0x07),
        (pdu(0x06, &[0x5000, 0]), 0x07),
        (pdu(0x06, &[0x071B, 0]), 0x07),
        (pdu(0x06, &[0x871B, 0]), 0x07),
    ];
    for (request, code) in table {
        let answer = bench.ask(1, &request);
        assert_eq!(answer, Some(vec![request[0] | 0x80, code]), "{request:02X?}");
    }
    assert_eq!(bench.drive().writes(), [], "nothing of it was done");
}

#[test]
fn what_is_at_the_edge_of_a_range_is_taken() {
    let mut bench = Bench::new();
    for (address, value) in [
        (0x2001, 5_000),
        (0x2004, 3_000),
        (0x2004, 0xF448), // -3000
        (0x0003, 63_000),
        (0x2001, 63_000),
        (0x000B, 36_000),
        (0x0E03, 200),
        (0x2009, 0x3F),
        (0x200A, 0x3FF),
        (0x200B, 0x0F),
    ] {
        bench.write(address, value);
        assert_eq!(bench.read::<1>(address), [value]);
    }
    bench.read::<16>(0x3000);
    bench.write_many(0x2001, &[0; 14]);
}

#[test]
fn a_write_of_many_words_is_done_wholly_or_not_at_all() {
    let mut bench = Bench::new();
    // P00.11 fits, P00.12 does not.
    let answer = bench.ask(1, &write_many_pdu(0x000B, &[50, 36_001]));
    assert_eq!(answer, Some(vec![0x90, 0x04]));
    assert_eq!(bench.read::<2>(0x000B), [100, 100]);
    // 2000H fits; 200FH is not there.
    let mut words = [0; 16];
    words[0] = 1;
    assert_eq!(bench.ask(1, &write_many_pdu(0x2000, &words)), Some(vec![0x90, 0x02]));
    assert_eq!(bench.read::<1>(0x2000), [0]);
}

#[test]
fn what_can_change_only_at_standstill_is_refused_while_running() {
    let mut bench = Bench::obedient();
    bench.run(1_000);
    assert_eq!(bench.ask(1, &pdu(0x06, &[0x0003, 6_000])), Some(vec![0x86, 0x08]));
    assert_eq!(bench.ask(1, &pdu(0x06, &[0x8003, 6_000])), Some(vec![0x86, 0x08]));
    bench.write(0x000B, 50);
    bench.write(0x2000, 6);
    bench.write(0x0003, 6_000);
}

#[test]
fn a_password_locks_everything_until_it_is_given() {
    let mut bench = Bench::new();
    bench.write(0x0700, 1_234);
    for request in [pdu(0x03, &[0x2100, 1]), pdu(0x06, &[0x2000, 5]), write_many_pdu(0x000B, &[1, 2])] {
        assert_eq!(bench.ask(1, &request), Some(vec![request[0] | 0x80, 0x09]), "{request:02X?}");
    }
    assert_eq!(bench.drive().register(0x2100), Err(ExceptionCode(0x09)));
    let echo = pdu(0x08, &[0, 0x12AB]);
    assert_eq!(bench.ask(1, &echo), Some(echo.clone()), "the echo reads nothing");

    assert_eq!(bench.ask(1, &pdu(0x06, &[0x0700, 4_321])), Some(vec![0x86, 0x05]));
    bench.write(0x0700, 1_234);
    assert_eq!(bench.read::<1>(0x2100), [3]);
    assert_eq!(bench.read::<1>(0x0700), [0], "a password is not shown");

    bench.drive().power_cycle();
    assert_eq!(bench.ask(1, &pdu(0x03, &[0x2100, 1])), Some(vec![0x83, 0x09]), "the power locks it again");
    bench.write(0x0700, 1_234);
    bench.write(0x0700, 0);
    bench.drive().power_cycle();
    assert_eq!(bench.read::<1>(0x2100), [3], "without a password nothing locks");
}

#[test]
fn a_drive_refuses_what_it_was_told_to_for_as_long_as_was_said() {
    let mut bench = Bench::new();
    let (read, write) = (pdu(0x03, &[0x2100, 1]), pdu(0x06, &[0x000B, 50]));

    bench.drive().refuse(Refusals::new(0x06).of(Asked::Writes).time(Duration::from_secs(2))).unwrap();
    let from = bench.line.now();
    assert_eq!(bench.ask(1, &write), Some(vec![0x86, 0x06]));
    assert_eq!(bench.ask(1, &read), Some(vec![0x03, 2, 0, 3]));
    assert_eq!(bench.ask(3, &write), Some(write.clone()), "another drive was told nothing");
    assert_eq!(bench.drive().writes(), []);
    bench.go_to(from, 1.9);
    assert_eq!(bench.ask(1, &write), Some(vec![0x86, 0x06]));
    bench.go_to(from, 2.0);
    assert_eq!(bench.ask(1, &write), Some(write.clone()));

    bench.drive().refuse(Refusals::new(0x0A).of(Asked::Reads).count(2)).unwrap();
    let told: Vec<_> = (0..3).map(|_| bench.ask(1, &read).unwrap()[0]).collect();
    assert_eq!(told, [0x83, 0x83, 0x03]);

    bench.drive().refuse(Refusals::new(0x06)).unwrap();
    bench.drive().refuse_no_more();
    assert_eq!(bench.ask(1, &read), Some(vec![0x03, 2, 0, 3]));
}

#[test]
fn an_acknowledgement_is_a_refusal_of_what_was_done() {
    let mut bench = Bench::new();
    bench.drive().refuse(Refusals::new(0x05).taken()).unwrap();
    assert_eq!(bench.ask(1, &pdu(0x06, &[0x000B, 50])), Some(vec![0x86, 0x05]));
    assert_eq!(bench.drive().register(0x000B), Ok(50));
    // Out of range: what the family refuses is refused as the family does, and not acknowledged.
    assert_eq!(bench.ask(1, &pdu(0x06, &[0x000B, 36_001])), Some(vec![0x86, 0x04]));
}

#[test]
fn a_share_of_the_requests_is_refused_by_chance_from_the_seed() {
    let refused = |seed| {
        let mut bench = Bench::with(Options::default().seed(seed));
        bench.drive().refuse(Refusals::new(0x06).share(0.05)).unwrap();
        let answers = (0..1_000).map(|_| bench.ask(1, &pdu(0x03, &[0x2100, 1])).unwrap() == [0x83, 0x06]);
        answers.collect::<Vec<bool>>()
    };
    // Five standard deviations of 6.9 around 50.
    let count = refused(1).into_iter().filter(|&refused| refused).count();
    assert!((16..=84).contains(&count), "{count}");
    assert_eq!(refused(1), refused(1));
    assert_ne!(refused(1), refused(2));

    let drive = Bench::new().drive();
    assert!(matches!(drive.refuse(Refusals::new(0)), Err(SimError::NoException)));
    assert!(matches!(drive.refuse(Refusals::new(6).share(1.5)), Err(SimError::Share { .. })));
}
