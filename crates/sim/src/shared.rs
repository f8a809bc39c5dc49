//! What every handle to one simulation shares: the world, its clock, and the ports behind which it is served.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_rtu::{Instant, SerialFormat};

use crate::clock::Clock;
#[cfg(target_os = "linux")]
use crate::ears::Ears;
use crate::outlet::Outlets;
use crate::world::World;

/// What every handle shares.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) clock: Clock,
    /// `sim:1=gd350,2=gd350`.
    pub(crate) name: String,
    pub(crate) units: Vec<u8>,
    pub(crate) world: Mutex<World>,
    /// How far the world has come, in nanoseconds.
    pub(crate) shown: Arc<AtomicU64>,
    /// After how many characters a served port hands them over.
    #[cfg_attr(not(unix), expect(dead_code, reason = "only Unix has ports to serve"))]
    pub(crate) fifo: usize,
    /// What the units were set to when the simulation began, and ports still are.
    #[cfg_attr(not(unix), expect(dead_code, reason = "only Unix has ports to serve"))]
    pub(crate) began_as: SerialFormat,
    pub(crate) outlets: Outlets,
    /// What the wire is overheard by.
    #[cfg(target_os = "linux")]
    pub(crate) ears: Ears,
}

impl Shared {
    /// The world as some thread left it; no thread leaves it half done.
    pub(crate) fn lock(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The present. In virtual time it is what the world has come to, and nobody who asks waits for the world.
    pub(crate) fn now(&self) -> Instant {
        self.clock.now(Instant::from_nanos(self.shown.load(Ordering::Acquire)))
    }

    /// The world, come to the present.
    pub(crate) fn present(&self) -> MutexGuard<'_, World> {
        let mut world = self.lock();
        let now = self.clock.now(world.now());
        #[cfg(target_os = "linux")]
        if world.wire.ears > 0 {
            self.ears.advance(&mut world, now, self.fifo);
            return world;
        }
        world.advance(now);
        world
    }

    /// Lets time pass until `until` without a line.
    pub(crate) fn pass(&self, until: Instant) {
        self.clock.wait(until, true);
        let mut world = self.present();
        if !self.clock.is_real() {
            world.advance(until);
        }
    }
}
