//! PDUs that somebody gives as they are.

use crate::Table;
use crate::pdu::AnswerLength;
use crate::request::{Request, RequestError};

impl<'a> Request<'a> {
    /// The request that `pdu` is: 03H, 06H, 08H/0000 and 10H are checked as such, anything else is carried as it is. Of 0FH, 11H,
    /// 16H, 17H and 2BH/0EH what has the form of the specification is known by its name.
    ///
    /// So are 01H, 02H, 04H and 05H: there are drives that mean something of their own by them, the Huanyang HY a write
    /// by 02H. Who means the tables of the specification asks [`read_of`](Self::read_of) and
    /// [`write_coil`](Self::write_coil).
    ///
    /// With `reply_length`, how many bytes the answer's PDU has, it is carried in any case.
    ///
    /// ```
    /// use drivebus_rtu::{AnswerLength, Request};
    ///
    /// assert_eq!(Request::raw(&[0x06, 0x20, 0x00, 0x00, 0x05], None)?, Request::write(0x2000, 5));
    /// let coils = [0x01, 0x00, 0x13, 0x00, 0x13];
    /// assert_eq!(Request::raw(&coils, None)?, Request::custom(&coils, AnswerLength::BySilence)?);
    /// # Ok::<(), drivebus_rtu::RequestError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`custom`](Self::custom).
    pub fn raw(pdu: &'a [u8], reply_length: Option<u8>) -> Result<Self, RequestError> {
        let length = reply_length.map_or(AnswerLength::BySilence, AnswerLength::Bytes);
        match Self::parse(pdu) {
            Ok(Self::Read { table: Table::Coil | Table::Discrete | Table::Input, .. } | Self::WriteCoil { .. }) => {
                Self::custom(pdu, length)
            }
            Ok(request) if reply_length.is_none() && !matches!(request, Self::Custom { .. }) => Ok(request),
            _ => Self::custom(pdu, length),
        }
    }
}
