//! Whether the line goes from hand to hand, for who waits for it in another program: a thread that hangs with it is told.

use std::time::Duration;

use drivebus_rtu::Instant;

use crate::system::clock::monotonic;
use crate::system::sync::atomic::Ordering;
use crate::turns::order::Ticket;
use crate::turns::queue::Queue;

impl<W> Queue<W> {
    /// What tells whether the line still goes from hand to hand.
    pub(crate) fn watch(&self) -> Watching<'_, W> {
        Watching { queue: self, seen: None }
    }
}

/// Whether the line goes from hand to hand, for who waits for it.
pub(crate) struct Watching<'a, W> {
    queue: &'a Queue<W>,
    /// Whose turn it was when this was asked last, and since when it was.
    seen: Option<(Ticket, Instant)>,
}

impl<W> Watching<'_, W> {
    /// Whether the same one has had the line for so `long` and did not say that it goes on, asked again and again.
    pub(crate) fn sees_nothing_move_for(&mut self, long: Duration) -> bool {
        let has_it = self.queue.lock().owner.as_ref().map(|(ticket, _)| *ticket);
        let now = monotonic();
        let Some(ticket) = has_it else {
            self.seen = None;
            return false;
        };
        let (_, since) = *self.seen.get_or_insert((ticket, now));
        if self.seen.is_some_and(|(seen, _)| seen != ticket) {
            self.seen = Some((ticket, now));
            return false;
        }
        let sign = Instant::from_nanos(self.queue.goes_on.load(Ordering::Relaxed));
        now.saturating_duration_since(since.max(sign)) >= long
    }
}
