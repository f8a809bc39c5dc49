//! A request that was heard, and what can be its answer.

use crate::Instant;
use crate::frame::{Adu, Frame};
use crate::functions::FrameLength;
use crate::pdu::function::EXCEPTION_BIT;
use crate::request::Request;

/// What a unit has said to a request so far that was not its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Spoken {
    Nothing,
    /// What was not understood: no late answer will come.
    Something,
    /// What looks like the answer, damaged: no other will come.
    Badly,
}

/// A request that was heard.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    adu: Adu,
    /// When it had come.
    pub(super) ended: Instant,
    /// Whether its answer may still come.
    pub(super) is_open: bool,
    /// When something came that may have been its answer, or the same request once more.
    pub(super) doubted: Option<Instant>,
    /// What its unit has said since.
    pub(super) spoken: Spoken,
    /// Whether the same was asked before and not surely answered, so that more than one answer may still come.
    pub(super) is_repeat: bool,
}

impl Asked {
    pub(super) fn new(frame: &[u8], ended: Instant) -> Self {
        // Nobody answers what all are told.
        let is_open = frame[0] != 0;
        Self {
            adu: Adu::copy_of(&Frame::found(frame)),
            ended,
            is_open,
            doubted: None,
            spoken: Spoken::Nothing,
            is_repeat: false,
        }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.adu.as_bytes()
    }

    /// Whether the unit has spoken since.
    pub(super) fn has_spoken(&self) -> bool {
        self.spoken > Spoken::Nothing
    }

    /// Whether `frame` can be the answer.
    pub(super) fn is_answered_by(&self, frame: &[u8]) -> bool {
        is_pair(self.bytes(), frame)
    }

    /// Whether `bytes`, which are not a frame, look like a damaged answer.
    pub(super) fn is_answered_badly_by(&self, bytes: &[u8]) -> bool {
        let [unit, function, ..] = *self.bytes() else { return false };
        bytes.windows(2).any(|pair| pair[0] == unit && pair[1] & !EXCEPTION_BIT == function)
    }

    /// Whether a unit's answer, of whichever unit, would not look like `frame`, which a master may have sent.
    pub(super) fn is_followed_by(&self, frame: &[u8]) -> bool {
        can_ask(frame) && !may_be_answer(frame) && !self.is_answered_by(frame)
    }

    /// How long the answer is, if `here` begins as it.
    pub(super) fn answer_len(&self, here: &[u8]) -> FrameLength {
        let asked = self.bytes();
        match *here {
            [unit, function, ..] if unit == asked[0] && function == asked[1] && self.fits(here) => {
                FrameLength::of_answer(here)
            }
            _ => FrameLength::Never,
        }
    }

    /// Whether the answer that begins with `here` has as many bytes as are asked for.
    fn fits(&self, here: &[u8]) -> bool {
        let asked = self.bytes();
        let count = || usize::from(u16::from_be_bytes([asked[4], asked[5]]));
        match *here {
            [_, 0x01 | 0x02, bytes, ..] => usize::from(bytes) == count().div_ceil(8),
            [_, 0x03 | 0x04 | 0x17, bytes, ..] => usize::from(bytes) == 2 * count(),
            [_, 0x01..=0x04 | 0x17] => false,
            _ => true,
        }
    }
}

/// Whether `answer` can be the answer to `request`.
pub(super) fn is_pair(request: &[u8], answer: &[u8]) -> bool {
    request[0] == answer[0]
        && request[0] != 0
        && Request::parse(pdu(request)).is_ok_and(|asked| asked.judge(pdu(answer)).is_ok())
}

/// Whether a master may have sent `frame`.
pub(crate) fn can_ask(frame: &[u8]) -> bool {
    match FrameLength::of_request(frame) {
        FrameLength::Is(len) => len == frame.len() && Request::parse(pdu(frame)).is_ok(),
        FrameLength::Unknown => true,
        FrameLength::Later | FrameLength::Never | FrameLength::TooLong => false,
    }
}

/// Whether a unit may have sent `frame`.
pub(crate) fn may_be_answer(frame: &[u8]) -> bool {
    match FrameLength::of_answer(frame) {
        FrameLength::Is(len) => len == frame.len(),
        FrameLength::Unknown => true,
        FrameLength::Later | FrameLength::Never | FrameLength::TooLong => false,
    }
}

fn pdu(frame: &[u8]) -> &[u8] {
    Frame::found(frame).pdu()
}
