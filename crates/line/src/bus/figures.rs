//! What has happened at one line so far: it can be asked for while somebody waits on the line.

use std::sync::{Arc, Mutex, PoisonError};

use drivebus_rtu::UnitAddress;

use crate::health::link::{Link, Links};
use crate::health::stats::Stats;

/// The figures of one line, which its owner keeps.
#[derive(Debug)]
pub(super) struct Figures {
    stats: Arc<Mutex<Stats>>,
    links: Arc<Mutex<Links>>,
}

impl Figures {
    pub(super) fn new(stats: Arc<Mutex<Stats>>, links: Arc<Mutex<Links>>) -> Self {
        Self { stats, links }
    }

    /// What has happened so far.
    pub(super) fn stats(&self) -> Stats {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Of the last exchanges with `unit`, how many brought an answer.
    pub(super) fn link(&self, unit: UnitAddress) -> Link {
        self.links.lock().unwrap_or_else(PoisonError::into_inner).of(unit)
    }

    /// How often the line was opened again.
    pub(super) fn reconnects(&self) -> u64 {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects
    }
}
