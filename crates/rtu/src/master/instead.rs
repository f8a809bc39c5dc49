//! What came while an answer was waited for and is none, in its order: whoever gets no answer is told of it.

use core::fmt;

use crate::frame::MAX_ADU;

/// As much as a framer holds.
const CAPACITY: usize = 2 * MAX_ADU;

/// The bytes, as many as there is room for.
#[derive(Clone)]
pub(super) struct Instead {
    bytes: [u8; CAPACITY],
    len: usize,
}

impl Instead {
    pub(super) const NOTHING: Self = Self { bytes: [0; CAPACITY], len: 0 };

    pub(super) const fn clear(&mut self) {
        self.len = 0;
    }

    #[cold]
    pub(super) fn add(&mut self, bytes: &[u8]) {
        let count = bytes.len().min(CAPACITY - self.len);
        self.bytes[self.len..self.len + count].copy_from_slice(&bytes[..count]);
        self.len += count;
    }

    pub(super) fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl fmt::Debug for Instead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Instead").field(&self.as_slice()).finish()
    }
}
