//! Ports and the bus owner.
pub mod clock;
pub mod mbap;
mod port;
pub mod rs485;
pub mod tcp;
pub mod tty;
pub use port::{Line, PortError, PortErrorKind};
