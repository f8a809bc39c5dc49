//! Pseudo-terminals of our own: what opens one takes it for a serial port, and finds it by a name that stays. Linux only.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// Where the system has its pseudo-terminals.
const PTS: &str = "/dev/pts";

/// A new pseudo-terminal at `baud_rate`, which changes nothing of what goes through it: our side, which does not block, the
/// programs' side, and its name.
///
/// # Errors
///
/// The system's: it has no more of them.
pub fn open_raw(baud_rate: u32) -> io::Result<(OwnedFd, OwnedFd, PathBuf)> {
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
pub fn speed(ours: &OwnedFd) -> Option<u32> {
    tcgetattr(ours).ok().map(|settings| settings.output_speed())
}

/// A symbolic link that leads to a pseudo-terminal, whatever its name is by now; removed when this is dropped.
#[derive(Debug)]
pub struct PtyLink {
    path: PathBuf,
    /// The process that made it. It outlives a child that was forked meanwhile.
    made_by: u32,
}

impl PtyLink {
    /// Makes it. One that is there and leads to a pseudo-terminal is replaced.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::AlreadyExists`]: something else is there, and stays. Others: the system's.
    pub fn new(path: PathBuf, target: &Path) -> io::Result<Self> {
        if fs::symlink_metadata(&path).is_ok() && !fs::read_link(&path).is_ok_and(|there| there.starts_with(PTS)) {
            let message =
                format!("{} is there and is not a link to a pseudo-terminal; give another name", path.display());
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
        }
        let link = Self { path, made_by: std::process::id() };
        link.lead_to(target)?;
        Ok(link)
    }

    /// In one step: there is no moment without the link.
    ///
    /// # Errors
    ///
    /// The system's: a link cannot be made there.
    pub fn lead_to(&self, target: &Path) -> io::Result<()> {
        let mut name = self.path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}", std::process::id()));
        let new = self.path.with_file_name(name);
        symlink(target, &new).and_then(|()| fs::rename(&new, &self.path)).map_err(|error| {
            let _ = fs::remove_file(&new); // where it was made, and leads nowhere that anybody asked for
            io::Error::new(error.kind(), format!("the link {} cannot be made: {error}", self.path.display()))
        })
    }
}

impl Drop for PtyLink {
    fn drop(&mut self) {
        if self.made_by == std::process::id() {
            // Somebody may have removed it already.
            let _ = fs::remove_file(&self.path);
        }
    }
}
