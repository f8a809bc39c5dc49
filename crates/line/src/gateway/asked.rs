//! One request of a client, and what is none.

use crate::ports::mbap::{MAX_BODY, MIN_BODY};

/// One request, as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Asked {
    /// The client's number for it, which its answer brings back.
    pub transaction: u16,
    /// Whom it is for.
    pub unit: u8,
    /// Function and data: 1..=253 bytes.
    pub pdu: Vec<u8>,
}

/// Bytes that are no request of Modbus TCP. Nothing tells where the next one begins, so the connection has to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotModbus {
    /// The header names another protocol.
    #[error("protocol {0} in the header, where Modbus has 0")]
    #[non_exhaustive]
    Protocol(u16),
    /// No request has that length.
    #[error("length {0} in the header, where Modbus has {MIN_BODY} to {MAX_BODY}")]
    #[non_exhaustive]
    Length(u16),
    /// Over RTU: no frame of it has such bytes, or its CRC is wrong.
    #[error("no frame of Modbus RTU, or a CRC that is wrong")]
    Crc,
}
