//! What came in the place of the answer: kept while the right one may still follow.

use crate::answer::AnswerError;
use crate::event::Event;
use crate::frame::{FrameError, MAX_ADU};

/// As much as a framer hands out at once.
const CAPACITY: usize = 2 * MAX_ADU;

/// Why it is not the answer.
#[derive(Debug, Clone, Copy)]
pub(super) enum Why {
    Damaged(FrameError),
    Wrong(AnswerError),
}

/// The first thing that came in the place of the answer, if anything did.
#[derive(Debug, Clone)]
pub(super) struct Spoilt {
    why: Option<Why>,
    bytes: [u8; CAPACITY],
    len: usize,
}

impl Spoilt {
    pub(super) const NOTHING: Self = Self { why: None, bytes: [0; CAPACITY], len: 0 };

    /// Keeps `bytes`, unless something came before them.
    pub(super) fn keep(&mut self, why: Why, bytes: &[u8]) {
        if self.why.is_none() {
            let len = bytes.len().min(CAPACITY);
            self.why = Some(why);
            self.bytes[..len].copy_from_slice(&bytes[..len]);
            self.len = len;
        }
    }

    pub(super) const fn clear(&mut self) {
        self.why = None;
        self.len = 0;
    }

    pub(super) const fn is_some(&self) -> bool {
        self.why.is_some()
    }

    /// The bytes kept.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    /// How a request ends that got nothing better.
    pub(super) fn event(&self) -> Option<Event<'_>> {
        Some(match self.why? {
            Why::Damaged(error) => Event::Corrupt { error, bytes: self.bytes() },
            Why::Wrong(error) => Event::Wrong { error, frame: self.bytes() },
        })
    }
}
