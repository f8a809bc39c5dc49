//! Serial ports through the descriptor: Linux, macOS and the BSDs.

use std::io;
use std::os::fd::{AsFd, OwnedFd};

use drivebus_rtu::{Duration, Instant};
use rustix::event::PollFlags;
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, InputModes, OptionalActions, QueueSelector, SpecialCodeIndex, ioctl_tiocexcl, ioctl_tiocnxcl,
    tcflush, tcgetattr, tcsetattr,
};
use serial2::SerialPort;

use crate::line::PortErrorKind;
use crate::ports::adapters::identity::DeviceNumber;
use crate::system::clock::{monotonic, sleep_until, wait_for};

pub(super) use super::settings::Settings;

/// Opens `path` without changing anything about it: it may be another program's.
pub(super) fn open(path: &str) -> io::Result<SerialPort> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    if path.contains('\0') {
        return Err(Errno::NOENT.into()); // no path has one
    }
    let descriptor: OwnedFd = rustix::fs::open(path, flags, Mode::empty())?;
    if !rustix::termios::isatty(&descriptor) {
        return Err(Errno::NOTTY.into());
    }
    Ok(SerialPort::from(descriptor))
}

/// Keeps other programs out, or fails with `EWOULDBLOCK` when one keeps us out.
///
/// `flock` is what pyserial and the likes ask for, and binds root too; `TIOCEXCL` binds programs that never heard of
/// it. A pseudo-terminal gets the lock only: its exclusive mark outlives us for as long as its other side is open, and
/// a program that was killed would leave a simulator that nobody can open again.
pub(super) fn lock(port: &SerialPort, pseudo_terminal: bool) -> io::Result<()> {
    flock(port, FlockOperation::NonBlockingLockExclusive)?;
    if !pseudo_terminal {
        ioctl_tiocexcl(port)?;
    }
    Ok(())
}

/// Lets other programs in again.
///
/// Closing is not enough: a child process that was forked meanwhile may still hold the descriptor.
pub(super) fn unlock(port: &SerialPort) {
    // A port that was unplugged refuses both; it is unlocked anyhow.
    let _ = ioctl_tiocnxcl(port);
    let _ = flock(port, FlockOperation::Unlock);
}

/// The number of the port in the system.
#[cfg(target_os = "linux")]
pub(super) fn device_number(port: &SerialPort) -> Option<DeviceNumber> {
    let number = rustix::fs::fstat(port).ok()?.st_rdev;
    Some((rustix::fs::major(number), rustix::fs::minor(number)))
}

/// Nothing: there is nowhere to look it up.
#[cfg(not(target_os = "linux"))]
pub(super) fn device_number(_port: &SerialPort) -> Option<DeviceNumber> {
    None
}

/// Whether `port`, opened as `path`, is the user's side of a pseudo-terminal.
///
/// By device number, so that a link with any name is seen through. Source: `devices.txt` of Linux, major 136 to 143.
#[cfg(target_os = "linux")]
pub(super) fn is_pseudo_terminal(port: &SerialPort, _path: &str) -> bool {
    rustix::fs::fstat(port).is_ok_and(|status| (136..=143).contains(&rustix::fs::major(status.st_rdev)))
}

/// Whether `port`, opened as `path`, is the user's side of a pseudo-terminal.
///
/// By the names that macOS and the BSDs give them, after following links.
#[cfg(not(target_os = "linux"))]
pub(super) fn is_pseudo_terminal(_port: &SerialPort, path: &str) -> bool {
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
    path.starts_with("/dev/pts") || (cfg!(target_os = "macos") && path.to_string_lossy().starts_with("/dev/ttys"))
}

/// Bytes as they are: nothing translated, dropped, echoed or counted as a signal, and no modem line waited for.
///
/// Bytes with a wrong parity or stop bit are handed up, unlike after `serial2`'s own raw mode: the CRC refuses the
/// frame, and its bytes tell people more than their absence. A break, which a line without termination shows as one
/// when nobody drives it, is dropped.
pub(super) fn make_raw(port: &SerialPort) -> io::Result<()> {
    let mut settings = tcgetattr(port)?;
    settings.make_raw();
    settings.input_modes.remove(InputModes::INPCK | InputModes::IGNPAR | InputModes::IXOFF | InputModes::IXANY);
    settings.input_modes.insert(InputModes::IGNBRK);
    settings.control_modes.insert(ControlModes::CREAD | ControlModes::CLOCAL);
    settings.special_codes[SpecialCodeIndex::VMIN] = 1;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    tcsetattr(port, OptionalActions::Now, &settings)?;
    Ok(())
}

/// Hands over all of `bytes`; fails when the driver takes none for `stall`.
pub(super) fn send(port: &mut SerialPort, bytes: &[u8], stall: Duration) -> io::Result<()> {
    let mut rest = bytes;
    let mut give_up = monotonic() + stall;
    while !rest.is_empty() {
        match rustix::io::write(&*port, rest) {
            Ok(taken) => {
                rest = &rest[taken..];
                give_up = monotonic() + stall;
            }
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => match wait_for(port.as_fd(), PollFlags::OUT, give_up)? {
                Some(ready) if !ready.contains(PollFlags::OUT) => return Err(Errno::IO.into()),
                // A driver that says it has room and takes nothing must not keep us.
                Some(_) if monotonic() < give_up => {}
                _ => {
                    // Closing would wait for the rest to leave, half a minute on Linux.
                    let _ = tcflush(&*port, QueueSelector::OFlush);
                    return Err(io::Error::new(io::ErrorKind::TimedOut, "it takes no more bytes"));
                }
            },
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// Waits for bytes until `until`; 0 when none came, an error when none can come any more.
pub(super) fn receive(port: &mut SerialPort, buffer: &mut [u8], until: Instant) -> io::Result<usize> {
    if buffer.is_empty() {
        sleep_until(until);
        return Ok(0); // a read of nothing would look like the end of the port
    }
    if until <= monotonic() {
        // No wait is wanted: one system call tells all. A port that is gone says so here as well.
        return match rustix::io::read(&*port, &mut *buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        };
    }
    loop {
        let Some(ready) = wait_for(port.as_fd(), PollFlags::IN, until)? else { return Ok(0) };
        match rustix::io::read(&*port, &mut *buffer) {
            Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Ok(count) => return Ok(count),
            // Someone else read the bytes. Only a living port is asked again, or this would spin.
            Err(Errno::AGAIN) if ready == PollFlags::IN && monotonic() < until => {}
            Err(Errno::AGAIN) if ready == PollFlags::IN => return Ok(0),
            Err(Errno::AGAIN) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "hung up")),
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

/// What an error of [`open`], [`lock`] or the settings means.
pub(super) fn open_error_kind(error: &io::Error) -> PortErrorKind {
    match Errno::from_io_error(error) {
        // A node whose device is gone gives ENXIO or ENODEV, one that never had any gives EIO.
        Some(Errno::NOENT | Errno::NOTDIR | Errno::NXIO | Errno::NODEV | Errno::IO) => PortErrorKind::NotFound,
        Some(Errno::BUSY | Errno::AGAIN) => PortErrorKind::Busy,
        Some(Errno::ACCESS | Errno::PERM) => PortErrorKind::Denied,
        Some(Errno::NOTTY | Errno::ISDIR) => PortErrorKind::Unsupported,
        _ => PortErrorKind::Other,
    }
}
