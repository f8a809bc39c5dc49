//! Requests to units that speak Huanyang's own protocol: which of Modbus says the same.

use super::Request;
use crate::huanyang::{CONTROL, Huanyang, READ_PARAMETER, READ_STATUS, SET_FREQUENCY};
use crate::table::Table;

impl<'a> Request<'a> {
    /// The request that `pdu` is, of Modbus or, where it is none of that, of this protocol.
    ///
    /// For what was written down as bytes, such as what halts a unit: a control and a frequency have no form of Modbus. A read of
    /// a parameter, and a write, may have one.
    pub fn of_either(pdu: &'a [u8]) -> Option<Self> {
        match Self::parse(pdu) {
            Ok(request) => Some(request),
            Err(_) => Huanyang::parse(pdu).map(Self::Huanyang),
        }
    }
}

impl Huanyang {
    /// What says the same as `request`; `None` where nothing of this protocol does.
    pub fn of(request: &Request<'_>) -> Option<Self> {
        match *request {
            Request::Huanyang(asked) => Some(asked),
            Request::Read { table: Table::Holding, address, count: 1 } => match address.to_be_bytes() {
                [READ_PARAMETER, number] => Some(Self::ReadParameter { number }),
                [READ_STATUS, number] => Some(Self::ReadStatus { number }),
                _ => None,
            },
            Request::WriteSingle { address, value } => match address.to_be_bytes() {
                [READ_PARAMETER, number] => Some(Self::WriteParameter { number, value }),
                [CONTROL, 0] => u8::try_from(value).ok().map(|bits| Self::Control { bits }),
                [SET_FREQUENCY, 0] => Some(Self::SetFrequency { value }),
                _ => None,
            },
            _ => None,
        }
    }
}
