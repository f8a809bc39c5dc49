//! What requests and answers have in common: limits, function codes, exception codes.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §4.1, §6, §7.

/// Most bytes of a PDU: 256 of the ADU less address and CRC.
pub const MAX_PDU: usize = 253;
/// Most words of one 03H or 04H read.
pub const MAX_READ: u16 = 125;
/// Most bits of one 01H or 02H read.
pub const MAX_READ_BITS: u16 = 2_000;
/// Most words of one 10H write.
pub const MAX_WRITE: u16 = 123;
/// Most coils of one 0FH write.
pub const MAX_WRITE_BITS: u16 = 1_968;
/// Most words that one 17H writes; it reads as many as 03H.
pub const MAX_READ_WRITE: u16 = 121;
/// Address and CRC.
pub(crate) const AROUND_PDU: usize = 1 + CRC_LEN;
/// The CRC.
pub(crate) const CRC_LEN: usize = 2;

/// Function codes this crate knows by name.
pub mod function {
    /// Read coils.
    pub const READ_COILS: u8 = 0x01;
    /// Read discrete inputs.
    pub const READ_DISCRETE: u8 = 0x02;
    /// Read holding registers.
    pub const READ_HOLDING: u8 = 0x03;
    /// Read input registers.
    pub const READ_INPUT: u8 = 0x04;
    /// Write one coil.
    pub const WRITE_COIL: u8 = 0x05;
    /// Write one register.
    pub const WRITE_SINGLE: u8 = 0x06;
    /// Diagnostics; sub-function 0000 is the echo.
    pub const DIAGNOSTICS: u8 = 0x08;
    /// Write several coils.
    pub const WRITE_COILS: u8 = 0x0F;
    /// Write several registers.
    pub const WRITE_MULTIPLE: u8 = 0x10;
    /// Report what the unit is, in its own words.
    pub const REPORT_SERVER_ID: u8 = 0x11;
    /// Change bits of one register.
    pub const MASK_WRITE: u8 = 0x16;
    /// Write several registers, then read several.
    pub const READ_WRITE: u8 = 0x17;
    /// What another kind of interface carries; [`IDENTIFICATION`] is one.
    pub const ENCAPSULATED: u8 = 0x2B;
    /// Of [`ENCAPSULATED`]: who made the unit, and what it is.
    pub const IDENTIFICATION: u8 = 0x0E;
    /// Set in the function code of an exception.
    pub const EXCEPTION_BIT: u8 = 0x80;
}

/// How long the answer to a custom request is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnswerLength {
    /// The answer's PDU has this many bytes, function code included: 1..=253.
    Bytes(u8),
    /// Not known: the answer ends when the line falls silent.
    BySilence,
}

/// The code in an exception: why a unit refused. What a code means beyond 04H differs from family to family.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExceptionCode(pub u8);

impl ExceptionCode {
    /// 01H: the unit does not know the function.
    pub const ILLEGAL_FUNCTION: Self = Self(0x01);
    /// 02H: there is no such register.
    pub const ILLEGAL_ADDRESS: Self = Self(0x02);
    /// 03H: the request is not well formed.
    pub const ILLEGAL_VALUE: Self = Self(0x03);
    /// 04H: the unit could not do it.
    pub const DEVICE_FAILURE: Self = Self(0x04);
    /// 06H: the unit is busy, and may be asked again later.
    pub const BUSY: Self = Self(0x06);
    /// 0AH: a gateway cannot use the line that the unit is on.
    pub const GATEWAY_PATH_UNAVAILABLE: Self = Self(0x0A);
    /// 0BH: a gateway passed the request on, and heard no answer of the unit.
    pub const GATEWAY_TARGET_SILENT: Self = Self(0x0B);

    /// What the specification calls the code; a family of drives may mean something else by it.
    ///
    /// Source: *Modbus Application Protocol* V1.1b3, §7.
    pub const fn standard_name(self) -> &'static str {
        match self.0 {
            0x01 => "illegal_function",
            0x02 => "illegal_data_address",
            0x03 => "illegal_data_value",
            0x04 => "server_device_failure",
            0x05 => "acknowledge",
            0x06 => "server_device_busy",
            0x08 => "memory_parity_error",
            0x0A => "gateway_path_unavailable",
            0x0B => "gateway_target_failed_to_respond",
            _ => "not_in_the_specification",
        }
    }
}

/// How 05H says that a coil is to be on; off is 0.
const ON: u16 = 0xFF00;

/// What 05H says of a coil; `None` where it says neither.
pub(crate) const fn coil_of(word: u16) -> Option<bool> {
    match word {
        ON => Some(true),
        0 => Some(false),
        _ => None,
    }
}

/// How 05H says that a coil is `on`.
pub(crate) const fn coil_word(on: bool) -> u16 {
    if on { ON } else { 0 }
}

/// A function code and two words: the shape of most PDUs.
pub(crate) fn put_words(target: &mut [u8; MAX_PDU], function: u8, [first, second]: [u16; 2]) -> usize {
    target[0] = function;
    target[1..3].copy_from_slice(&first.to_be_bytes());
    target[3..5].copy_from_slice(&second.to_be_bytes());
    5
}

/// Whether the request `pdu` is of a function that only reads; `functions` has the table.
pub(crate) const fn reads(pdu: &[u8]) -> bool {
    use function::{DIAGNOSTICS, ENCAPSULATED, IDENTIFICATION, READ_COILS, READ_INPUT, REPORT_SERVER_ID};

    matches!(
        pdu,
        [READ_COILS..=READ_INPUT | 0x07 | 0x0B | 0x0C | REPORT_SERVER_ID | 0x14 | 0x18, ..]
            | [DIAGNOSTICS, 0, 0x00 | 0x02 | 0x0B..=0x12, ..]
            | [ENCAPSULATED, IDENTIFICATION, ..]
    )
}
