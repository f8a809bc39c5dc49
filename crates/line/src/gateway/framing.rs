//! How requests and answers stand in what goes over a connection.

use drivebus_rtu::crc16;

use crate::ports::mbap::message;

/// What clients speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Framing {
    /// Modbus TCP: a header before each message, with a number that the answer brings back.
    #[default]
    Tcp,
    /// Modbus RTU over TCP: unit, PDU and CRC, as on a line. Nothing says whose an answer is, so who asks again is answered for
    /// that alone.
    Rtu,
}

impl Framing {
    /// Whether several requests may be on their way, and be answered in any order.
    pub(super) const fn tells_answers_apart(self) -> bool {
        matches!(self, Self::Tcp)
    }

    /// The message that brings `pdu` back as the answer of `unit` to `transaction`; nothing where all units were asked at once,
    /// who do not answer on a line.
    pub(super) fn message(self, transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
        match self {
            Self::Tcp => message(transaction, &[&[unit], pdu]),
            Self::Rtu if unit == 0 => Vec::new(),
            Self::Rtu => {
                let mut frame = [&[unit], pdu].concat();
                let crc = crc16(&frame);
                frame.extend(crc.to_le_bytes());
                frame
            }
        }
    }
}
