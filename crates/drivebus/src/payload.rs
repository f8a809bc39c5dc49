//! What a write carries: one word, or several.

use std::borrow::Cow;

/// What a write carries. A word is written by 06H, a sequence of words by 10H, also where it has one only.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Payload<'a> {
    /// One word.
    Word(u16),
    /// 1 to 123 words.
    Words(Cow<'a, [u16]>),
}

impl From<u16> for Payload<'_> {
    fn from(word: u16) -> Self {
        Self::Word(word)
    }
}

impl<'a> From<&'a [u16]> for Payload<'a> {
    fn from(words: &'a [u16]) -> Self {
        Self::Words(Cow::Borrowed(words))
    }
}

impl<'a, const N: usize> From<&'a [u16; N]> for Payload<'a> {
    fn from(words: &'a [u16; N]) -> Self {
        Self::Words(Cow::Borrowed(words))
    }
}

impl<const N: usize> From<[u16; N]> for Payload<'_> {
    fn from(words: [u16; N]) -> Self {
        Self::Words(Cow::Owned(words.to_vec()))
    }
}

impl From<Vec<u16>> for Payload<'_> {
    fn from(words: Vec<u16>) -> Self {
        Self::Words(Cow::Owned(words))
    }
}
