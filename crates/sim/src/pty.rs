//! The simulated line behind a pseudo-terminal: what opens it takes it for a serial port. Linux only.

use std::io;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_line::pty::{PtyLink, open_raw, speed};

use crate::outlet::Outlet;
use crate::pacer::{Next, Served, Serving};
use crate::port::Port;
use crate::shared::Shared;
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
        let link = link.map(|path| PtyLink::new(path, &pty.path)).transpose()?;
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
    link: Option<PtyLink>,
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
        let (ours, held, path) = open_raw(shared.began_as.baud_rate())?;
        let shared = Arc::clone(shared);
        let serving =
            Serving::start(move |watch, key| Ok(Box::new(Ours(Port::new(shared, ours, Some(speed), watch, key)?))))?;
        Ok(Self { path, serving: Some(serving), _held: held })
    }
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
