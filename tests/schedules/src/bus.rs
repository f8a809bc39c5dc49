// What `workers` and `listen` need of a bus: as in `crates/line/src/bus.rs`, without forked children. And its door, which
// `crates/line/src/bus/sharing.rs` opens and ends there.

use std::sync::Arc;

use drivebus_rtu::UnitAddress;

use crate::bus::errand::Errand;
use crate::bus::host::{Guests, Host};
use crate::bus::port::Port;
use crate::bus::shared::Shared;
use crate::error::Failure;
use crate::line::Opener;
use crate::options::BusOptions;
use crate::share::place::Door;
use crate::turns::queue::Queue;

/// One line and its owner.
#[derive(Debug)]
pub(crate) struct Bus {
    pub(in crate::bus) shared: Arc<Shared>,
}

impl Bus {
    pub(crate) fn open(opener: Opener, options: BusOptions) -> Result<Self, Failure> {
        Shared::open(opener, None, options, &mut || false).map(|shared| Self { shared })
    }

    pub(crate) fn port(&self) -> &Arc<Port> {
        &self.shared.port
    }

    pub(crate) fn options(&self) -> &BusOptions {
        &self.port().options
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.port().is_closed()
    }

    pub(crate) fn is_shut(&self) -> bool {
        self.port().is_shut()
    }

    pub(crate) fn close(&self) {
        self.port().close();
    }

    pub(crate) fn enter_thread(&self) {
        self.port().enter_thread();
    }
}

/// What scenarios look at.
impl Bus {
    pub(crate) fn queue(&self) -> &Queue<Errand> {
        &self.port().queue
    }

    pub(crate) fn halts(&self, unit: UnitAddress) -> u64 {
        self.port().halts.of(unit)
    }

    pub(crate) fn reconnects(&self) -> u64 {
        self.port().figures.reconnects()
    }
}

/// An open door, and who is in.
#[derive(Debug)]
pub(crate) struct OpenDoor {
    host: Host,
    guests: Arc<Guests>,
}

impl OpenDoor {
    pub(crate) fn new(door: Door, bus: &Bus) -> std::io::Result<Self> {
        let guests = Arc::<Guests>::default();
        let host = Host::open(door, Arc::clone(&guests), Arc::downgrade(bus.port()))?;
        Ok(Self { host, guests })
    }

    /// Nobody comes in any more, and nobody who is in is heard any more.
    pub(crate) fn end(self) {
        drop(self.host);
        self.guests.end();
    }

    /// The port was opened again, so often by now.
    pub(crate) fn reopened(&self, reconnects: u64) {
        self.guests.reopened(reconnects);
    }

    /// How many calls of all programs were answered.
    pub(crate) fn answered(&self) -> u64 {
        self.guests.counted().iter().map(|program| program.answered).sum()
    }

    pub(crate) fn note(&self) -> Option<String> {
        self.guests.note()
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        self.port().dismiss();
    }
}
