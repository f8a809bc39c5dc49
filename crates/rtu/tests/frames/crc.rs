//! The fast CRC against the bitwise loop, and against printed check values.

use drivebus_rtu::crc::{START, crc16, update, update_bitwise};
use proptest::prelude::*;

#[test]
fn published_check_values() {
    // Catalogue of parametrised CRC algorithms (Greg Cook), CRC-16/MODBUS: check value.
    assert_eq!(crc16(b"123456789"), 0x4B37);
    assert_eq!(crc16(b""), START);
    // Modbus over Serial Line V1.02, appendix B: frame 02 07 carries 41 12.
    assert_eq!(crc16(&[0x02, 0x07]).to_le_bytes(), [0x41, 0x12]);
}

proptest! {
    #[test]
    fn fast_equals_slow_however_the_data_is_cut(start: u16, a: Vec<u8>, b: Vec<u8>) {
        let slow = a.iter().chain(&b).fold(start, |crc, &byte| update_bitwise(crc, byte));
        prop_assert_eq!(update(update(start, &a), &b), slow);
    }
}
