//! The first bytes of a request or an answer, of which one may have to repeat the other's.

use core::fmt;

/// Bytes of a request after its function code that an answer can be held to repeat.
pub(crate) const MOST: usize = 6;

/// The first bytes after the function code, as they stand in a request or an answer. Displays as hex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Head {
    bytes: [u8; MOST],
    len: u8,
}

impl Head {
    /// No bytes.
    pub(crate) const NONE: Self = Self { bytes: [0; MOST], len: 0 };

    /// The first `len` of `bytes`, or as many as can be kept.
    pub(crate) fn of(bytes: &[u8], len: usize) -> Self {
        let mut head = Self::default();
        for (slot, &byte) in head.bytes.iter_mut().zip(bytes.iter().take(len)) {
            *slot = byte;
            head.len += 1;
        }
        head
    }

    /// How many there are.
    pub(crate) const fn len(self) -> usize {
        self.len as usize
    }

    fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }
}

impl fmt::Display for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.as_bytes().iter().enumerate() {
            let space = if index == 0 { "" } else { " " };
            write!(f, "{space}{byte:02X}")?;
        }
        Ok(())
    }
}
