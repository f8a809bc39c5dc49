//! Ports served to other programs, as far as pulling the adapter out concerns them.

use std::fmt::Debug;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// A port that can be pulled out and put back.
pub(crate) trait Outlet: Send + Sync + Debug {
    /// Closes the port; whoever has it open sees it gone when this returns.
    fn unplug(&self);

    /// Opens it again.
    fn replug(&self) -> io::Result<()>;
}

/// All ports of one simulation that are still served.
#[derive(Debug, Default)]
pub(crate) struct Outlets(Mutex<Vec<Weak<dyn Outlet>>>);

impl Outlets {
    #[cfg(unix)]
    pub(crate) fn add(&self, outlet: &Arc<impl Outlet + 'static>) {
        let weak: Weak<dyn Outlet> = Arc::<_>::downgrade(outlet) as Weak<dyn Outlet>;
        let mut outlets = self.lock();
        outlets.retain(|other| other.strong_count() > 0);
        outlets.push(weak);
    }

    pub(crate) fn unplug(&self) {
        self.served().iter().for_each(|outlet| outlet.unplug());
    }

    pub(crate) fn replug(&self) -> io::Result<()> {
        self.served().iter().try_for_each(|outlet| outlet.replug())
    }

    /// Those that are still there; the list is not locked while they end their threads.
    fn served(&self) -> Vec<Arc<dyn Outlet>> {
        self.lock().iter().filter_map(Weak::upgrade).collect()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Weak<dyn Outlet>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
