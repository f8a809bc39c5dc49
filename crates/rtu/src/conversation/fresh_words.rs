//! Words for probes and echoes.

use core::sync::atomic::{AtomicU16, Ordering};

/// Words that no echo still under way carries.
///
/// All who ask on one line take theirs from the same: what a program echoes by itself, and what a conversation sends to
/// see that a unit has caught up.
#[derive(Debug)]
pub struct FreshWords(AtomicU16);

impl FreshWords {
    /// An odd step reaches every word before one comes again, so that 65 535 echoes may still be open.
    const STEP: u16 = 0x9E35;

    /// Begins at `word`. It should be random: another program on this line must not use the same ones.
    pub const fn beginning_at(word: u16) -> Self {
        Self(AtomicU16::new(word))
    }

    /// Begins anew at `word`. Nothing was asked yet.
    pub fn begin_at(&self, word: u16) {
        self.0.store(word, Ordering::Relaxed);
    }

    /// Whether `word` is the one that was given out last, so that only the echo that it was meant for carries it.
    pub(super) fn is_latest(&self, word: u16) -> bool {
        self.0.load(Ordering::Relaxed) == word.wrapping_add(Self::STEP)
    }

    /// A word that no open echo carries.
    pub fn next(&self) -> u16 {
        #[cfg(target_has_atomic = "16")]
        return self.0.fetch_add(Self::STEP, Ordering::Relaxed);
        // One core, and no interrupt that echoes.
        #[cfg(not(target_has_atomic = "16"))]
        {
            let word = self.0.load(Ordering::Relaxed);
            self.0.store(word.wrapping_add(Self::STEP), Ordering::Relaxed);
            word
        }
    }
}
