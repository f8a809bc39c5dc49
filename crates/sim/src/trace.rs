//! The last transmissions on the wire, as each side sent them.

use std::collections::VecDeque;

use drivebus_rtu::Instant;

/// How many transmissions are kept.
const KEPT: usize = 1_000;

/// Who spoke.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Side {
    /// The master, or whatever is connected in its place.
    Master,
    /// One of the units.
    Unit,
}

/// One run of characters from one side.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Transmission {
    /// When its first bit came.
    pub begin: Instant,
    /// Who sent it.
    pub side: Side,
    /// What was sent; where both sides spoke at once, the other side heard something else.
    pub bytes: Vec<u8>,
}

/// A ring of the last 1000 transmissions. Those that are over are reused for those that come.
#[derive(Debug, Default)]
pub(crate) struct Trace {
    ring: VecDeque<Transmission>,
}

impl Trace {
    /// A transmission begins.
    pub(crate) fn begin(&mut self, begin: Instant, side: Side, bytes: &[u8]) {
        let oldest = if self.ring.len() == KEPT { self.ring.pop_front() } else { None };
        let mut kept = oldest.map_or_else(Vec::new, |oldest| oldest.bytes);
        kept.clear();
        kept.extend_from_slice(bytes);
        self.ring.push_back(Transmission { begin, side, bytes: kept });
    }

    /// The latest transmission of `side` goes on.
    pub(crate) fn extend(&mut self, side: Side, bytes: &[u8]) {
        if let Some(last) = self.ring.iter_mut().rev().find(|transmission| transmission.side == side) {
            last.bytes.extend_from_slice(bytes);
        }
    }

    /// All that is kept, oldest first.
    pub(crate) fn to_vec(&self) -> Vec<Transmission> {
        self.ring.iter().cloned().collect()
    }
}
