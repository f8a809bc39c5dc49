//! What a PDU carries: 16-bit words, high byte first, or bits, lowest first; borrowed from wherever they are.

use core::fmt;

/// Words of a request or an answer, borrowed: from the caller as `u16`, or from a frame as bytes. A bit is a word of 0 or 1.
///
/// ```
/// use drivebus_rtu::Words;
///
/// let words = Words::from_wire(&[0x13, 0x88, 0x00, 0x32]).ok_or("an odd number of bytes")?;
/// assert_eq!(words, Words::new(&[5000, 50]));
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy)]
pub struct Words<'a>(Source<'a>);

#[derive(Clone, Copy)]
enum Source<'a> {
    Host(&'a [u16]),
    Wire(&'a [[u8; 2]]),
    Bits { bytes: &'a [u8], count: u16 },
}

impl<'a> Words<'a> {
    /// Words of the caller's.
    pub const fn new(words: &'a [u16]) -> Self {
        Self(Source::Host(words))
    }

    /// Words as they stand in a frame, high byte first; `None` where the last one has only one byte.
    pub const fn from_wire(bytes: &'a [u8]) -> Option<Self> {
        match bytes.as_chunks::<2>() {
            (pairs, []) => Some(Self(Source::Wire(pairs))),
            _ => None,
        }
    }

    /// The first `count` bits of `bytes`, the lowest of the first byte first; as many as are there.
    pub(crate) const fn from_bits(bytes: &'a [u8], count: u16) -> Self {
        let there = 8 * bytes.len();
        #[expect(clippy::cast_possible_truncation, reason = "less than `count`, which fits")]
        let count = if there < count as usize { there as u16 } else { count };
        Self(Source::Bits { bytes, count })
    }

    /// How many words.
    pub const fn len(&self) -> usize {
        match self.0 {
            Source::Host(words) => words.len(),
            Source::Wire(pairs) => pairs.len(),
            Source::Bits { count, .. } => count as usize,
        }
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The first `count` words; all, where there are fewer.
    pub(crate) fn first(&self, count: usize) -> Self {
        Self(match self.0 {
            Source::Host(words) => Source::Host(words.get(..count).unwrap_or(words)),
            Source::Wire(pairs) => Source::Wire(pairs.get(..count).unwrap_or(pairs)),
            Source::Bits { bytes, count: there } => {
                Source::Bits { bytes, count: u16::try_from(count).map_or(there, |count| count.min(there)) }
            }
        })
    }

    /// The word at `index`.
    pub fn get(&self, index: usize) -> Option<u16> {
        match self.0 {
            Source::Host(words) => words.get(index).copied(),
            Source::Wire(pairs) => pairs.get(index).map(|&pair| u16::from_be_bytes(pair)),
            Source::Bits { bytes, count } => bit(bytes, count, index),
        }
    }

    /// The words in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = u16> + Clone + use<'a> {
        let words = *self;
        (0..words.len()).map(move |index| words.get(index).unwrap_or_default())
    }

    /// Writes the words into `target`, high byte first, as many as fit.
    pub(crate) fn put(&self, target: &mut [u8]) {
        let (pairs, _) = target.as_chunks_mut::<2>();
        match self.0 {
            Source::Host(words) => pairs.iter_mut().zip(words).for_each(|(pair, word)| *pair = word.to_be_bytes()),
            Source::Wire(wire) => pairs.iter_mut().zip(wire).for_each(|(pair, word)| *pair = *word),
            Source::Bits { .. } => {
                pairs.iter_mut().zip(self.iter()).for_each(|(pair, word)| *pair = word.to_be_bytes());
            }
        }
    }

    /// Writes the words into `target` as bits, the lowest of the first byte first, as many as fit: any word but 0 is 1.
    #[cold]
    pub(crate) fn put_bits(&self, target: &mut [u8]) {
        target.fill(0);
        for (index, word) in self.iter().enumerate() {
            if let Some(byte) = target.get_mut(index / 8) {
                *byte |= u8::from(word != 0) << (index % 8);
            }
        }
    }
}

/// The bit at `index` of the first `count`. Apart, because nearly all that is read are words.
#[cold]
fn bit(bytes: &[u8], count: u16, index: usize) -> Option<u16> {
    let byte = bytes.get(index / 8).filter(|_| index < usize::from(count))?;
    Some(u16::from(byte >> (index % 8) & 1))
}

impl PartialEq for Words<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Eq for Words<'_> {}

impl fmt::Debug for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
