//! Where the programs of one user meet over a port: a socket in the run-time directory, named after the port.
//!
//! The folder is this user's alone (0700), so that no other user reaches what is in it; whose program is at the other end
//! is asked of the system all the same. A lock beside the socket lets one program at a time open the port or knock, so
//! that nobody finds a port that is taken and no socket yet.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use rustix::fs::{FlockOperation, flock};
use rustix::process::geteuid;

use crate::ports::key::PortKey;
use crate::system::clock::monotonic;
use crate::system::process::Process;

/// How long another program may take to open the port or to find out who has it.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often it is looked whether it is done.
const STEP: Duration = Duration::from_millis(2);

/// The meeting place of one port.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    folder: PathBuf,
    name: String,
}

/// The right to open the port, or to knock. The system takes it back from a program that dies.
#[derive(Debug)]
pub(crate) struct Turn(#[expect(dead_code, reason = "held for its lock")] File);

/// A socket that others find, until this is dropped.
#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) listener: UnixListener,
    path: PathBuf,
    /// Which file it is, so that nobody else's is removed.
    file: (u64, u64),
    opened_by: Process,
}

/// Why nobody opened.
#[derive(Debug)]
pub(crate) enum Nobody {
    /// No program serves this port.
    Absent,
    /// One did, and is gone or about to be.
    Gone,
}

impl Place {
    /// The place of the port that `key` tells apart; `None` while there is no such port.
    ///
    /// # Errors
    ///
    /// There is no folder that is this user's alone.
    pub(crate) fn of(key: &PortKey) -> io::Result<Option<Self>> {
        let Some(name) = key.name() else { return Ok(None) };
        Ok(Some(Self { folder: run_time_folder()?, name }))
    }

    #[cfg(test)]
    pub(crate) fn in_folder(folder: PathBuf, name: &str) -> Self {
        Self { folder, name: name.to_owned() }
    }

    /// The file of this port with such an ending.
    pub(crate) fn path(&self, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", self.name))
    }

    /// Waits until no other program opens this port or knocks. `None` where one takes too long: then it is gone on without.
    pub(crate) fn turn(&self) -> io::Result<Option<Turn>> {
        let options = OpenOptions::new().create(true).append(true).mode(0o600).clone();
        let file = options.open(self.path("lock"))?;
        let end = monotonic() + PATIENCE;
        while flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
            if monotonic() >= end {
                return Ok(None);
            }
            thread::sleep(STEP);
        }
        Ok(Some(Turn(file)))
    }

    /// Puts the socket there. Whatever stands there is of a program that has the port no more.
    pub(crate) fn open_door(&self) -> io::Result<Door> {
        let path = self.path("sock");
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let listener = UnixListener::bind(&path)?;
        fs::set_permissions(&path, Permissions::from_mode(0o600))?;
        listener.set_nonblocking(true)?;
        let file = file_of(&path)?;
        Ok(Door { listener, path, file, opened_by: Process::current() })
    }

    /// Connects to the program that serves the port.
    pub(crate) fn knock(&self) -> Result<UnixStream, Nobody> {
        UnixStream::connect(self.path("sock")).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => Nobody::Absent,
            _ => Nobody::Gone,
        })
    }

    /// Whether `door` is the one that stands here.
    pub(crate) fn has(&self, door: &Door) -> bool {
        door.path == self.path("sock") && file_of(&door.path).is_ok_and(|file| file == door.file)
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        // A forked child has it too; and another program may have put its own there by now.
        if self.opened_by.is_current() && file_of(&self.path).is_ok_and(|file| file == self.file) {
            // Where it cannot be removed, who knocks finds that nobody opens.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Which file stands at `path`.
fn file_of(path: &Path) -> io::Result<(u64, u64)> {
    fs::symlink_metadata(path).map(|status| (status.dev(), status.ino()))
}

/// The folder for the sockets of this user's programs, made where it is missing; nobody else can look into it.
///
/// # Errors
///
/// It cannot be made, or is not this user's alone.
pub fn run_time_folder() -> io::Result<PathBuf> {
    let user = geteuid().as_raw();
    let run_time = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let run_time = run_time.filter(|path| path.is_absolute() && is_of(path, user));
    let folder = run_time.map_or_else(|| PathBuf::from(format!("/tmp/drivebus-{user}")), |path| path.join("drivebus"));
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let is_private = fs::symlink_metadata(&folder)
        .is_ok_and(|status| status.is_dir() && status.uid() == user && status.mode() & 0o777 == 0o700);
    if !is_private {
        let why = format!("{} is not a folder of this user's alone (mode 0700)", folder.display());
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    Ok(folder)
}

fn is_of(path: &Path, user: u32) -> bool {
    fs::metadata(path).is_ok_and(|status| status.is_dir() && status.uid() == user)
}
