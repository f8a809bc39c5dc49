//! Problems: all that is wrong with the files of a profile, collected, so that nobody has to mend one to see the next.

use super::{File, ProfileError};

/// Most problems that are noted: nobody reads more at once, and to find the closest name takes its time.
pub(super) const MOST: usize = 100;

/// What was found so far.
#[derive(Debug, Default)]
pub(super) struct Problems(Vec<ProfileError>);

impl Problems {
    /// What `result` holds; its error is noted.
    pub(super) fn keep<T>(&mut self, result: Result<T, ProfileError>) -> Option<T> {
        result.map_err(|error| self.push(error)).ok()
    }

    /// Notes what is wrong with a line of `file`.
    pub(super) fn add(&mut self, file: &File, line: u64, reason: impl Into<String>) {
        self.push(file.broken(line, reason));
    }

    fn push(&mut self, problem: ProfileError) {
        if !self.is_full() {
            self.0.push(problem);
        }
    }

    /// No more are noted.
    pub(super) fn is_full(&self) -> bool {
        self.0.len() >= MOST
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All of them, as far as they can be told apart, by file and line.
    pub(super) fn into_all(mut self) -> Vec<ProfileError> {
        self.0.sort_by_key(ProfileError::place);
        let mut seen = Vec::new();
        self.0.retain(|problem| {
            let new = !seen.contains(problem);
            seen.push(problem.clone());
            new
        });
        self.0
    }
}
