//! The threads that carry out what waits in a queue without one: how many there are, who is on the way, and when another is
//! hired. What they work for is handed in.

use std::fmt;
use std::time::Duration;

/// Most threads of one crew, but for stops, which always get one. One has the line; others stand by for units that are
/// silent, and of those there may be many.
const MOST: usize = 64;

/// Who has work for a crew.
pub(crate) trait Employer: fmt::Debug + Send {
    /// Whether it still is there; where it is not, the next who brings work takes its place.
    fn is_there(&self) -> bool;

    /// Makes a thread that works for it; whether the system gave one.
    fn hire(&self) -> bool;
}

/// The crew of one queue.
#[derive(Debug, Default)]
pub(crate) struct Crew {
    employer: Option<Box<dyn Employer>>,
    threads: usize,
    /// Threads that wait to be called.
    idle: usize,
    /// Threads that were called and have not woken up yet.
    woken: usize,
    /// Whether one is on its way to look who is next.
    called: bool,
    dismissed: bool,
}

impl Crew {
    /// How long a thread waits for more work before it ends.
    pub(crate) const PATIENCE: Duration = Duration::from_secs(10);

    /// Works for this one from here on, unless the former still is there.
    pub(crate) fn works_for(&mut self, employer: impl FnOnce() -> Box<dyn Employer>) {
        if self.employer.as_ref().is_none_or(|former| !former.is_there()) {
            self.employer = Some(employer());
        }
    }

    /// Calls somebody who looks who is next; whether one is to be woken for that.
    pub(crate) fn call(&mut self, is_stop: bool) -> bool {
        if self.called || self.dismissed {
            return false;
        }
        if self.idle > 0 {
            self.idle -= 1;
            self.woken += 1;
            self.called = true;
            return true;
        }
        if (self.threads < MOST || is_stop) && self.employer.as_ref().is_some_and(|employer| employer.hire()) {
            self.threads += 1;
            self.called = true;
        }
        false
    }

    /// Somebody looks who is next.
    pub(crate) fn has_come(&mut self) {
        self.called = false;
    }

    pub(crate) fn begins_to_wait(&mut self) {
        self.idle += 1;
    }

    pub(crate) fn ends_to_wait(&mut self) {
        if self.woken > 0 {
            self.woken -= 1;
        } else {
            self.idle = self.idle.saturating_sub(1);
        }
    }

    pub(crate) fn has_left(&mut self) {
        self.threads = self.threads.saturating_sub(1);
        self.called = false;
    }

    /// Whether nobody is there, because no thread could be made.
    pub(crate) fn is_empty(&self) -> bool {
        self.threads == 0
    }

    pub(crate) fn dismiss(&mut self) {
        self.dismissed = true;
    }

    pub(crate) fn is_dismissed(&self) -> bool {
        self.dismissed
    }
}
