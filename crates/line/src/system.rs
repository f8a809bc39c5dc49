//! What is asked of the machine: the time, waits that end on time, whose process this is, and what a forked child gives up.

#[cfg(all(unix, any(feature = "serial", feature = "tcp", feature = "share")))]
mod at_fork;
pub mod clock;
#[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
pub(crate) mod inherited;
#[cfg(all(unix, any(feature = "serial", feature = "tcp", feature = "share")))]
mod listed;
pub(crate) mod process;
pub(crate) mod punctual;
#[cfg(target_os = "linux")]
mod realtime;
#[cfg(all(any(unix, windows), feature = "share"))]
pub(crate) mod sockets;
pub(crate) mod sync;
