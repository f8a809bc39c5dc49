//! Where the programs of one user meet over a port: a socket named after the port, in a folder that is always the same.
//!
//! No variable says where: a program that cron starts, a service and one in a terminal have different ones, and have to
//! meet. So `/run/user`, which comes and goes with who is logged in, is not used. Only `DRIVEBUS_RUNTIME_DIR` puts the folder
//! elsewhere, for tests and for containers that are given another one.
//!
//! The folder is this user's alone (0700), so that no other user reaches what is in it; whose program is at the other end
//! is asked of the system all the same. On Linux the socket has a second name, without a file, for who has another `/tmp`
//! (`PrivateTmp` of a service): there the system has to know whose program it is. A lock beside the socket lets one program
//! at a time open the port or knock, so that nobody finds a port that is taken and no socket yet.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::fs::{FlockOperation, flock};
use rustix::process::geteuid;

use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::{Process, peer};

/// The variable that puts the folder elsewhere.
const ELSEWHERE: &str = "DRIVEBUS_RUNTIME_DIR";
/// How long another program may take to open the port or to find out who has it.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often it is looked whether it is done.
const STEP: Duration = Duration::from_millis(2);

/// The meeting place of one port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Place {
    folder: PathBuf,
    name: String,
    /// The name without a file, where there is one.
    nameless: Option<String>,
}

/// The right to open the port, or to knock. The system takes it back from a program that dies.
#[derive(Debug)]
pub(crate) struct Turn(#[expect(dead_code, reason = "held for its lock")] Kept<File>);

/// A socket that others find, until this is dropped.
#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) entrances: Arc<[Entrance]>,
    path: PathBuf,
    /// Which file it is, so that nobody else's is removed.
    file: (u64, u64),
    opened_by: Process,
}

/// Where programs come in.
#[derive(Debug)]
pub(crate) struct Entrance {
    pub(crate) listener: Kept<UnixListener>,
    /// Whether nobody but this user reaches it.
    pub(crate) is_private: bool,
}

/// Why nobody opened.
#[derive(Debug)]
pub(crate) enum Nobody {
    /// No program serves this port.
    Absent,
    /// One did, and is gone or about to be.
    Gone,
    /// One does, and so many knock already that nobody hears this one.
    #[cfg_attr(not(target_os = "linux"), expect(dead_code, reason = "only on Linux it is known before somebody opens"))]
    Crowded,
}

impl Place {
    /// The places of the ports that are called `names`, in one order for everybody.
    ///
    /// # Errors
    ///
    /// There is no folder that is this user's alone.
    pub(crate) fn all(mut names: Vec<String>) -> io::Result<Vec<Self>> {
        names.sort_unstable();
        names.dedup();
        let (folder, is_fixed) = folder()?;
        let nameless = |name: &str| format!("drivebus-{}-{name}", geteuid().as_raw());
        let place = |name: String| Self {
            folder: folder.clone(),
            nameless: (is_fixed && cfg!(target_os = "linux")).then(|| nameless(&name)),
            name,
        };
        Ok(names.into_iter().map(place).collect())
    }

    #[cfg(test)]
    pub(crate) fn in_folder(folder: PathBuf, name: &str) -> Self {
        Self { folder, name: name.to_owned(), nameless: None }
    }

    /// The file of this port with such an ending.
    pub(crate) fn path(&self, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", self.name))
    }

    /// Waits until no other program opens this port or knocks. `None` where one takes too long: then it is gone on without.
    pub(crate) fn turn(&self) -> io::Result<Option<Turn>> {
        let options = OpenOptions::new().create(true).append(true).mode(0o600).clone();
        let file = Kept::opened(|| options.open(self.path("lock")))?;
        let end = monotonic() + PATIENCE;
        while flock(&*file, FlockOperation::NonBlockingLockExclusive).is_err() {
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
        let first = Entrance { listener: Kept::new(listener), is_private: true };
        // Where somebody has the other name, those who see the file come in all the same.
        let second = self.nameless.as_deref().and_then(|name| nameless::listen(name).ok());
        let second = second.map(|listener| Entrance { listener: Kept::new(listener), is_private: false });
        Ok(Door {
            entrances: std::iter::once(first).chain(second).collect(),
            path,
            file,
            opened_by: Process::current(),
        })
    }

    /// Connects to the program that serves the port; by `until` where many knock.
    pub(crate) fn knock(&self, until: Instant) -> Result<UnixStream, Nobody> {
        loop {
            let by_file = connect::to_file(&self.path("sock"));
            let found = match (by_file, &self.nameless) {
                (Err(none @ (Nobody::Absent | Nobody::Gone)), Some(name)) => match nameless::connect(name) {
                    // What anybody may have put there counts where it is this user's.
                    Ok(stream) if peer(&stream).is_this_user == Some(true) => Ok(stream),
                    Err(Nobody::Crowded) => Err(Nobody::Crowded),
                    Ok(_) | Err(_) => Err(none),
                },
                (found, _) => found,
            };
            match found {
                Err(Nobody::Crowded) if monotonic() < until => thread::sleep(STEP),
                found => return found,
            }
        }
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
/// It is `/tmp/drivebus-UID` in every program, whatever its environment; `DRIVEBUS_RUNTIME_DIR` puts it elsewhere.
///
/// # Errors
///
/// It cannot be made, or is not this user's alone.
pub fn run_time_folder() -> io::Result<PathBuf> {
    folder().map(|(folder, _)| folder)
}

/// The folder, and whether it is the one that is always the same.
fn folder() -> io::Result<(PathBuf, bool)> {
    let user = geteuid().as_raw();
    let elsewhere = std::env::var_os(ELSEWHERE).filter(|given| !given.is_empty()).map(PathBuf::from);
    let (folder, is_fixed) = match elsewhere {
        Some(given) if given.is_absolute() && is_of(&given, user) => (given.join("drivebus"), false),
        Some(given) => {
            let why = format!("{ELSEWHERE} is {}, which is no folder of this user's", given.display());
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
        }
        None => (PathBuf::from(format!("/tmp/drivebus-{user}")), true),
    };
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
    Ok((folder, is_fixed))
}

fn is_of(path: &Path, user: u32) -> bool {
    fs::metadata(path).is_ok_and(|status| status.is_dir() && status.uid() == user)
}

/// Names without a file, which all programs see that share a network.
#[cfg(target_os = "linux")]
mod nameless {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::SocketAddr;

    use super::{Nobody, UnixListener, UnixStream, io};

    pub(super) fn listen(name: &str) -> io::Result<UnixListener> {
        let listener = UnixListener::bind_addr(&SocketAddr::from_abstract_name(name)?)?;
        listener.set_nonblocking(true)?;
        Ok(listener)
    }

    pub(super) fn connect(name: &str) -> Result<UnixStream, Nobody> {
        super::connect::to(rustix::net::SocketAddrUnix::new_abstract_name(name.as_bytes()))
    }
}

#[cfg(not(target_os = "linux"))]
mod nameless {
    use super::{Nobody, UnixListener, UnixStream, io};

    pub(super) fn listen(_name: &str) -> io::Result<UnixListener> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(super) fn connect(_name: &str) -> Result<UnixStream, Nobody> {
        Err(Nobody::Absent)
    }
}

/// Connects without waiting: at a program that hangs, who knocks would wait until somebody opens.
#[cfg(target_os = "linux")]
mod connect {
    use rustix::io::Errno;
    use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, socket_with};

    use super::{Nobody, Path, UnixStream};

    pub(super) fn to_file(path: &Path) -> Result<UnixStream, Nobody> {
        to(SocketAddrUnix::new(path))
    }

    pub(super) fn to(address: Result<SocketAddrUnix, Errno>) -> Result<UnixStream, Nobody> {
        let how = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, how, None).map_err(|_| Nobody::Crowded)?;
        match address.and_then(|address| rustix::net::connect(&socket, &address)) {
            Ok(()) => Ok(UnixStream::from(socket)),
            Err(Errno::NOENT) => Err(Nobody::Absent),
            Err(Errno::AGAIN) => Err(Nobody::Crowded),
            Err(_) => Err(Nobody::Gone),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod connect {
    use super::{Nobody, Path, UnixStream, io};

    pub(super) fn to_file(path: &Path) -> Result<UnixStream, Nobody> {
        UnixStream::connect(path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => Nobody::Absent,
            _ => Nobody::Gone,
        })
    }
}
