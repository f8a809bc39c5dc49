//! The kinds of line that a machine has, and the text by which people name one of them.

pub mod url;
