//! Two memories, and what a power cycle does to them.

use drivebus_rtu::ExceptionCode;

use crate::bench::{Bench, pdu};

#[test]
fn a_plain_address_writes_both_memories_and_wears_one() {
    let mut bench = Bench::new();
    bench.write(0x000B, 50);
    bench.write(0x000B, 50);
    bench.write_many(0x000B, &[60, 70]);
    let drive = bench.drive();
    assert_eq!((drive.eeprom_writes(), drive.eeprom_writes_of(0x000B), drive.eeprom_writes_of(0x000C)), (4, 3, 1));
    drive.power_cycle();
    assert_eq!(bench.read::<2>(0x000B), [60, 70]);
}

#[test]
fn the_top_bit_writes_ram_only_and_the_power_takes_it() {
    let mut bench = Bench::new();
    bench.write(0x800B, 50);
    assert_eq!(bench.read::<1>(0x000B), [50]);
    assert_eq!(bench.drive().eeprom_writes(), 0);
    assert_eq!(
        bench.drive().writes().iter().map(|write| (write.address, write.value)).collect::<Vec<_>>(),
        [(0x800B, 50)]
    );
    bench.drive().power_cycle();
    assert_eq!(bench.read::<1>(0x000B), [100], "the factory value");
}

#[test]
fn the_control_block_is_no_parameter() {
    let mut bench = Bench::obedient();
    let before = bench.drive().eeprom_writes();
    bench.run(1_000);
    assert_eq!(bench.drive().eeprom_writes(), before);
    bench.drive().power_cycle();
    assert_eq!(bench.read::<2>(0x2000), [0, 0]);
    assert_eq!(bench.read::<1>(0x2100), [3]);
    assert_eq!(bench.drive().frequency().to_bits(), 0.0_f64.to_bits());
}

#[test]
fn a_drive_from_the_factory_knows_its_address_and_obeys_its_keypad() {
    let mut bench = Bench::new();
    assert_eq!(bench.read::<4>(0x0E00), [1, 4, 1, 5], "unit 1, 19 200 bit/s, 8E1, 5 ms");
    assert_eq!(bench.simulator.drive(3).unwrap().register(0x0E00), Ok(3));
    assert_eq!(bench.read::<4>(0x0001), [0, 0, 5_000, 5_000]);
    assert_eq!(bench.read::<1>(0x0006), [0]);
}

#[test]
fn faults_stay_in_the_history_without_wearing_the_counter() {
    let mut bench = Bench::new();
    for code in [4, 11, 18] {
        bench.drive().trip(code).unwrap();
    }
    bench.drive().power_cycle();
    assert_eq!(bench.read::<6>(0x071B), [18, 11, 4, 0, 0, 0], "newest first");
    assert_eq!(bench.read::<1>(0x2102), [0], "no fault outlives the power");
    assert_eq!(bench.drive().eeprom_writes(), 0);
}

#[test]
fn the_keypad_sets_parameters_within_their_rules() {
    let mut bench = Bench::new();
    let drive = bench.drive();
    assert_eq!(drive.set_parameter(0x0E03, 0), Ok(()));
    assert_eq!(drive.set_parameter(0x0E03, 201), Err(ExceptionCode(0x04)));
    assert_eq!(drive.set_parameter(0x071B, 0), Err(ExceptionCode(0x07)));
    assert_eq!(drive.set_parameter(0x2001, 0), Err(ExceptionCode(0x02)), "no parameter");
    assert_eq!((drive.eeprom_writes(), drive.writes()), (0, vec![]));
    drive.power_cycle();
    assert_eq!(bench.read::<1>(0x0E03), [0]);

    assert_eq!(drive.set_parameter(0x0700, 1_234), Ok(()), "a password");
    assert_eq!(bench.ask(1, &pdu(0x03, &[0x0E03, 1])), Some(vec![0x83, 0x09]));
    assert_eq!(drive.set_parameter(0x0700, 0), Ok(()), "the keypad needs none");
    assert_eq!(bench.read::<1>(0x0E03), [0]);
}
