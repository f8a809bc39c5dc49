//! What a drive must be told before it takes any word that is written to it.

use crate::place::Place;

/// How a drive is unlocked that refuses what is written until it is.
///
/// At the same address another drive may keep a parameter, so the word goes to no unit that did not just show what it is.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Unlock {
    /// Where the word goes. It moves no motor.
    pub place: Place,
    /// What is written there.
    pub word: u16,
    /// The exception by which a drive that is locked refuses a write.
    pub exception: u8,
    /// Where a unit shows that it is one of the family, and by which word. The word goes to no other.
    pub shown_by: (Place, u16),
    /// Where it is printed.
    pub source: String,
}
