//! When the same answer has come often enough to be believed.
//!
//! Of *n* answers to *n* equal requests at most *k* are late ones, if at most *k* are open. So *k* + 1 equal answers hold at
//! least one that was given to the question, whatever came between them, and they say the same as it.

use crate::doubt::Attribution;
use crate::{Adu, Answer, UnitAddress};

/// Counts equal answers to one read that is asked again and again.
///
/// ```
/// use drivebus_rtu::{Agreement, Answer, Attribution, UnitAddress};
///
/// let mut agreement = Agreement::new(Attribution::Certain, 2); // asked twice to be sure
/// assert!(!agreement.hear(UnitAddress::MIN, &Answer::read(&[3])?));
/// assert!(!agreement.hear(UnitAddress::MIN, &Answer::read(&[4])?));
/// assert!(agreement.hear(UnitAddress::MIN, &Answer::read(&[4])?));
/// # Ok::<(), drivebus_rtu::RequestError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Agreement {
    words: u8,
    refusal: u8,
    /// How often words have to come in a row.
    at_least: u8,
    heard: u8,
    in_a_row: u8,
    latest: Heard,
    /// Of those before it that are another one, what was heard last or came more often.
    other: Heard,
}

/// An answer, and how often it came.
#[derive(Debug, Clone)]
struct Heard {
    frame: Adu,
    times: u8,
}

impl Agreement {
    /// As often as `attribution` asks for, and words at least `at_least` times in a row.
    ///
    /// [`Attribution::Wait`] and [`Attribution::Others`] count as certain: it is for the caller to wait, or to ask otherwise.
    pub fn new(attribution: Attribution, at_least: u8) -> Self {
        let (words, refusal) = match attribution {
            Attribution::Repeat { words, refusal } => (words, refusal),
            Attribution::Certain | Attribution::Wait(_) | Attribution::Others(_) => (1, 1),
        };
        let nothing = Heard { frame: Adu::new(), times: 0 };
        Self {
            words: words.max(at_least),
            refusal,
            at_least,
            heard: 0,
            in_a_row: 0,
            latest: nothing.clone(),
            other: nothing,
        }
    }

    /// Whether one answer is enough.
    pub const fn is_immediate(&self) -> bool {
        self.words <= 1 && self.refusal <= 1
    }

    /// After so many answers a unit whose words do not change must have been agreed with, where the late ones are alike.
    pub const fn longest(&self) -> u8 {
        let times = if self.words > self.refusal { self.words } else { self.refusal };
        times.saturating_mul(if self.at_least > 2 { self.at_least } else { 2 })
    }

    /// Whether a unit whose words do not change would have been agreed with by now: see [`longest`](Self::longest).
    pub const fn is_in_vain(&self) -> bool {
        self.heard >= self.longest()
    }

    /// Whether one answer was another than one before it.
    pub(crate) const fn was_contradicted(&self) -> bool {
        self.other.times > 0
    }

    /// Hears the next answer; true when it has come often enough.
    pub fn hear(&mut self, unit: UnitAddress, answer: &Answer<'_>) -> bool {
        let came = Adu::answer(unit, answer);
        self.heard = self.heard.saturating_add(1);
        self.in_a_row = if came == self.latest.frame { self.in_a_row.saturating_add(1) } else { 1 };
        if came != self.latest.frame {
            if came == self.other.frame || self.latest.times >= self.other.times {
                core::mem::swap(&mut self.latest, &mut self.other);
            }
            if came != self.latest.frame {
                self.latest = Heard { frame: came, times: 0 };
            }
        }
        self.latest.times = self.latest.times.saturating_add(1);
        let (needed, at_least) = match answer {
            Answer::Exception { .. } => (self.refusal, 1),
            _ => (self.words, self.at_least),
        };
        self.latest.times >= needed && self.in_a_row >= at_least
    }
}
