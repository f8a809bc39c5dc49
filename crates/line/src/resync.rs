//! The way back after a request was left open: which word to echo, and what to do about units that do not echo.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

use drivebus_rtu::{Instant, UnitAddress};

/// How long a unit that never answered an echo may owe an answer. After that it is taken as never to come.
///
/// All drives known here document the echo (08H/0000), so this is for other devices on the line, which are silent on it.
/// What is assumed of them: an answer comes within this time or never.
const PATIENCE: Duration = Duration::from_secs(3);

/// Words for probes and echoes.
#[derive(Debug)]
pub(crate) struct FreshWords(AtomicU16);

impl FreshWords {
    /// An odd step reaches every word before one comes again, so that 65 535 echoes may still be open.
    const STEP: u16 = 0x9E35;

    pub(crate) fn new() -> Self {
        // Where the words begin is random: another program on this line must not use the same ones.
        let [a, b, ..] = RandomState::new().build_hasher().finish().to_le_bytes();
        Self(AtomicU16::new(u16::from_le_bytes([a, b])))
    }

    /// A word that no open echo carries.
    pub(crate) fn next(&self) -> u16 {
        self.0.fetch_add(Self::STEP, Ordering::Relaxed)
    }
}

/// What is known of the units that were probed.
#[derive(Debug, Default)]
pub(crate) struct Resync {
    echoed: BTreeSet<UnitAddress>,
    /// When the latest request went out that a unit left open.
    open: BTreeMap<UnitAddress, Instant>,
}

impl Resync {
    /// `unit` answered an echo, with the word or with a refusal.
    pub(crate) fn answered(&mut self, unit: UnitAddress) {
        self.echoed.insert(unit);
        self.open.remove(&unit);
    }

    /// `unit` did not answer a request that went out at `sent`.
    pub(crate) fn left_open(&mut self, unit: UnitAddress, sent: Instant) {
        self.open.insert(unit, sent);
    }

    /// Whether `unit`, which is silent on an echo at `now`, is one that does not know 08H and owes nothing any more.
    pub(crate) fn is_given_up(&self, unit: UnitAddress, now: Instant) -> bool {
        let since = self.open.get(&unit).copied().unwrap_or(Instant::ZERO);
        !self.echoed.contains(&unit) && now.saturating_duration_since(since) >= PATIENCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_word_comes_twice_before_all_have_come() {
        let fresh = FreshWords::new();
        let words: BTreeSet<u16> = (0..=u16::MAX).map(|_| fresh.next()).collect();
        assert_eq!(words.len(), 65_536);
    }
}
