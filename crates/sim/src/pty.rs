//! The simulated line behind a pseudo-terminal: what opens it takes it for a serial port. Linux only.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::outlet::Outlet;
use crate::pacer::{Next, Served, Serving};
use crate::port::Port;
use crate::simulator::Shared;
use crate::watch::{Key, Watch};

/// A pseudo-terminal that is served until this is dropped.
///
/// The speed that a program sets on it counts: where it is not that of the units, they make nothing of what they are
/// sent. Parity and data bits cannot be set on a pseudo-terminal, and always fit. A program that sets nothing fits.
#[derive(Debug)]
pub struct PtyServer(Arc<Socket>);

impl PtyServer {
    pub(crate) fn start(shared: Arc<Shared>, link: Option<PathBuf>) -> io::Result<Self> {
        let pty = Pty::open(&shared)?;
        let link = link.map(|path| Link::new(path, &pty.path)).transpose()?;
        let socket = Arc::new(Socket { shared, link, pty: Mutex::new(pty) });
        socket.shared.outlets.add(&socket);
        Ok(Self(socket))
    }

    /// What to open: `/dev/pts/N`. While it is unplugged, what it was.
    pub fn path(&self) -> PathBuf {
        self.0.lock().path.clone()
    }
}

/// Where a pseudo-terminal is plugged in.
#[derive(Debug)]
struct Socket {
    shared: Arc<Shared>,
    link: Option<Link>,
    pty: Mutex<Pty>,
}

impl Socket {
    fn lock(&self) -> MutexGuard<'_, Pty> {
        self.pty.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Outlet for Socket {
    /// Programs see a hang-up. Their side of the old one stays open here, so that nobody else gets its name.
    fn unplug(&self) {
        self.lock().serving = None;
    }

    fn replug(&self) -> io::Result<()> {
        let mut pty = self.lock();
        if pty.serving.is_some() {
            return Ok(());
        }
        // Opened before the old one is let go, so that it has another name.
        let new = Pty::open(&self.shared)?;
        if let Some(link) = &self.link {
            link.lead_to(&new.path)?;
        }
        *pty = new;
        Ok(())
    }
}

/// One pseudo-terminal.
#[derive(Debug)]
struct Pty {
    path: PathBuf,
    /// Holds our side and closes it. Before `_held`, so that it is closed when the pseudo-terminal is given up.
    serving: Option<Serving>,
    /// The programs' side, kept open so that ours does not fail between two programs.
    _held: OwnedFd,
}

impl Pty {
    fn open(shared: &Arc<Shared>) -> io::Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let path = PathBuf::from(OsStr::from_bytes(ptsname(&ours, Vec::new())?.as_bytes()));

        let held = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        // Without this the terminal would echo requests back as answers and translate line ends.
        let mut raw = tcgetattr(&held)?;
        raw.make_raw();
        // A program that never sets a speed is taken to fit.
        raw.set_speed(shared.began_as.baud_rate())?;
        tcsetattr(&held, OptionalActions::Now, &raw)?;
        rustix::fs::fcntl_setfl(&ours, OFlags::NONBLOCK)?;

        let shared = Arc::clone(shared);
        let serving =
            Serving::start(move |watch, key| Ok(Box::new(Ours(Port::new(shared, ours, Some(speed), watch, key)?))))?;
        Ok(Self { path, serving: Some(serving), _held: held })
    }
}

/// The speed that the programs' side is set to. The system tells it at our side too.
fn speed(ours: &OwnedFd) -> Option<u32> {
    tcgetattr(ours).ok().map(|settings| settings.output_speed())
}

/// Our side of a pseudo-terminal. It fails only as a whole; its users then see it closed.
struct Ours(Port);

impl Served for Ours {
    fn serve(&mut self, readable: bool, _watch: &Watch, _key: Key) -> Next {
        self.0.serve(readable)
    }

    fn leave(&mut self, watch: &Watch) {
        self.0.leave(watch);
    }
}

/// A symbolic link that leads to the pseudo-terminal, whatever its name is by now; removed when this is dropped.
#[derive(Debug)]
struct Link {
    path: PathBuf,
    /// The process that made it. It outlives a child that was forked meanwhile.
    made_by: u32,
}

impl Link {
    fn new(path: PathBuf, target: &Path) -> io::Result<Self> {
        match fs::symlink_metadata(&path) {
            Ok(there) if !there.is_symlink() => {
                let message = format!("{} is there and is not a link; give another name", path.display());
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
            }
            _ => {}
        }
        let link = Self { path, made_by: std::process::id() };
        link.lead_to(target)?;
        Ok(link)
    }

    /// In one step: there is no moment without the link.
    fn lead_to(&self, target: &Path) -> io::Result<()> {
        let mut name = self.path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}", std::process::id()));
        let new = self.path.with_file_name(name);
        symlink(target, &new).and_then(|()| fs::rename(&new, &self.path)).map_err(|error| {
            let _ = fs::remove_file(&new); // where it was made, and leads nowhere that anybody asked for
            io::Error::new(error.kind(), format!("the link {} cannot be made: {error}", self.path.display()))
        })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if self.made_by == std::process::id() {
            // Somebody may have removed it already.
            let _ = fs::remove_file(&self.path);
        }
    }
}
