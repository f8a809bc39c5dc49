//! The kinds of line that a machine has, and the words by which people name one and say how it shall behave.

#[cfg(feature = "serial")]
pub(crate) mod adapters;
#[cfg(feature = "tcp")]
pub(crate) mod closing;
#[cfg(feature = "tcp")]
pub(crate) mod connection;
pub(crate) mod key;
#[cfg(all(any(unix, windows), feature = "share"))]
mod listening;
#[cfg(feature = "tcp")]
pub mod mbap;
#[cfg(target_os = "linux")]
pub mod pty;
#[cfg(feature = "serial")]
pub mod rs485;
pub(crate) mod set_again;
#[cfg(feature = "tcp")]
pub mod tcp;
#[cfg(feature = "serial")]
pub mod tty;
pub mod url;
pub(crate) mod words;
