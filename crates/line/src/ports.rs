//! The kinds of line that a machine has: serial ports and their adapters, serial servers, Modbus TCP.

pub(crate) mod adapters;
pub mod mbap;
pub mod rs485;
pub mod tcp;
pub mod tty;
