//! Serial defaults: how the line of a drive fresh from the factory is set.

use std::time::Duration;

use crate::plan::ReadCost;

/// The factory settings of a drive's line.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct SerialDefaults {
    /// Bits per second.
    pub baud_rate: u32,
    /// Data bits: 7 or 8.
    pub data_bits: u8,
    /// Parity: `'N'`, `'E'` or `'O'`.
    pub parity: char,
    /// Stop bits: 1 or 2.
    pub stop_bits: u8,
    /// The unit's address, where it is printed.
    pub unit: Option<u8>,
    /// How long the drive waits before it answers.
    pub response_delay: Duration,
    /// Whether documents of this family print these settings.
    pub verified: bool,
    /// Where they are printed.
    pub source: String,
}

/// What a read costs where nothing is printed: as on most lines, 11 bits a character at 19 200 bit/s and 5 ms.
pub(crate) const USUAL_READ_COST: ReadCost = ReadCost { request: 316, word: 22 };

impl SerialDefaults {
    /// Start, data, parity and stop bits.
    pub fn bits_per_char(&self) -> u32 {
        1 + u32::from(self.data_bits) + u32::from(self.parity != 'N') + u32::from(self.stop_bits)
    }

    /// What a read costs on this line, in bit times: an 8-character request, an answer of 5 characters and two for each
    /// word, two silences of 3.5 characters, and the response delay.
    pub fn read_cost(&self) -> ReadCost {
        let delay = self.response_delay.as_micros() * u128::from(self.baud_rate) / 1_000_000;
        ReadCost {
            request: ((8 + 5 + 7) * self.bits_per_char()).saturating_add(u32::try_from(delay).unwrap_or(u32::MAX)),
            word: 2 * self.bits_per_char(),
        }
    }

    /// Reads `"8E1"`: data bits, parity, stop bits.
    pub(crate) fn parse_format(text: &str) -> Option<(u8, char, u8)> {
        match text.as_bytes() {
            // Modbus RTU has 8 data bits.
            [b'8', parity @ (b'N' | b'E' | b'O'), stop @ (b'1' | b'2')] => Some((8, char::from(*parity), stop - b'0')),
            _ => None,
        }
    }
}
