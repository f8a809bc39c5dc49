//! When a server closes its connections: what was seen of that, kept for as long as one bus uses the server.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// What is known of one server. Its copies know the same.
#[derive(Debug, Clone, Default)]
pub(crate) struct Closing(Arc<AtomicU8>);

const UNKNOWN: u8 = 0;
const KEEPS: u8 = 1;
const CLOSES: u8 = 2;

impl Closing {
    /// Whether no answer was looked behind yet.
    pub(crate) fn is_unknown(&self) -> bool {
        self.0.load(Ordering::Relaxed) == UNKNOWN
    }

    /// Whether it closes behind its answers.
    pub(crate) fn is_behind_answers(&self) -> bool {
        self.0.load(Ordering::Relaxed) == CLOSES
    }

    /// It left a connection open behind an answer. That it closed one once counts for more.
    pub(crate) fn left_open(&self) {
        let _ = self.0.compare_exchange(UNKNOWN, KEEPS, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// It closed a connection behind an answer.
    pub(crate) fn closed(&self) {
        self.0.store(CLOSES, Ordering::Relaxed);
    }
}
