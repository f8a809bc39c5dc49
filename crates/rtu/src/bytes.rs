//! Bytes that came and are none of an answer, kept for whoever is told of them.

use core::fmt;

use crate::frame::MAX_ADU;

/// As much as a framer holds.
const CAPACITY: usize = 2 * MAX_ADU;

/// The bytes, as many as there is room for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Bytes {
    bytes: [u8; CAPACITY],
    len: usize,
}

impl Bytes {
    pub(crate) const NONE: Self = Self { bytes: [0; CAPACITY], len: 0 };

    pub(crate) fn set(&mut self, bytes: &[u8]) {
        self.clear();
        self.add(bytes);
    }

    #[cold]
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        let count = bytes.len().min(CAPACITY - self.len);
        self.bytes[self.len..self.len + count].copy_from_slice(&bytes[..count]);
        self.len += count;
    }

    pub(crate) const fn clear(&mut self) {
        self.len = 0;
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Bytes({:02X?})", self.as_slice())
    }
}
