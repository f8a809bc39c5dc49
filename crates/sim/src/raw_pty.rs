//! A pseudo-terminal that changes nothing of what goes through it, and the speed that its user sets.

use std::ffi::OsStr;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A new pseudo-terminal at `baud_rate`: our side, which does not block, the programs' side, and its name.
pub(crate) fn open_raw(baud_rate: u32) -> io::Result<(OwnedFd, OwnedFd, PathBuf)> {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&ours)?;
    unlockpt(&ours)?;
    let path = PathBuf::from(OsStr::from_bytes(ptsname(&ours, Vec::new())?.as_bytes()));

    let held = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    // Without this the terminal would echo requests back as answers and translate line ends.
    let mut raw = tcgetattr(&held)?;
    raw.make_raw();
    // A program that never sets a speed is taken to fit.
    raw.set_speed(baud_rate)?;
    tcsetattr(&held, OptionalActions::Now, &raw)?;
    rustix::fs::fcntl_setfl(&ours, OFlags::NONBLOCK)?;
    Ok((ours, held, path))
}

/// The speed that the programs' side is set to. The system tells it at our side too.
pub(crate) fn speed(ours: &OwnedFd) -> Option<u32> {
    tcgetattr(ours).ok().map(|settings| settings.output_speed())
}
