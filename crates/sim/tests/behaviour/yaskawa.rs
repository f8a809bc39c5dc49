//! What words do to a Yaskawa A1000 and a J1000. J1000 User Manual SIEP C710606 33A, pp. 197, 198 and 206; Technical Manual 31B, p. 231.
//! A1000 Technical Manual SIEP C710616 27G, pp. 559 and 561. Words are typed by hand.

use crate::bench::{Bench, hex};

const ENTER: u16 = 0x0900;
const COMMAND_SOURCE: u16 = 0x0181;

fn asks(bench: &mut Bench, pdu: &str, answer: &str) {
    assert_eq!(bench.ask(1, &hex(pdu)), Some(hex(answer)), "{pdu}");
}

/// The frame is a GA700's; 002CH: running, ready.
#[test]
fn an_a1000_runs_by_bits_and_refuses_as_its_sisters_say() {
    let mut bench = Bench::of("a1000");
    asks(&mut bench, "10 00 01 00 02 04 00 01 17 70", "10 00 01 00 02");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<3>(0x002B), [0, 0x0041, 0]);
    assert_eq!(bench.read::<1>(0x0039), [0]);
    asks(&mut bench, "10 00 01 00 01 02 00 03", "90 21");
    asks(&mut bench, "10 00 4B 00 01 02 00 00", "90 22");
    asks(&mut bench, "10 01 80 00 01 02 00 00", "90 22");
    asks(&mut bench, "03 00 20 00 04", "83 02");
    asks(&mut bench, "03 00 23 00 11", "83 03");
    asks(&mut bench, "06 00 01 00 00", "86 01");
}

#[test]
fn it_runs_by_the_frame_of_its_manual_and_stops_by_0() {
    let mut bench = Bench::of("j1000");
    asks(&mut bench, "10 00 01 00 02 04 00 01 02 58", "10 00 01 00 02");
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    // 0258H counts hundredths here: 6 Hz. Running, ready.
    assert_eq!(bench.read::<5>(0x0020), [0x0005, 0, 0, 600, 600]);
    bench.write_many(0x0001, &[2]);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<1>(0x0020), [0x0007]);
    bench.write_many(0x0001, &[0]);
    let begin = bench.taken();
    bench.go_to(begin, 60.0);
    assert_eq!(bench.read::<1>(0x0020), [0x0004]);
}

#[test]
fn it_refuses_as_its_manual_says() {
    let mut bench = Bench::of("j1000");
    asks(&mut bench, "06 00 01 00 00", "86 01");
    asks(&mut bench, "03 09 00 00 01", "83 02");
    asks(&mut bench, "03 00 20 00 11", "83 03");
    asks(&mut bench, "10 01 81 00 01 02 00 09", "90 21");
    asks(&mut bench, "10 00 20 00 01 02 00 00", "90 22");
}

#[test]
fn any_enter_command_stores_all_and_nothing_else_does() {
    let mut bench = Bench::of("j1000");
    bench.write_many(COMMAND_SOURCE, &[1]);
    bench.drive().power_cycle();
    assert_eq!(bench.read::<1>(COMMAND_SOURCE), [2]);
    bench.write_many(COMMAND_SOURCE, &[1]);
    assert_eq!(bench.drive().eeprom_writes(), 0);
    bench.write_many(ENTER, &[0]);
    assert_eq!(bench.drive().eeprom_writes(), 1);
    bench.drive().power_cycle();
    assert_eq!(bench.read::<1>(COMMAND_SOURCE), [1]);
}
