//! One request of Modbus RTU over TCP. No silence separates frames there: how long each is, its function says, and its CRC
//! says whether that is so.

use std::slice;

use drivebus_rtu::{Frame, FrameLength, MAX_ADU, crc};

use crate::gateway::asked::{Asked, NotModbus};

/// The shortest frame: unit, function and CRC.
const SHORTEST: usize = 4;

/// How far a frame of unknown length was looked at for its end: each byte once, since a client may send them one by one.
#[derive(Debug)]
pub(super) struct Looked {
    bytes: usize,
    crc: u16,
}

impl Default for Looked {
    fn default() -> Self {
        Self { bytes: 0, crc: crc::START }
    }
}

impl Looked {
    /// The length of the first frame that `bytes` begin with: the CRC of a frame and its own CRC is zero.
    fn end(&mut self, bytes: &[u8]) -> Option<usize> {
        for byte in bytes.get(self.bytes..)? {
            self.crc = crc::update(self.crc, slice::from_ref(byte));
            self.bytes += 1;
            if self.bytes >= SHORTEST && self.crc == 0 {
                return Some(self.bytes);
            }
        }
        None
    }
}

/// The request that `bytes` begin with, and what is behind it; `None` while it is not complete. `looked` is of these bytes, as far
/// as they had come before.
pub(super) fn first<'b>(bytes: &'b [u8], looked: &mut Looked) -> Result<Option<(Asked, &'b [u8])>, NotModbus> {
    let most = bytes.len().min(MAX_ADU);
    let found = match FrameLength::of_request(bytes) {
        FrameLength::Later => return Ok(None),
        FrameLength::TooLong => return Err(NotModbus::Crc),
        FrameLength::Is(length) => match bytes.get(..length) {
            None => return Ok(None),
            Some(frame) => Frame::parse(frame).map(|_| length).map_err(|_| NotModbus::Crc)?,
        },
        // A function whose length is not known ends where a CRC says so.
        _ => match looked.end(&bytes[..most]) {
            Some(length) => length,
            None if bytes.len() < MAX_ADU => return Ok(None),
            None => return Err(NotModbus::Crc),
        },
    };
    *looked = Looked::default();
    let (frame, behind) = bytes.split_at(found);
    let asked = Asked { transaction: 0, unit: frame[0], pdu: frame[1..found - 2].to_vec() };
    Ok(Some((asked, behind)))
}
