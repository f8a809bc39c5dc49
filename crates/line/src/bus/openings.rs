//! How often the line was opened again.
//!
//! Counted where it is opened, and not where the line is used first: before another program is let in, which counts on
//! from what it is told.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::health::stats::Stats;
use crate::line::Opener;

/// The openings of one bus.
#[derive(Debug)]
pub(super) struct Openings {
    stats: Arc<Mutex<Stats>>,
    /// Whether the line was open before, here or at another program.
    was_open: AtomicBool,
}

impl Openings {
    pub(super) fn new(stats: &Arc<Mutex<Stats>>) -> Arc<Self> {
        Arc::new(Self { stats: Arc::clone(stats), was_open: AtomicBool::new(false) })
    }

    /// `open`, which counts each line that it opens but the first.
    pub(super) fn counting(self: &Arc<Self>, mut open: Opener) -> Opener {
        let openings = Arc::clone(self);
        Box::new(move || {
            let line = open()?;
            if openings.was_open.swap(true, Ordering::AcqRel) {
                openings.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects += 1;
            }
            Ok(line)
        })
    }

    /// The line is used as another program opened it.
    #[cfg(all(any(unix, windows), feature = "share"))]
    pub(super) fn open_elsewhere(&self) {
        self.was_open.store(true, Ordering::Release);
    }

    /// How often the line was opened again, if it is opened now.
    #[cfg(all(any(unix, windows), feature = "share"))]
    pub(super) fn with_one_now(&self) -> u64 {
        let reconnects = self.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects;
        reconnects + u64::from(self.was_open.load(Ordering::Acquire))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::{PortError, PortErrorKind};
    use crate::nobody;

    fn reconnects(stats: &Arc<Mutex<Stats>>) -> u64 {
        stats.lock().unwrap().reconnects
    }

    #[test]
    fn all_but_the_first_are_counted_as_soon_as_they_are_open() {
        let stats = Arc::default();
        let mut open = Openings::new(&stats).counting(nobody::opener());
        let counted: Vec<_> = (0..3)
            .map(|_| {
                open().unwrap();
                reconnects(&stats)
            })
            .collect();
        assert_eq!(counted, [0, 1, 2]);
    }

    #[test]
    fn what_does_not_open_is_not_counted() {
        let stats = Arc::default();
        let mut fails = Openings::new(&stats)
            .counting(Box::new(|| Err(PortError::new(PortErrorKind::NotFound, "port", "it is not there"))));
        assert!(fails().is_err() && fails().is_err());
        assert_eq!(reconnects(&stats), 0);
    }

    #[cfg(all(any(unix, windows), feature = "share"))]
    #[test]
    fn what_another_program_had_open_is_opened_again() {
        let stats = Arc::default();
        let openings = Openings::new(&stats);
        let mut open = openings.counting(nobody::opener());
        openings.open_elsewhere();
        open().unwrap();
        assert_eq!(reconnects(&stats), 1);
    }
}
