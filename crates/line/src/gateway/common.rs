//! What all connections of a gateway have in common.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use crate::bus::Bus;
use crate::gateway::audit::Audit;
use crate::gateway::commanders::{Commanders, Wills};
use crate::gateway::counts::Counts;
use crate::gateway::framing::Framing;
use crate::gateway::rights::Rights;
use crate::gateway::together::Together;
use crate::gateway::wear::Wear;

/// The line, the rules, and what is known of all clients.
#[derive(Debug)]
pub(super) struct Common {
    pub(super) bus: Weak<Bus>,
    pub(super) within: Duration,
    pub(super) framing: Framing,
    pub(super) rights: Rights,
    /// After how long a silence of who commanded motion it is halted; `None`: never.
    pub(super) dead_man: Option<Duration>,
    pub(super) audit: Arc<Audit>,
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

    /// This thread works for the bus alone.
    pub(super) fn enter_thread(&self) {
        if let Some(bus) = self.bus.upgrade() {
            bus.enter_thread();
        }
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
        self.common.open_bus()?.leave_will_for(format!("client {name}"), will, move |took, shown| match shown {
            None => counts.halted(&name, unit, took),
            Some(shown) => counts.shows(&name, unit, shown),
        })
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

/// What the units said of who they are.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// By unit, what it said first, and at which opening of the port it was asked last.
    units: Mutex<BTreeMap<u8, (Vec<u8>, u64)>>,
}

impl Seen {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u8, (Vec<u8>, u64)>> {
        self.units.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether `unit` was asked at this `opening` of the port.
    pub(super) fn has(&self, unit: u8, opening: u64) -> bool {
        self.lock().get(&unit).is_some_and(|(_, last)| *last == opening)
    }

    /// Whether `unit`, which `said` that at this `opening`, is the one that it was.
    pub(super) fn is_same(&self, unit: u8, opening: u64, said: &[u8]) -> bool {
        let mut units = self.lock();
        let (first, last) = units.entry(unit).or_insert_with(|| (said.to_vec(), opening));
        let is_same = *first == said;
        if is_same {
            *last = opening;
        }
        is_same
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_asked_once_an_opening_and_is_who_it_said_first() {
        let seen = Seen::default();
        assert!(!seen.has(1, 0));
        assert!(seen.is_same(1, 0, &[3, 2, 1, 0xA0]) && seen.has(1, 0) && !seen.has(1, 1));
        assert!(!seen.is_same(1, 1, &[0x83, 2]) && !seen.has(1, 1), "it is asked again");
        assert!(seen.is_same(1, 2, &[3, 2, 1, 0xA0]) && seen.has(1, 2));
        assert!(seen.is_same(2, 2, &[0x83, 2]), "one that refuses to tell is known by that");
    }
}
