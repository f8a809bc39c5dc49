//! The way back after a request was left open: which word to echo, and which units are known to echo at all.

use std::collections::BTreeSet;
use std::hash::{BuildHasher, Hasher, RandomState};

use drivebus_rtu::UnitAddress;

/// Words for probes, and what is known of the units that were probed.
#[derive(Debug)]
pub(crate) struct Resync {
    word: u16,
    echoed: BTreeSet<UnitAddress>,
}

impl Resync {
    /// An odd step reaches every word before one comes again, so that 65 535 echoes may still be open.
    const STEP: u16 = 0x9E35;

    pub(crate) fn new() -> Self {
        // Where the words begin is random: another program on this line must not use the same ones.
        let [a, b, ..] = RandomState::new().build_hasher().finish().to_le_bytes();
        Self { word: u16::from_le_bytes([a, b]), echoed: BTreeSet::new() }
    }

    /// A word that no open echo carries.
    pub(crate) fn fresh_word(&mut self) -> u16 {
        self.word = self.word.wrapping_add(Self::STEP);
        self.word
    }

    /// `unit` answered an echo, with the word or with a refusal.
    pub(crate) fn answered(&mut self, unit: UnitAddress) {
        self.echoed.insert(unit);
    }

    /// Whether silence of `unit` on an echo may mean that it does not know 08H, rather than that it is not there.
    pub(crate) fn may_not_echo(&self, unit: UnitAddress) -> bool {
        !self.echoed.contains(&unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_word_comes_twice_before_all_have_come() {
        let mut resync = Resync::new();
        let words: BTreeSet<u16> = (0..=u16::MAX).map(|_| resync.fresh_word()).collect();
        assert_eq!(words.len(), 65_536);
    }
}
