//! What a test told the wire to do to the next answers, exactly so: lose, replace, delay them, put noise around them.
//!
//! What happens by chance or by script is in `faults`, and comes on top.

use std::collections::VecDeque;
use std::time::Duration;

use crate::faults::Outgoing;

/// Something that happens to a number of answers.
#[derive(Debug)]
struct Counted<T> {
    what: T,
    left: u32,
}

impl<T> Counted<T> {
    /// Takes one turn of `slot`, which is emptied with its last.
    fn take(slot: &mut Option<Self>) -> Option<T>
    where
        T: Clone,
    {
        let counted = slot.as_mut()?;
        let what = counted.what.clone();
        counted.left = counted.left.saturating_sub(1);
        if counted.left == 0 {
            *slot = None;
        }
        Some(what)
    }

    fn new(what: T, count: u32) -> Option<Self> {
        (count > 0).then_some(Self { what, left: count })
    }
}

/// The faults that wait for an answer to spoil. An answer that is dropped uses up none of the others.
#[derive(Debug, Default)]
pub(crate) struct Spoil {
    drop: u32,
    replace: VecDeque<Vec<u8>>,
    delay: Option<Counted<Duration>>,
    before: Option<Counted<Vec<u8>>>,
    after: Option<Counted<Vec<u8>>>,
}

impl Spoil {
    pub(crate) fn drop_answers(&mut self, count: u32) {
        self.drop = count;
    }

    pub(crate) fn answer_with(&mut self, bytes: &[u8]) {
        self.replace.push_back(bytes.to_vec());
    }

    pub(crate) fn delay_answers(&mut self, delay: Duration, count: u32) {
        self.delay = Counted::new(delay, count);
    }

    pub(crate) fn noise_before(&mut self, bytes: &[u8], count: u32) {
        self.before = Counted::new(bytes.to_vec(), count);
    }

    pub(crate) fn noise_after(&mut self, bytes: &[u8], count: u32) {
        self.after = Counted::new(bytes.to_vec(), count);
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether nothing becomes of an answer.
    pub(crate) fn is_idle(&self) -> bool {
        let Self { drop, replace, delay, before, after } = self;
        *drop == 0 && replace.is_empty() && delay.is_none() && before.is_none() && after.is_none()
    }

    /// What becomes of `answer`; `None` where it is lost.
    pub(crate) fn apply(&mut self, answer: &[u8]) -> Option<Outgoing> {
        if self.drop > 0 {
            self.drop -= 1;
            return None;
        }
        let mut bytes = Counted::take(&mut self.before).unwrap_or_default();
        match self.replace.pop_front() {
            Some(instead) => bytes.extend_from_slice(&instead),
            None => bytes.extend_from_slice(answer),
        }
        bytes.extend(Counted::take(&mut self.after).unwrap_or_default());
        let delay = Counted::take(&mut self.delay).unwrap_or_default();
        Some(Outgoing { bytes, delay, ..Outgoing::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(bytes: &[u8], millis: u64) -> Outgoing {
        Outgoing { bytes: bytes.to_vec(), delay: Duration::from_millis(millis), ..Outgoing::default() }
    }

    #[test]
    fn each_fault_lasts_for_its_number_of_answers() {
        let mut spoil = Spoil::default();
        spoil.noise_before(&[0x00], 2);
        spoil.noise_after(&[0xFF, 0xFF], 1);
        spoil.delay_answers(Duration::from_millis(3), 1);
        spoil.drop_answers(1);
        assert!(!spoil.is_idle());
        assert_eq!(spoil.apply(&[1]), None);
        assert_eq!(spoil.apply(&[1]), Some(sent(&[0, 1, 0xFF, 0xFF], 3)));
        assert_eq!(spoil.apply(&[1]), Some(sent(&[0, 1], 0)));
        assert!(spoil.is_idle());
        assert_eq!(spoil.apply(&[1]), Some(sent(&[1], 0)));
    }

    #[test]
    fn replacements_wait_in_line_and_are_forgotten_by_clear() {
        let mut spoil = Spoil::default();
        spoil.answer_with(&[7]);
        spoil.answer_with(&[8, 9]);
        spoil.answer_with(&[10]);
        assert_eq!(spoil.apply(&[1]), Some(sent(&[7], 0)));
        assert_eq!(spoil.apply(&[1]), Some(sent(&[8, 9], 0)));
        spoil.clear();
        assert_eq!(spoil.apply(&[1]), Some(sent(&[1], 0)));
    }
}
