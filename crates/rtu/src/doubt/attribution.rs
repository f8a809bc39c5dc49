//! How sure the answer to a request can be, by what its unit may answer besides.

use super::Doubts;
use crate::expected::Expected;
use crate::{Instant, UnitAddress};

/// So many answers that could pass for one are always outvoted, and [`MAX_RIVALS`] at most; of more, the end is waited for.
const MIN_RIVALS: u8 = 3;

/// The same, of short answers.
const MAX_RIVALS: u8 = 9;

/// Where an answer is to come so often that it has more bytes than this in all, waiting is quicker: on a line that damages them
/// the long ones seldom come whole.
const OUTVOTING: usize = 400;

/// How sure the answer to a request can be, before it is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Attribution {
    /// What the master takes for the answer is the answer.
    Certain,
    /// Open answers could pass for it: a read has to bring the same words `words` times, or the same refusal
    /// `refusal` times, so that at least one of them is the answer. A read of another length may need less.
    Repeat {
        /// Times for the words read; 1 where no open answer could pass for them.
        words: u8,
        /// Times for a refusal.
        refusal: u8,
    },
    /// Open answers could pass for it, and repeating does not help: ask at this moment or later.
    Wait(Instant),
    /// Another master asks the same of the unit, as long as until this moment if nothing more is heard of it. Only another
    /// length helps.
    Others(Instant),
}

impl Attribution {
    /// Whether the words of an open answer could be taken for those of the answer.
    #[must_use]
    pub const fn may_be_mistaken(self) -> bool {
        match self {
            Self::Certain => false,
            Self::Repeat { words, .. } => words > 1,
            Self::Wait(_) | Self::Others(_) => true,
        }
    }
}

impl Doubts {
    /// How sure the answer of `unit` to `expected` can be, asked at `now`.
    pub(crate) fn attribution(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Attribution {
        if expected.is_echo() {
            return Attribution::Certain;
        }
        if self.has_forgotten(now, unit) {
            return Attribution::Wait(self.forgotten_until);
        }
        let (mut words, mut refusal) = (1_u8, 1_u8);
        for open in self.of(unit).filter(|open| !open.is_past(now)) {
            if self.could_pass(open, expected) {
                words = words.saturating_add(open.count);
            }
            if open.expected.function() == expected.function() {
                refusal = refusal.saturating_add(open.count);
            }
        }
        // What took the place of another, and that other, are both listed; of the two one is open.
        let most = self.owed(unit).max(1).saturating_add(1);
        let (words, refusal) = (words.min(most), refusal.min(most));
        match self.rivals_end(now, unit, expected) {
            None => Attribution::Certain,
            // What refuses another is told by the master as that.
            Some(_) if !expected.is_read() && words == 1 => Attribution::Certain,
            Some(latest) if !expected.is_read() => Attribution::Wait(latest),
            Some(latest) if words > 1 + most_rivals(expected) => {
                Attribution::Wait(self.none_come_again(now, unit, expected).unwrap_or(latest))
            }
            Some(_) => Attribution::Repeat { words, refusal },
        }
    }

    /// When the last is past, as far as is known at `now`, of what could pass for the answer of `unit` to `expected`, or refuse it.
    pub(crate) fn rivals_end(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Option<Instant> {
        let rivals = self.of(unit).filter(|open| !open.is_past(now) && open.expected.function() == expected.function());
        rivals.map(|open| open.last + open.window).max()
    }

    /// When no answer that came damaged may come again and pass for that of `unit` to `expected`, if those that are left then can
    /// be outvoted.
    fn none_come_again(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Option<Instant> {
        let rivals = || self.of(unit).filter(|open| !open.is_past(now) && self.could_pass(open, expected));
        let others = rivals().filter(|open| !open.again).fold(0_u8, |count, open| count.saturating_add(open.count));
        let ends = rivals().filter(|open| open.again).map(|open| open.last + open.window);
        ends.max().filter(|_| others <= most_rivals(expected))
    }
}

/// How many answers that could pass for that to `expected` are outvoted.
fn most_rivals(expected: Expected) -> u8 {
    let times = expected.adu_len().and_then(|len| OUTVOTING.checked_div(len)).unwrap_or(0);
    u8::try_from(times.saturating_sub(1)).unwrap_or(MAX_RIVALS).clamp(MIN_RIVALS, MAX_RIVALS)
}
