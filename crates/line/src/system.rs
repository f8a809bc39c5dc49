//! What is asked of the machine: the time, waits that end on time, and whose process this is.

pub mod clock;
#[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
pub(crate) mod inherited;
pub(crate) mod process;
pub(crate) mod punctual;
