//! Serial ports through `serial2`'s own time-outs: Windows, where there is no descriptor to poll.
//!
//! Waits are as exact as the system's timers, a millisecond or so; a silence is never shorter than asked.

use std::io;

use drivebus_rtu::{Duration, Instant};
use serial2::SerialPort;

use crate::line::PortErrorKind;
use crate::ports::adapters::identity::DeviceNumber;
use crate::system::clock::{monotonic, sleep_until};

/// Nothing: the system gives a port to one program only, so no other changes its settings.
#[derive(Debug)]
pub(super) struct Settings;

impl Settings {
    pub(super) fn of(_port: &SerialPort) -> Option<Self> {
        None
    }

    #[expect(clippy::unused_self, reason = "the same signature as on other systems")]
    pub(super) fn set_again(&mut self, _port: &SerialPort) -> Option<String> {
        None
    }

    #[expect(clippy::unused_self, reason = "the same signature as on other systems")]
    pub(super) fn note(&self) -> Option<String> {
        None
    }
}

/// Opens `path` as it is. The system gives a port to one program only.
pub(super) fn open(path: &str) -> io::Result<SerialPort> {
    SerialPort::open(path, serial2::KeepSettings)
}

/// Nothing: the system has locked the port.
#[expect(clippy::unnecessary_wraps, reason = "the same signature as on other systems")]
pub(super) fn lock(_port: &SerialPort, _pseudo_terminal: bool) -> io::Result<()> {
    Ok(())
}

/// Nothing: closing the port unlocks it.
pub(super) fn unlock(_port: &SerialPort) {}

/// Nothing is known of a port but its name.
pub(super) fn device_number(_port: &SerialPort) -> Option<DeviceNumber> {
    None
}

/// There are no pseudo-terminals here.
pub(super) fn is_pseudo_terminal(_port: &SerialPort, _path: &str) -> bool {
    false
}

/// Bytes as they are.
pub(super) fn make_raw(port: &mut SerialPort) -> io::Result<()> {
    let mut settings = port.get_configuration()?;
    settings.set_raw();
    port.set_configuration(&settings)
}

/// Hands over all of `bytes`; fails when the driver does not take them within `stall`.
pub(super) fn send(port: &mut SerialPort, bytes: &[u8], stall: Duration) -> io::Result<()> {
    port.set_write_timeout(stall)?;
    port.write_all(bytes)
}

/// Waits for bytes until `until`; 0 when none came, an error when none can come any more.
pub(super) fn receive(port: &mut SerialPort, buffer: &mut [u8], until: Instant) -> io::Result<usize> {
    if buffer.is_empty() {
        sleep_until(until);
        return Ok(0); // a read of nothing would look like the end of the port
    }
    loop {
        let left = until.saturating_duration_since(monotonic());
        port.set_read_timeout(left.max(Duration::from_millis(1)))?;
        match port.read(buffer) {
            Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Ok(count) => return Ok(count),
            Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                if monotonic() >= until {
                    return Ok(0);
                }
            }
            Err(error) => return Err(error),
        }
    }
}

/// What an error of [`open`] or of the settings means.
pub(super) fn open_error_kind(error: &io::Error) -> PortErrorKind {
    match error.kind() {
        io::ErrorKind::NotFound => PortErrorKind::NotFound,
        // The system says "access denied" when another program has the port open.
        io::ErrorKind::PermissionDenied => PortErrorKind::Busy,
        _ => PortErrorKind::Other,
    }
}
