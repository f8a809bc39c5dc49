//! Who said a frame, as far as it can be told.

use crate::frame::FrameError;

/// Who said a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
