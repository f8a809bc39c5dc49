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

/// Most bytes that are taken at once.
const LONGEST: usize = 16;

/// `TABLES[n][b]` is the effect of byte `b` that `n` more bytes follow.
static TABLES: [[u16; 256]; LONGEST] = tables();

const fn tables() -> [[u16; 256]; LONGEST] {
    let mut tables = [[0; 256]; LONGEST];
    let mut byte = 0;
    while byte < 256 {
        #[expect(clippy::cast_possible_truncation, reason = "below 256")]
        let mut crc = update_bitwise(0, byte as u8);
        let mut following = 0;
        while following < LONGEST {
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
    // Requests and short answers pay nothing for the loop.
    if data.len() < LONGEST {
        return update_short(crc, data);
    }
    let (blocks, rest) = data.as_chunks::<LONGEST>();
    update_short(blocks.iter().fold(crc, update_block), rest)
}

/// Fewer bytes than [`LONGEST`]: eight at once, then the rest at once.
#[expect(clippy::inline_always, reason = "the call costs a third of a request's CRC")]
#[inline(always)]
fn update_short(crc: u16, data: &[u8]) -> u16 {
    let (crc, rest) = match data.split_first_chunk::<8>() {
        Some((block, rest)) => (update_block(crc, block), rest),
        None => (crc, data),
    };
    if rest.is_empty() {
        return crc; // sooner than the jump of a `match`
    }
    match rest.len() {
        2 => update_start::<2>(crc, rest),
        3 => update_start::<3>(crc, rest),
        4 => update_start::<4>(crc, rest),
        5 => update_start::<5>(crc, rest),
        6 => update_start::<6>(crc, rest),
        7 => update_start::<7>(crc, rest),
        _ => update_bytes(crc, rest),
    }
}

/// One byte after the other.
#[inline]
fn update_bytes(crc: u16, data: &[u8]) -> u16 {
    data.iter().fold(crc, |crc, &byte| {
        let [low, high] = crc.to_le_bytes();
        u16::from(high) ^ TABLES[0][usize::from(byte ^ low)]
    })
}

/// The first `N` bytes of `data`, which has as many.
#[inline]
fn update_start<const N: usize>(crc: u16, data: &[u8]) -> u16 {
    data.first_chunk::<N>().map_or(crc, |block| update_block(crc, block))
}

/// 2..=[`LONGEST`] bytes at once. Only the first two have to wait for what came before them, so they come last.
#[inline]
fn update_block<const N: usize>(crc: u16, block: &[u8; N]) -> u16 {
    let [low, high] = crc.to_le_bytes();
    let mut rest = 0;
    for n in 2..N {
        rest ^= TABLES[N - 1 - n][usize::from(block[n])];
    }
    rest ^ (TABLES[N - 1][usize::from(block[0] ^ low)] ^ TABLES[N - 2][usize::from(block[1] ^ high)])
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
