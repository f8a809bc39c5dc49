//! The Unix socket of a port: who puts it there, and who knocks at it.
//!
//! Whose program is at the other end is asked of the system, too. On Linux the socket of a user has a second name, without a
//! file, for who has another `/tmp` (`PrivateTmp` of a service): there the system has to know whose program it is.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::thread;

use drivebus_rtu::Instant;
use rustix::process::geteuid;

use super::{Door, Entrance, Nobody, Place, ReachedBy, STEP, Sign};
use crate::share::folder::group_named;
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::{Peer, peer_of};
use crate::system::sockets::{Listener, Stream};

impl Place {
    /// Puts the socket there. Whatever stands there is of a program that has the port no more.
    pub(super) fn put_socket(&self) -> io::Result<Door> {
        let path = self.path("sock");
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let listener = UnixListener::bind(&path)?;
        fs::set_permissions(&path, Permissions::from_mode(self.mode()))?;
        listener.set_nonblocking(true)?;
        let file = file_of(&path)?;
        let reached_by = if self.is_of_group() { ReachedBy::Group } else { ReachedBy::ThisUser };
        let first = Entrance { listener: Kept::new(Listener::Unix(listener)), reached_by };
        // Where somebody has the other name, those who see the file come in all the same.
        let second = self.nameless().and_then(|name| nameless::listen(name).ok());
        let second = second
            .map(|listener| Entrance { listener: Kept::new(Listener::Unix(listener)), reached_by: ReachedBy::Anybody });
        Ok(Door::new(std::iter::once(first).chain(second), Sign::Socket { path, file }))
    }

    /// Connects to the program that serves the port; by `until` where many knock.
    pub(super) fn knock_at_socket(&self, until: Instant) -> Result<Stream, Nobody> {
        loop {
            let by_file = connect::to_file(&self.path("sock"));
            let found = match (by_file, self.nameless()) {
                (Err(none @ (Nobody::Absent | Nobody::Gone)), Some(name)) => match nameless::connect(name) {
                    // What anybody may have put there counts where it is this user's.
                    Ok(stream) if peer_of(&stream).user == Some(geteuid().as_raw()) => Ok(stream),
                    Err(Nobody::Crowded) => Err(Nobody::Crowded),
                    Ok(_) | Err(_) => Err(none),
                },
                (found, _) => found,
            };
            match found {
                Err(Nobody::Crowded) if monotonic() < until => thread::sleep(STEP),
                Err(Nobody::NotForUs(_)) => return Err(Nobody::NotForUs(self.whom_it_is_for())),
                Ok(stream) if !self.trusts(&peer_of(&stream)) => {
                    let folder = self.folder.display();
                    let why = format!("what stands in {folder} for this port is not of the user whose folder that is");
                    return Err(Nobody::NotForUs(why));
                }
                found => return found.map(Stream::Unix),
            }
        }
    }

    /// Whether who stands here may be asked: the same user, and where a group meets, the user whose folder it is.
    fn trusts(&self, peer: &Peer) -> bool {
        let host = || fs::symlink_metadata(&self.folder).map(|folder| folder.uid());
        match peer.user {
            Some(user) if self.is_of_group() => user == 0 || host().is_ok_and(|host| host == user),
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
}

/// Which file stands at `path`.
pub(super) fn file_of(path: &Path) -> io::Result<(u64, u64)> {
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
