//! Requests of which it is sure that they change nothing in a unit, by their form.
//!
//! A function alone does not say it: Huanyang's own protocol, on the same wires and with the same CRC, writes a parameter by 02H
//! and commands the motor by 03H (LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_modbus.c). There a number of bytes follows
//! the function, then those.
//!
//! Source of the forms: *Modbus Application Protocol* V1.1b3, §6.1 to §6.4, §6.7 to §6.10, §6.13, §6.14, §6.18, §6.21.

use crate::pdu::function::{DIAGNOSTICS, ENCAPSULATED, IDENTIFICATION, READ_COILS, READ_DISCRETE, READ_INPUT};
use crate::request::Request;

/// Of a group in a request for parts of files: its type, file, record, and number of words.
const GROUP: usize = 7;
const GROUP_TYPE: u8 = 6;

impl Request<'_> {
    /// Whether the request only reads, whatever the unit makes of it: what a bus sends that is for reading only.
    ///
    /// What somebody gives as it is needs the function of a read, and the form that the specification has for it. A read of
    /// discrete inputs 0300H to 03FFH is, byte for byte, also how a Huanyang HY is told to write a parameter:
    /// [`read_of`](Self::read_of) means the inputs, and bytes may mean either. Its read of a status (04H, three bytes), which
    /// a unit of Modbus refuses, is no write to anybody.
    pub fn only_reads(&self) -> bool {
        match *self {
            Self::Custom { pdu, .. } => !self.is_write() && has_form_of_read(pdu),
            _ => !self.is_write(),
        }
    }
}

fn has_form_of_read(pdu: &[u8]) -> bool {
    match *pdu {
        [READ_DISCRETE, 3, ..] => false,
        [READ_INPUT, 3, _, 0, 0] => true,
        [READ_COILS..=READ_INPUT, ..] => Request::parse(pdu).is_ok(),
        [DIAGNOSTICS, 0, 0, ..] => true,
        [DIAGNOSTICS, ..] => pdu.len() == 5,
        [0x14, bytes, ref groups @ ..] => {
            let (groups, rest) = groups.as_chunks::<GROUP>();
            let long = usize::from(bytes) == groups.len() * GROUP;
            long && !groups.is_empty() && rest.is_empty() && groups.iter().all(|group| group[0] == GROUP_TYPE)
        }
        [0x14] => false,
        [0x18, ..] => pdu.len() == 3,
        [ENCAPSULATED, mei, ref rest @ ..] => mei == IDENTIFICATION && matches!(rest, [1..=4, _]),
        _ => pdu.len() == 1,
    }
}
