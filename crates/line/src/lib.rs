//! Ports and the bus owner.
mod port;
pub use port::{Line, PortError, PortErrorKind};
