//! One request of Modbus TCP, by its header.

use crate::gateway::asked::{Asked, NotModbus};
use crate::ports::mbap::{MAX_BODY, MIN_BODY};

/// The request that `bytes` begin with, and what is behind it; `None` while it is not complete.
pub(super) fn first(bytes: &[u8]) -> Result<Option<(Asked, &[u8])>, NotModbus> {
    if let [_, _, high, low, ..] = *bytes
        && [high, low] != [0, 0]
    {
        return Err(NotModbus::Protocol(u16::from_be_bytes([high, low])));
    }
    let [t1, t0, _, _, high, low, ref body @ ..] = *bytes else { return Ok(None) };
    let length = u16::from_be_bytes([high, low]);
    if !(MIN_BODY..=MAX_BODY).contains(&usize::from(length)) {
        return Err(NotModbus::Length(length));
    }
    let Some((body, behind)) = body.split_at_checked(usize::from(length)) else { return Ok(None) };
    let Some((&unit, pdu)) = body.split_first() else { return Ok(None) };
    Ok(Some((Asked { transaction: u16::from_be_bytes([t1, t0]), unit, pdu: pdu.to_vec() }, behind)))
}
