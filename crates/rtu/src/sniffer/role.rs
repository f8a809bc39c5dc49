//! Who said a frame, as far as it can be told.

use crate::frame::FrameError;

/// Who said a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Role {
    /// A master asks.
    Request,
    /// The unit answers the request that was handed out last.
    Answer,
    /// A unit answers a request before the last one, which had stayed without an answer.
    Late,
    /// The open request once more, or an answer to it or to one before: what was heard does not tell.
    Doubtful,
    /// An answer to nothing that was heard.
    Stray,
    /// Bytes that belong to no frame, and why.
    Noise(FrameError),
}

impl Role {
    /// As programs write it: `request`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Request => "request",
            Self::Answer => "answer",
            Self::Late => "late",
            Self::Doubtful => "doubtful",
            Self::Stray => "stray",
            Self::Noise(_) => "noise",
        }
    }
}
