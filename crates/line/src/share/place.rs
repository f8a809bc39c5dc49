//! Where programs meet over a port: what is named after the port, in a [folder](super::folder) of one user or of a group.
//!
//! That is a Unix [`socket`]; where there are none, a file that says where on the [`loopback`] the program listens, and by
//! what secret both know each other. A lock beside it lets one program at a time open the port or knock, so that nobody finds
//! a port that is taken and no place to knock at yet.

mod files;
mod loopback;
#[cfg(unix)]
mod socket;

use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use drivebus_rtu::Instant;

use crate::share::folder::of_user;
#[cfg(unix)]
use crate::share::folder::{is_over_loopback, of_group, of_machine};
use crate::share::place::files::Lock;
use crate::share::secret::Secret;
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::Process;
use crate::system::sockets::{Listener, Stream};

/// How long another program may take to open the port or to find out who has it.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often it is looked whether it is done.
const STEP: Duration = Duration::from_millis(2);

/// The meeting place of one port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Place {
    folder: PathBuf,
    name: String,
    way: Way,
}

/// What stands there.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Way {
    /// A socket for the programs of one user; its name without a file, where there is one.
    #[cfg(unix)]
    Socket { nameless: Option<String> },
    /// A socket for the programs of a group, beside those of one user.
    #[cfg(unix)]
    SocketOfGroup,
    /// The address of one on the loopback, and a secret, for the programs of one user.
    Loopback,
}

/// The right to open the port, or to knock. The system takes it back from a program that dies.
#[derive(Debug)]
pub(crate) struct Turn(#[expect(dead_code, reason = "held until it is dropped")] Lock);

/// What others find, until this is dropped.
#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) entrances: Arc<[Entrance]>,
    sign: Sign,
    opened_by: Process,
}

/// What stands at the place, so that nobody else's is taken for it, or removed.
#[derive(Debug)]
enum Sign {
    /// A socket, and which file it is.
    #[cfg(unix)]
    Socket { path: PathBuf, file: (u64, u64) },
    /// A file with this secret; and one beside it that is open, by which its program is known to live.
    Secret { path: PathBuf, secret: Secret, beside: PathBuf, _kept: Kept<fs::File> },
}

/// Where programs come in.
#[derive(Debug)]
pub(crate) struct Entrance {
    pub(crate) listener: Kept<Listener>,
    pub(crate) reached_by: ReachedBy,
}

/// Who reaches an entrance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ReachedBy {
    /// This user's programs alone.
    #[cfg(unix)]
    ThisUser,
    /// Those of a group, too: the system lets nobody else connect.
    #[cfg(unix)]
    Group,
    /// Anybody: the system says whose it is.
    #[cfg(unix)]
    Anybody,
    /// Anybody, of whom nothing is known: who knows the secret is this user's.
    Strangers(Secret),
}

/// Somebody who opened.
#[derive(Debug)]
pub(crate) struct Reached {
    pub(crate) stream: Stream,
    /// What it has to prove that it knows; `None` where the system has looked who it is.
    pub(crate) secret: Option<Secret>,
}

/// Why nobody opened.
#[derive(Debug)]
pub(crate) enum Nobody {
    /// No program serves this port.
    Absent,
    /// One did, and is gone or about to be.
    Gone,
    /// One may, and this user is not to come in: why.
    #[cfg(unix)]
    NotForUs(String),
    /// One does, and so many knock already that nobody hears this one.
    Crowded,
}

impl Place {
    /// Where the program may stand that has one of the ports which are called `names`, in one order for everybody: where this
    /// one [would](Self::own), and beside that where one stands for its user, or for a group.
    ///
    /// # Errors
    ///
    /// As of [`own`](Self::own).
    #[cfg(unix)]
    pub(crate) fn all(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        let own = Self::own(names.clone(), group)?;
        let is_there = |place: &Self| fs::symlink_metadata(place.path(place.ending())).is_ok();
        if group.is_some() {
            let of_user = Self::own(names, None).unwrap_or_default();
            return Ok(of_user.into_iter().filter(is_there).chain(own).collect());
        }
        let folder = of_machine();
        let of_group = folder.into_iter().flat_map(|folder| {
            let place = move |name| Self { folder: folder.clone(), name, way: Way::SocketOfGroup };
            in_order(names.clone()).map(place)
        });
        Ok(own.into_iter().chain(of_group.filter(is_there)).collect())
    }

    /// As [`own`](Self::own): nobody serves a group here.
    #[cfg(not(unix))]
    pub(crate) fn all(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        Self::own(names, group)
    }

    /// Whether a program that serves `group`, or its own user's alone, has its place here.
    #[cfg(unix)]
    pub(crate) const fn is_own(&self, group: Option<u32>) -> bool {
        self.is_of_group() == group.is_some()
    }

    /// Where this program lets others in, which serves `group` or else its own user's programs alone.
    ///
    /// # Errors
    ///
    /// There is no folder that is this user's, or the group's.
    #[cfg(unix)]
    pub(crate) fn own(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        let (folder, is_fixed) = match group {
            Some(group) => (of_group(group)?, false),
            None => of_user()?,
        };
        let nameless = |name: &str| format!("drivebus-{}-{name}", crate::system::process::user());
        let is_over_loopback = is_over_loopback();
        let place = |name: String| Self {
            folder: folder.clone(),
            way: match group {
                Some(_) => Way::SocketOfGroup,
                None if is_over_loopback => Way::Loopback,
                None => Way::Socket { nameless: (is_fixed && cfg!(target_os = "linux")).then(|| nameless(&name)) },
            },
            name,
        };
        Ok(in_order(names).map(place).collect())
    }

    /// Where this program lets others in: its own user's programs alone.
    ///
    /// # Errors
    ///
    /// There is no folder that is this user's, or a group is to be served.
    #[cfg(not(unix))]
    pub(crate) fn own(names: Vec<String>, group: Option<u32>) -> io::Result<Vec<Self>> {
        if group.is_some() {
            let why = "programs of several users share a port over Unix sockets, which this system has not";
            return Err(io::Error::new(io::ErrorKind::Unsupported, why));
        }
        let folder = of_user()?;
        Ok(in_order(names).map(|name| Self { folder: folder.clone(), name, way: Way::Loopback }).collect())
    }

    #[cfg(all(test, unix))]
    pub(crate) fn in_folder(folder: PathBuf, name: &str) -> Self {
        Self { folder, name: name.to_owned(), way: Way::Socket { nameless: None } }
    }

    #[cfg(test)]
    pub(crate) fn on_loopback(folder: PathBuf, name: &str) -> Self {
        Self { folder, name: name.to_owned(), way: Way::Loopback }
    }

    #[cfg(unix)]
    const fn is_of_group(&self) -> bool {
        matches!(self.way, Way::SocketOfGroup)
    }

    /// The name without a file, where there is one.
    #[cfg(unix)]
    fn nameless(&self) -> Option<&str> {
        match &self.way {
            Way::Socket { nameless } => nameless.as_deref(),
            Way::SocketOfGroup | Way::Loopback => None,
        }
    }

    /// What the name of the file ends in that others find.
    const fn ending(&self) -> &'static str {
        match self.way {
            #[cfg(unix)]
            Way::Socket { .. } | Way::SocketOfGroup => "sock",
            Way::Loopback => "tcp",
        }
    }

    /// The file of this port with such an ending.
    pub(crate) fn path(&self, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", self.name))
    }

    /// Waits until no other program opens this port or knocks. `None` where one takes too long: then it is gone on without.
    pub(crate) fn turn(&self) -> io::Result<Option<Turn>> {
        let Some(mut lock) = self.lock()? else { return Ok(None) };
        let end = monotonic() + PATIENCE;
        while !lock.is_taken() {
            if monotonic() >= end {
                return Ok(None);
            }
            thread::sleep(STEP);
        }
        Ok(Some(Turn(lock)))
    }

    /// Puts there what others find. Whatever stands there is of a program that has the port no more.
    pub(crate) fn open_door(&self) -> io::Result<Door> {
        match self.way {
            #[cfg(unix)]
            Way::Socket { .. } | Way::SocketOfGroup => self.put_socket(),
            Way::Loopback => self.put_secret(),
        }
    }

    /// Connects to the program that serves the port; by `until` where many knock.
    pub(crate) fn knock(&self, until: Instant) -> Result<Reached, Nobody> {
        match self.way {
            #[cfg(unix)]
            Way::Socket { .. } | Way::SocketOfGroup => {
                self.knock_at_socket(until).map(|stream| Reached { stream, secret: None })
            }
            Way::Loopback => self.knock_on_loopback(until),
        }
    }

    /// Whether `door` is the one that stands here.
    pub(crate) fn has(&self, door: &Door) -> bool {
        door.sign.path() == &self.path(self.ending()) && door.sign.stands()
    }
}

impl Sign {
    fn path(&self) -> &PathBuf {
        match self {
            #[cfg(unix)]
            Self::Socket { path, .. } => path,
            Self::Secret { path, .. } => path,
        }
    }

    fn stands(&self) -> bool {
        match self {
            #[cfg(unix)]
            Self::Socket { path, file } => socket::file_of(path).is_ok_and(|found| found == *file),
            Self::Secret { path, secret, .. } => loopback::read(path).is_some_and(|(_, found)| found == *secret),
        }
    }
}

impl Door {
    fn new(entrances: impl Iterator<Item = Entrance>, sign: Sign) -> Self {
        Self { entrances: entrances.collect(), sign, opened_by: Process::current() }
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        // A forked child has it too; and another program may have put its own there by now.
        if self.opened_by.is_current() && self.sign.stands() {
            // Where it cannot be removed, who knocks finds that nobody opens.
            let _ = fs::remove_file(self.sign.path());
        }
        if self.opened_by.is_current()
            && let Sign::Secret { beside, .. } = &self.sign
        {
            // Where it cannot be removed, the next program removes it.
            let _ = fs::remove_file(beside);
        }
    }
}

/// Each of `names` once, in the order that all programs have.
fn in_order(mut names: Vec<String>) -> impl Iterator<Item = String> {
    names.sort_unstable();
    names.dedup();
    names.into_iter()
}
