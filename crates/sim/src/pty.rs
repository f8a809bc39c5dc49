//! The simulated line behind a pseudo-terminal: what opens it takes it for a serial port. Linux only.

use std::ffi::OsStr;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::server::{Worker, serve};
use crate::simulator::Shared;

/// A pseudo-terminal that is served until this is dropped.
///
/// A pseudo-terminal has no speed and no parity: whatever a program sets, the characters take the time of the
/// simulation's format.
#[derive(Debug)]
pub struct PtyServer {
    path: PathBuf,
    // Before `_held`, so that the thread has ended when the pseudo-terminal closes.
    _worker: Worker,
    /// The programs' side, kept open so that the simulation's side does not fail between two programs.
    _held: OwnedFd,
}

impl PtyServer {
    pub(crate) fn start(shared: Arc<Shared>) -> io::Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let path = PathBuf::from(OsStr::from_bytes(ptsname(&ours, Vec::new())?.as_bytes()));

        let held = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        // Without this the terminal would echo requests back as answers and translate line ends.
        let mut raw = tcgetattr(&held)?;
        raw.make_raw();
        tcsetattr(&held, OptionalActions::Now, &raw)?;
        rustix::fs::fcntl_setfl(&ours, OFlags::NONBLOCK)?;

        let worker = Worker::start("drivebus-sim-pty", move |stop| {
            // The only failure is that of the pseudo-terminal itself; its users then see it closed.
            let _ = serve(&shared, ours.as_fd(), stop.as_fd());
        })?;
        Ok(Self { path, _worker: worker, _held: held })
    }

    /// What to open: `/dev/pts/N`.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
