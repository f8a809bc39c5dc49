//! A pseudo-terminal that overhears the wire: every character of either side, and nothing can be said there. Linux only.
//!
//! It has no thread. Whoever lets time pass in the simulation hands over what came, as its FIFO would.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use drivebus_line::pty::{PtyLink, open_raw};

use crate::ears::Ear;
use crate::shared::Shared;
use crate::wire::Listener;

/// An ear on the wire, for another program to open, until this is dropped.
#[derive(Debug)]
pub struct EarServer {
    shared: Arc<Shared>,
    listener: Listener,
    path: PathBuf,
    _link: Option<PtyLink>,
}

impl EarServer {
    pub(crate) fn start(shared: Arc<Shared>, link: Option<PathBuf>) -> io::Result<Self> {
        // Nobody holds the programs' side: our side shows whether one of them has it open.
        let (ours, _, path) = open_raw(shared.began_as.baud_rate())?;
        let link = link.map(|link| PtyLink::new(link, &path)).transpose()?;
        let mut world = shared.lock();
        let listener = world.attach_ear();
        shared.ears.add(Ear { listener, ours });
        drop(world);
        Ok(Self { shared, listener, path, _link: link })
    }

    /// What to open: `/dev/pts/N`.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for EarServer {
    fn drop(&mut self) {
        let mut world = self.shared.lock();
        world.detach(self.listener);
        self.shared.ears.remove(self.listener);
    }
}
