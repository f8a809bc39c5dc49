//! What all connections of a gateway have in common.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use crate::bus::Bus;
use crate::gateway::audit::Audit;
use crate::gateway::commanders::{Commanders, Wills};
use crate::gateway::counts::Counts;
use crate::gateway::rights::Rights;
use crate::gateway::together::Together;
use crate::gateway::wear::Wear;

/// The line, the rules, and what is known of all clients.
#[derive(Debug)]
pub(super) struct Common {
    pub(super) bus: Weak<Bus>,
    pub(super) within: Duration,
    pub(super) rights: Rights,
    /// After how long a silence of who commanded motion it is halted; `None`: never.
    pub(super) dead_man: Option<Duration>,
    pub(super) audit: Audit,
    pub(super) counts: Arc<Counts>,
    pub(super) together: Arc<Together>,
    pub(super) wear: Wear,
    pub(super) commanders: Commanders,
    pub(super) seen: Seen,
}

impl Common {
    /// The bus, while it is open.
    pub(super) fn open_bus(&self) -> Option<Arc<Bus>> {
        self.bus.upgrade().filter(|bus| !bus.is_closed())
    }

    /// `client` is gone, or silent: what it commanded is halted. `why` is for people.
    pub(super) fn gone(self: &Arc<Self>, client: u64, name: &str, why: &str) {
        for unit in self.commanders.gone(client, &self.wills_of(name)) {
            self.counts.halts(name, unit, why);
            self.record(self.audit.halts(name, unit, why));
        }
    }

    /// The wills that are left for the client of that name.
    pub(super) fn wills_of<'a>(self: &'a Arc<Self>, name: &'a str) -> WillsOf<'a> {
        WillsOf { common: self, name }
    }

    /// Says so where a line of the audit was lost.
    pub(super) fn record(&self, is_written: bool) {
        if !is_written {
            self.counts.unaudited();
        }
    }
}

/// The wills of one client, left with the bus.
#[derive(Debug)]
pub(super) struct WillsOf<'a> {
    common: &'a Arc<Common>,
    name: &'a str,
}

impl Wills for WillsOf<'_> {
    fn leave(&self, unit: u8) -> Option<u64> {
        let will = self.common.rights.units.get(&unit)?.will.clone();
        let (counts, name) = (Arc::clone(&self.common.counts), self.name.to_owned());
        self.common
            .open_bus()?
            .leave_will_for(format!("client {name}"), will, move |took| counts.halted(&name, unit, took))
    }

    fn withdraw(&self, will: u64) {
        if let Some(bus) = self.common.bus.upgrade() {
            bus.withdraw_will(will);
        }
    }

    fn carry_out(&self, will: u64) {
        if let Some(bus) = self.common.bus.upgrade() {
            bus.carry_out_will(will);
        }
    }
}

/// Which units were asked who they are, since the port was opened last.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// By unit, the count of openings.
    units: Mutex<BTreeMap<u8, u64>>,
}

impl Seen {
    pub(super) fn has(&self, unit: u8, opening: u64) -> bool {
        self.units.lock().unwrap_or_else(PoisonError::into_inner).get(&unit) == Some(&opening)
    }

    pub(super) fn take(&self, unit: u8, opening: u64) {
        self.units.lock().unwrap_or_else(PoisonError::into_inner).insert(unit, opening);
    }
}
