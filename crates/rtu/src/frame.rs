//! Frames on the wire: address, PDU, CRC.

use core::fmt;

use crate::answer::Answer;
use crate::crc::crc16;
use crate::pdu::{CRC_LEN, MAX_PDU};
use crate::request::Request;
use crate::{Destination, UnitAddress};

/// Most bytes of a frame: address, PDU and CRC.
pub const MAX_ADU: usize = 256;
/// Fewest bytes of a frame: address, function code and CRC.
pub const MIN_ADU: usize = 4;
/// A frame whose CRC is good, borrowed from where it was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    bytes: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Takes `bytes` as one whole frame.
    ///
    /// # Errors
    ///
    /// [`FrameError`]: the length is impossible, or the CRC does not match.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let len = bytes.len();
        if len < MIN_ADU {
            return Err(FrameError::TooShort { len });
        }
        if len > MAX_ADU {
            return Err(FrameError::TooLong { len });
        }
        let (body, crc) = bytes.split_at(len - CRC_LEN);
        let computed = crc16(body);
        let received = u16::from_le_bytes([crc[0], crc[1]]);
        if computed == received { Ok(Self { bytes }) } else { Err(FrameError::Crc { computed, received }) }
    }

    /// Takes `bytes` that the framer has found to be a whole frame, without computing their CRC once more.
    pub(crate) const fn found(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// The address byte, 0..=255.
    pub const fn address(&self) -> u8 {
        self.bytes[0]
    }

    /// Function code and data.
    pub fn pdu(&self) -> &'a [u8] {
        &self.bytes[1..self.bytes.len() - CRC_LEN]
    }

    /// The CRC as it stands on the wire, which says of two frames that they are not the same.
    pub(crate) fn crc(&self) -> [u8; 2] {
        self.bytes.last_chunk().copied().unwrap_or_default()
    }

    /// All of it, address and CRC included.
    pub const fn as_bytes(&self) -> &'a [u8] {
        self.bytes
    }
}

/// Bytes that are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// Fewer than 4 bytes.
    TooShort {
        /// Bytes there.
        len: usize,
    },
    /// More than 256 bytes.
    TooLong {
        /// Bytes there.
        len: usize,
    },
    /// The bytes do not match their CRC.
    Crc {
        /// CRC of the bytes received.
        computed: u16,
        /// CRC that came with them.
        received: u16,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort { len } => write!(f, "{len} bytes are not a frame: at least {MIN_ADU} are needed"),
            Self::TooLong { len } => write!(f, "{len} bytes are not a frame: at most {MAX_ADU} can be"),
            Self::Crc { computed, received } => {
                let ([c0, c1], [r0, r1]) = (computed.to_le_bytes(), received.to_le_bytes());
                write!(f, "the CRC of the bytes is {c0:02X} {c1:02X}, with them came {r0:02X} {r1:02X}")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// A frame to send, in a buffer of its own.
#[derive(Clone, Copy)]
pub struct Adu {
    bytes: [u8; MAX_ADU],
    len: usize,
}

impl Adu {
    /// A buffer without a frame in it.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_ADU], len: 0 }
    }

    /// The frame that asks `request` of `destination`.
    ///
    /// ```
    /// use drivebus_rtu::{Adu, Request, UnitAddress};
    ///
    /// let request = Request::read(0x2100, 1)?;
    /// let frame = Adu::request(UnitAddress::MIN.into(), &request);
    /// assert_eq!(frame.as_bytes(), [0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
    /// # Ok::<(), drivebus_rtu::RequestError>(())
    /// ```
    #[must_use]
    pub fn request(destination: Destination, request: &Request<'_>) -> Self {
        let mut adu = Self::new();
        adu.set_request(destination, request);
        adu
    }

    /// The frame with which `unit` answers.
    #[must_use]
    pub fn answer(unit: UnitAddress, answer: &Answer<'_>) -> Self {
        let mut adu = Self::new();
        adu.set_answer(unit, answer);
        adu
    }

    /// As [`request`](Self::request), in place of whatever was in the buffer: for whoever sends many frames.
    pub fn set_request(&mut self, destination: Destination, request: &Request<'_>) {
        self.build(destination.to_wire(), |pdu| request.put(pdu));
    }

    /// As [`answer`](Self::answer), in place of whatever was in the buffer.
    pub fn set_answer(&mut self, unit: UnitAddress, answer: &Answer<'_>) {
        self.build(unit.get(), |pdu| answer.put(pdu));
    }

    fn build(&mut self, address: u8, put: impl FnOnce(&mut [u8; MAX_PDU]) -> usize) {
        self.bytes[0] = address;
        let body = match self.bytes[1..].first_chunk_mut::<MAX_PDU>() {
            Some(pdu) => 1 + put(pdu),
            None => 1,
        };
        let crc = crc16(&self.bytes[..body]).to_le_bytes();
        self.bytes[body..body + CRC_LEN].copy_from_slice(&crc);
        self.len = body + CRC_LEN;
    }

    /// A copy of `frame`.
    pub(crate) fn copy_of(frame: &Frame<'_>) -> Self {
        let mut adu = Self::new();
        adu.len = frame.as_bytes().len();
        adu.bytes[..adu.len].copy_from_slice(frame.as_bytes());
        adu
    }

    pub(crate) const fn clear(&mut self) {
        self.len = 0;
    }

    /// The bytes in the order of the wire.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl Default for Adu {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Adu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Adu({:02X?})", self.as_bytes())
    }
}

impl PartialEq for Adu {
    fn eq(&self, other: &Self) -> bool {
        self.as_bytes() == other.as_bytes()
    }
}

impl Eq for Adu {}
