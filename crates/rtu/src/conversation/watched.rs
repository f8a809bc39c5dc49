//! What is remembered of one unit where other masters may ask it, too.

use core::time::Duration;

use super::longer_reads::{Shape, shape};
use crate::{Instant, Request};

/// Of so many shapes it is remembered that nobody else asks for them; what is forgotten is found out again.
const PROVEN: usize = 32;

/// What is remembered of one unit for telling its answers apart.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Watched {
    /// What it was asked last, and until when an answer to that may still come which was not taken.
    last: Option<(Shape, Instant)>,
    /// A read of it was proven since the line was opened.
    met: bool,
    /// What was found to be asked by nobody else, while somebody was there.
    proven: [Option<Shape>; PROVEN],
    /// How many were proven, which says where the next is kept.
    next: u8,
}

impl Watched {
    /// At `now` `request` is over, which was waited for so long; whether it was refused.
    #[cold]
    pub(super) fn asked(&mut self, now: Instant, request: &Request<'_>, timeout: Duration, refused: bool) {
        self.last = Some((shape(request), now + timeout));
        self.met |= refused && matches!(request, Request::Read { .. });
    }

    /// Whether it was read since the line was opened, and that was proven or refused.
    pub(super) const fn has_met(&self) -> bool {
        self.met
    }

    /// A read of it was proven.
    pub(super) const fn meets(&mut self) {
        self.met = true;
    }

    /// Nobody else is there any more.
    pub(super) const fn forgets_what_was_proven(&mut self) {
        self.proven = [None; PROVEN];
    }

    /// Whether the answer to what it was asked before could come for that to `shape`.
    pub(super) fn may_be_behind(&self, now: Instant, shape: Shape) -> bool {
        self.last.is_some_and(|(last, until)| last == shape && now < until)
    }

    pub(super) fn is_proven(&self, shape: Shape) -> bool {
        self.proven.contains(&Some(shape))
    }

    pub(super) fn proves(&mut self, shape: Shape) {
        if !self.is_proven(shape) {
            self.proven[usize::from(self.next) % PROVEN] = Some(shape);
            self.next = self.next.wrapping_add(1);
        }
    }
}
