//! CRC-16/MODBUS: polynomial 0x8005 reflected, start 0xFFFF, sent low byte first.
//!
//! [`update_bitwise`] is the specification as code. The tables are made from it by the compiler, and the fast path
//! is held equal to it by a property test.
//!
//! Source: *Modbus over Serial Line* V1.02, §2.5.1.2 and appendix B.

/// What the CRC of no bytes is.
pub const START: u16 = 0xFFFF;

/// The polynomial, least significant bit first.
const POLYNOMIAL: u16 = 0xA001;

/// `TABLES[n][b]` is the effect of byte `b` that `n` more bytes follow.
static TABLES: [[u16; 256]; 8] = tables();

const fn tables() -> [[u16; 256]; 8] {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        #[expect(clippy::cast_possible_truncation, reason = "below 256")]
        let mut crc = update_bitwise(0, byte as u8);
        let mut following = 0;
        while following < 8 {
            tables[following][byte] = crc;
            crc = update_bitwise(crc, 0);
            following += 1;
        }
        byte += 1;
    }
    tables
}

/// `crc` after one more byte, bit by bit: slow, and what the fast path is measured against.
#[must_use]
pub const fn update_bitwise(crc: u16, byte: u8) -> u16 {
    let mut crc = crc ^ byte as u16;
    let mut bit = 0;
    while bit < 8 {
        crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
        bit += 1;
    }
    crc
}

/// `crc` after `data`: begin with [`START`], and cut the data as you like.
#[must_use]
pub fn update(crc: u16, data: &[u8]) -> u16 {
    let (chunks, rest) = data.as_chunks::<8>();
    let mut crc = chunks.iter().fold(crc, |crc, chunk| {
        let [low, high] = crc.to_le_bytes();
        TABLES[7][usize::from(chunk[0] ^ low)]
            ^ TABLES[6][usize::from(chunk[1] ^ high)]
            ^ TABLES[5][usize::from(chunk[2])]
            ^ TABLES[4][usize::from(chunk[3])]
            ^ TABLES[3][usize::from(chunk[4])]
            ^ TABLES[2][usize::from(chunk[5])]
            ^ TABLES[1][usize::from(chunk[6])]
            ^ TABLES[0][usize::from(chunk[7])]
    });
    let (chunks, rest) = rest.as_chunks::<4>();
    if let [chunk] = chunks {
        let [low, high] = crc.to_le_bytes();
        crc = TABLES[3][usize::from(chunk[0] ^ low)]
            ^ TABLES[2][usize::from(chunk[1] ^ high)]
            ^ TABLES[1][usize::from(chunk[2])]
            ^ TABLES[0][usize::from(chunk[3])];
    }
    rest.iter().fold(crc, |crc, &byte| {
        let [low, high] = crc.to_le_bytes();
        u16::from(high) ^ TABLES[0][usize::from(byte ^ low)]
    })
}

/// CRC-16/MODBUS of `data`. On the wire its low byte goes first.
///
/// ```
/// assert_eq!(drivebus_rtu::crc16(b"123456789"), 0x4B37);
/// ```
#[must_use]
pub fn crc16(data: &[u8]) -> u16 {
    update(START, data)
}
