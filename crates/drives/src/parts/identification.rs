//! Identification: by what a unit says it is, or by what it answers and refuses.

use crate::place::Place;

/// What an identification code says.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Identification {
    /// The word in the identification register.
    pub code: u16,
    /// The family: the name its profile has, whether or not there is one.
    pub family: String,
    /// The series, for people.
    pub title: String,
    /// What else reports this code, for people; empty for most.
    pub shared: Vec<String>,
    /// Whether a manual prints it.
    pub verified: bool,
    /// What to know about it; may be empty.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

/// What a unit of a family answers and what it refuses, read word by word.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Signature {
    /// Places that it answers.
    pub answers: Vec<Place>,
    /// Places that it refuses.
    pub refuses: Vec<Place>,
}
