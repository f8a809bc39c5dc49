//! When the same answer has come often enough to be believed.
//!
//! Of *n* answers to *n* equal requests at most *k* are late ones, if at most *k* are open. So *k* + 1 equal answers in a
//! row hold at least one that was given to the question, and they say the same as it.

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
    heard: u8,
    last: Adu,
}

impl Agreement {
    /// As often as `attribution` asks for, and words at least `at_least` times.
    ///
    /// [`Attribution::Wait`] and [`Attribution::Others`] count as certain: it is for the caller to wait, or to ask otherwise.
    pub fn new(attribution: Attribution, at_least: u8) -> Self {
        let (words, refusal) = match attribution {
            Attribution::Repeat { words, refusal } => (words, refusal),
            Attribution::Certain | Attribution::Wait(_) | Attribution::Others(_) => (1, 1),
        };
        Self { words: words.max(at_least), refusal, heard: 0, last: Adu::new() }
    }

    /// Whether one answer is enough.
    pub const fn is_immediate(&self) -> bool {
        self.words <= 1 && self.refusal <= 1
    }

    /// The longest sequence of answers after which a unit whose words do not change must have been agreed with, where another
    /// answer interrupts it once.
    pub const fn longest(&self) -> u8 {
        let times = if self.words > self.refusal { self.words } else { self.refusal };
        times.saturating_mul(2)
    }

    /// Hears the next answer; true when it has come often enough in a row.
    pub fn hear(&mut self, unit: UnitAddress, answer: &Answer<'_>) -> bool {
        let came = Adu::answer(unit, answer);
        self.heard = if came == self.last { self.heard.saturating_add(1) } else { 1 };
        self.last = came;
        let needed = if matches!(answer, Answer::Exception { .. }) { self.refusal } else { self.words };
        self.heard >= needed
    }
}
