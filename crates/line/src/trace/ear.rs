//! Who hears all that goes over a line, byte by byte as it is handed over, whoever asked for it.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;

use super::Direction;

/// Pieces that are kept for a listener that takes none; then the newest are left out.
const MOST: usize = 65_536;

/// Bytes that went over the line.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Overheard {
    /// When they had left, or were handed over. On the line's clock.
    pub at: Instant,
    /// Which way they went.
    pub direction: Direction,
    /// What was sent at once, or handed over at once; nothing, where only time has passed.
    pub bytes: Vec<u8>,
}

/// What one listener has not taken yet.
#[derive(Debug, Default)]
pub(crate) struct Ear {
    pieces: Mutex<VecDeque<Overheard>>,
    came: Condvar,
}

impl Ear {
    pub(super) fn put(&self, piece: Overheard) {
        let mut pieces = self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        if pieces.len() < MOST {
            pieces.push_back(piece);
        }
        self.came.notify_one();
    }

    /// What has come, waiting as long as `patience` for it.
    pub(crate) fn take(&self, patience: Duration) -> VecDeque<Overheard> {
        let pieces = self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.came.wait_timeout_while(pieces, patience, |pieces| pieces.is_empty());
        let (mut pieces, _) = waited.unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *pieces)
    }
}
