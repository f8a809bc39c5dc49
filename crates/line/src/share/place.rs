//! Where programs meet over a port: a socket named after the port, in a [folder](super::folder) of one user or of a group.
//!
//! Whose program is at the other end is asked of the system, too. On Linux the socket of a user has a second name, without a
//! file, for who has another `/tmp` (`PrivateTmp` of a service): there the system has to know whose program it is. A lock beside
//! the socket lets one program at a time open the port or knock, so that nobody finds a port that is taken and no socket yet.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::process::geteuid;

use crate::share::folder::{group_named, of_group, of_machine, of_user};
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::{Peer, Process, peer};

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
    /// Whether those of a group meet there, beside the programs of one user.
    is_of_group: bool,
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
    pub(crate) reached_by: ReachedBy,
}

/// Who reaches an entrance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReachedBy {
    /// This user's programs alone.
    ThisUser,
    /// Those of a group, too: the system lets nobody else connect.
    Group,
    Anybody,
}

/// Why nobody opened.
#[derive(Debug)]
pub(crate) enum Nobody {
    /// No program serves this port.
    Absent,
    /// One did, and is gone or about to be.
    Gone,
    /// One may, and this user is not to come in: why.
    NotForUs(String),
    /// One does, and so many knock already that nobody hears this one.
    #[cfg_attr(not(target_os = "linux"), expect(dead_code, reason = "only on Linux it is known before somebody opens"))]
    Crowded,
}

impl Place {
    /// Where the program may stand that has one of the ports which are called `names`, in one order for everybody: where this
    /// one [would](Self::own), and beside that where one stands for its user, or for a group.
    ///
    /// # Errors
    ///
    /// As of [`own`](Self::own).
    pub(crate) fn all(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        let own = Self::own(names.clone(), group)?;
        let is_there = |place: &Self| fs::symlink_metadata(place.path("sock")).is_ok();
        if group.is_some() {
            let of_user = Self::own(names, None).unwrap_or_default();
            return Ok(of_user.into_iter().filter(is_there).chain(own).collect());
        }
        let folder = of_machine();
        let of_group = folder.into_iter().flat_map(|folder| {
            let place = move |name| Self { folder: folder.clone(), name, nameless: None, is_of_group: true };
            in_order(names.clone()).map(place)
        });
        Ok(own.into_iter().chain(of_group.filter(is_there)).collect())
    }

    /// Whether a program that serves `group`, or its own user's alone, has its place here.
    pub(crate) const fn is_own(&self, group: Option<u32>) -> bool {
        self.is_of_group == group.is_some()
    }

    /// Where this program lets others in, which serves `group` or else its own user's programs alone.
    ///
    /// # Errors
    ///
    /// There is no folder that is this user's, or the group's.
    pub(crate) fn own(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        let (folder, is_fixed) = match group {
            Some(group) => (of_group(group)?, false),
            None => of_user()?,
        };
        let nameless = |name: &str| format!("drivebus-{}-{name}", geteuid().as_raw());
        let place = |name: String| Self {
            folder: folder.clone(),
            nameless: (is_fixed && cfg!(target_os = "linux")).then(|| nameless(&name)),
            name,
            is_of_group: group.is_some(),
        };
        Ok(in_order(names).map(place).collect())
    }

    #[cfg(test)]
    pub(crate) fn in_folder(folder: PathBuf, name: &str) -> Self {
        Self { folder, name: name.to_owned(), nameless: None, is_of_group: false }
    }

    /// The file of this port with such an ending.
    pub(crate) fn path(&self, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", self.name))
    }

    /// What a file here allows: nobody else than who meets here reads or writes it.
    const fn mode(&self) -> u32 {
        if self.is_of_group { 0o660 } else { 0o600 }
    }

    /// The file of this port with such an ending, made anew if `is_new`. What somebody else put in its place is not followed.
    pub(crate) fn file(&self, ending: &str, is_new: bool) -> io::Result<File> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).mode(self.mode()).custom_flags(OFlags::NOFOLLOW.bits().cast_signed());
        let file = options.create(!is_new).create_new(is_new).open(self.path(ending))?;
        let status = file.metadata()?;
        if self.is_of_group && status.uid() == geteuid().as_raw() && status.mode() & 0o777 != self.mode() {
            // What the user's mask took away.
            file.set_permissions(Permissions::from_mode(self.mode()))?;
        }
        Ok(file)
    }

    /// Waits until no other program opens this port or knocks. `None` where one takes too long: then it is gone on without.
    pub(crate) fn turn(&self) -> io::Result<Option<Turn>> {
        let file = match Kept::opened(|| self.file("lock", false)) {
            Ok(file) => file,
            // Who may not come in need not wait either.
            Err(_) if self.is_of_group => return Ok(None),
            Err(error) => return Err(error),
        };
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
        fs::set_permissions(&path, Permissions::from_mode(self.mode()))?;
        listener.set_nonblocking(true)?;
        let file = file_of(&path)?;
        let reached_by = if self.is_of_group { ReachedBy::Group } else { ReachedBy::ThisUser };
        let first = Entrance { listener: Kept::new(listener), reached_by };
        // Where somebody has the other name, those who see the file come in all the same.
        let second = self.nameless.as_deref().and_then(|name| nameless::listen(name).ok());
        let second = second.map(|listener| Entrance { listener: Kept::new(listener), reached_by: ReachedBy::Anybody });
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
                    Ok(stream) if peer(&stream).user == Some(geteuid().as_raw()) => Ok(stream),
                    Err(Nobody::Crowded) => Err(Nobody::Crowded),
                    Ok(_) | Err(_) => Err(none),
                },
                (found, _) => found,
            };
            match found {
                Err(Nobody::Crowded) if monotonic() < until => thread::sleep(STEP),
                Err(Nobody::NotForUs(_)) => return Err(Nobody::NotForUs(self.whom_it_is_for())),
                Ok(stream) if !self.trusts(&peer(&stream)) => {
                    let folder = self.folder.display();
                    let why = format!("what stands in {folder} for this port is not of the user whose folder that is");
                    return Err(Nobody::NotForUs(why));
                }
                found => return found,
            }
        }
    }

    /// Whether who stands here may be asked: the same user, and where a group meets, the user whose folder it is.
    pub(crate) fn trusts(&self, peer: &Peer) -> bool {
        let host = || fs::symlink_metadata(&self.folder).map(|folder| folder.uid());
        match peer.user {
            Some(user) if self.is_of_group => user == 0 || host().is_ok_and(|host| host == user),
            Some(user) => user == geteuid().as_raw(),
            // It stands where nobody else could put it.
            None => true,
        }
    }

    fn whom_it_is_for(&self) -> String {
        let group = fs::symlink_metadata(self.path("sock")).map(|socket| group_named(socket.gid()));
        let group = group.unwrap_or_else(|_| "another group".to_owned());
        format!("this port is served to the users of {group}, and this one is not among them: `groups` says who is")
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

/// Each of `names` once, in the order that all programs have.
fn in_order(mut names: Vec<String>) -> impl Iterator<Item = String> {
    names.sort_unstable();
    names.dedup();
    names.into_iter()
}

/// Which file stands at `path`.
fn file_of(path: &Path) -> io::Result<(u64, u64)> {
    fs::symlink_metadata(path).map(|status| (status.dev(), status.ino()))
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
            Err(Errno::ACCESS) => Err(Nobody::NotForUs(String::new())),
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
            io::ErrorKind::PermissionDenied => Nobody::NotForUs(String::new()),
            _ => Nobody::Gone,
        })
    }
}
