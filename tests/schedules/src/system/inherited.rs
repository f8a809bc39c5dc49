//! Nobody forks here.

use std::ops::Deref;

#[derive(Debug)]
pub(crate) struct Kept<T>(T);

impl<T> Kept<T> {
    pub(crate) fn new(kept: T) -> Self {
        Self(kept)
    }
}

impl<T> Deref for Kept<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}
