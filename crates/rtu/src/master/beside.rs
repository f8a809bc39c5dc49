//! What came beside the answer that is waited for, or in its place: noise, and a damaged or wrong answer, which is kept while
//! the right one may still follow.

use core::fmt;

use crate::UnitAddress;
use crate::answer::AnswerError;
use crate::event::Event;
use crate::expected::Expected;
use crate::frame::{Frame, FrameError, MAX_ADU};
use crate::framer::{EXCEPTION_ADU, lost_its_head};
use crate::pdu::function::EXCEPTION_BIT;

use super::remnant::may_be_left_of;

/// As much as a framer holds.
const CAPACITY: usize = 2 * MAX_ADU;

/// Why something is not the answer.
#[derive(Debug, Clone, Copy)]
pub(super) enum Why {
    Damaged(FrameError),
    Wrong(AnswerError),
}

/// All that came since the request, in its order.
#[derive(Clone)]
pub(super) struct Beside {
    bytes: [u8; CAPACITY],
    len: usize,
    /// Where the first thing begins that came in the place of the answer.
    spoilt: Option<(usize, Why)>,
    /// From here on nothing else came in between.
    in_a_row_from: usize,
}

impl Beside {
    pub(super) const NOTHING: Self = Self { bytes: [0; CAPACITY], len: 0, spoilt: None, in_a_row_from: 0 };

    pub(super) const fn clear(&mut self) {
        self.len = 0;
        self.in_a_row_from = 0;
        self.spoilt = None;
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds `bytes`, and returns what there is no room for.
    pub(super) fn add<'a>(&mut self, bytes: &'a [u8]) -> &'a [u8] {
        let (kept, rest) = bytes.split_at(bytes.len().min(CAPACITY - self.len));
        self.bytes[self.len..self.len + kept.len()].copy_from_slice(kept);
        self.len += kept.len();
        rest
    }

    /// Whether `len` bytes more can be kept.
    pub(super) const fn has_room_for(&self, len: usize) -> bool {
        len <= CAPACITY - self.len
    }

    /// Something came that is not kept here: what is added next did not come right behind what is here.
    pub(super) const fn cut(&mut self) {
        self.in_a_row_from = self.len;
    }

    /// What is added next came in the place of the answer.
    pub(super) fn spoils(&mut self, why: Why) {
        self.spoilt.get_or_insert((self.len, why));
    }

    /// Looks whether what came last is the answer of `unit` to `expected`, or a refusal, that lost its head. Without it, it
    /// looked like noise.
    #[cold]
    pub(super) fn look_for_lost_head(&mut self, unit: UnitAddress, expected: Expected) {
        let refusal = (expected.function() | EXCEPTION_BIT, EXCEPTION_ADU);
        let answer = expected.adu_len().map(|len| (expected.function(), len));
        for (function, len) in answer.into_iter().chain([refusal]) {
            let from = self.len.checked_sub(len - 1).filter(|from| *from >= self.in_a_row_from);
            let tail = from.map(|from| (from, &self.bytes[from..self.len]));
            if let Some((from, tail)) = tail.filter(|(_, tail)| lost_its_head(tail, unit, function, len)) {
                let error = Frame::parse(tail).err().unwrap_or(FrameError::TooShort { len: tail.len() });
                self.spoilt.get_or_insert((from, Why::Damaged(error)));
            }
        }
    }

    /// What came last, and in a row.
    pub(super) fn in_a_row(&self) -> &[u8] {
        &self.bytes[self.in_a_row_from..self.len]
    }

    /// What came last, and in a row, came in the place of the answer.
    pub(super) fn is_all_spoilt(&mut self, why: Why) {
        self.spoilt.get_or_insert((self.in_a_row_from, why));
    }

    /// Whether something came in the place of the answer.
    pub(super) const fn is_spoilt(&self) -> bool {
        self.spoilt.is_some()
    }

    /// What may be left of the answer: it broke off, or is damaged, and nothing else came in between.
    pub(super) fn damaged(&self) -> Option<&[u8]> {
        match self.spoilt {
            Some((from, Why::Damaged(_))) if from >= self.in_a_row_from => Some(&self.bytes[from..self.len]),
            _ => None,
        }
    }

    /// What was noise: with what came in the place of the answer, or without, where [`event`](Self::event) tells that.
    pub(super) fn noise(&self, and_spoilt: bool) -> &[u8] {
        let end = self.spoilt.filter(|_| !and_spoilt).map_or(self.len, |(from, _)| from);
        &self.bytes[..end]
    }

    /// How a request ends that got nothing better.
    pub(super) fn event(&self) -> Option<Event<'_>> {
        let (from, why) = self.spoilt?;
        let bytes = &self.bytes[from..self.len];
        Some(match why {
            Why::Damaged(error) => Event::Corrupt { error, bytes },
            Why::Wrong(error) => Event::Wrong { error, frame: bytes },
        })
    }

    /// Whether some of it may be left of `request`. A frame that is whole is not.
    pub(super) fn holds_remnant_of(&self, request: &[u8]) -> bool {
        let is_wrong = matches!(self.spoilt, Some((_, Why::Wrong(_))));
        may_be_left_of(self.noise(!is_wrong), request)
    }
}

impl fmt::Debug for Beside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Beside").field("bytes", &self.noise(true)).field("spoilt", &self.spoilt).finish_non_exhaustive()
    }
}
