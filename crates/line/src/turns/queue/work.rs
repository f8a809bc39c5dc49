//! Work that waits in the queue without a thread, in the same order as everybody: it is left there, taken back, and carried
//! out by one of the crew when its turn comes.

use crate::system::sync::{MutexGuard, PoisonError, thread};
use crate::turns::crew::{Crew, Employer};
use crate::turns::order::{Claim, Ticket};
use crate::turns::queue::{NoTurn, Queue, State, Turn, Waiter};

impl<W> Queue<W> {
    /// Leaves `work` in the queue, to be done when its turn comes; gives it back where nothing is taken any more, or too
    /// much waits. The crew works for `employer`, if it has no other.
    pub(crate) fn leave_work(
        &self,
        claim: Claim,
        work: W,
        employer: impl FnOnce() -> Box<dyn Employer>,
    ) -> Result<Ticket, (W, NoTurn)> {
        let mut state = self.lock();
        if state.crew.is_dismissed() {
            return Err((work, NoTurn::GivenUp));
        }
        if state.is_full_for(claim.priority, self.room) {
            return Err((work, NoTurn::Full));
        }
        state.crew.works_for(employer);
        let ticket = state.order.ticket(claim);
        state.wait(ticket, Waiter::Work(work));
        self.call_next(state);
        Ok(ticket)
    }

    /// Takes work back whose turn has not come.
    pub(crate) fn take_back(&self, ticket: Ticket) -> Option<W> {
        let mut state = self.lock();
        let waiter = state.leave(ticket);
        self.call_next(state);
        waiter.and_then(Waiter::into_work)
    }

    /// Ends the crew, and gives back the work that waits. None is taken from here on.
    pub(crate) fn dismiss(&self) -> Vec<W> {
        let mut state = self.lock();
        state.crew.dismiss();
        self.called.notify_all();
        state
            .order
            .dismiss(|waiter| matches!(waiter, Waiter::Work(_)))
            .into_iter()
            .filter_map(Waiter::into_work)
            .collect()
    }

    /// For one of the crew: waits for work whose turn has come. `None` when it is no longer needed.
    fn next_work(&self) -> Option<(Turn<'_, W>, W)> {
        let mut state = self.lock();
        let mut waited = false;
        loop {
            state.crew.has_come();
            if let Some((ticket, work)) = state.take_work() {
                return Some((Turn { queue: self, ticket }, work));
            }
            if state.crew.is_dismissed() || (waited && !state.has_work()) {
                return None;
            }
            state.crew.begins_to_wait();
            let (woken, timeout) =
                self.called.wait_timeout(state, Crew::PATIENCE).unwrap_or_else(PoisonError::into_inner);
            state = woken;
            state.crew.ends_to_wait();
            waited = timeout.timed_out();
        }
    }

    /// For one of the crew, from its beginning to its end: carries out what is next, until nothing comes for a while or the
    /// crew is dismissed.
    pub(crate) fn serve(&self, mut carry_out: impl FnMut(Turn<'_, W>, W)) {
        let _member = Member(self);
        while let Some((turn, work)) = self.next_work() {
            carry_out(turn, work);
        }
    }

    /// Calls one of the crew to the work that is next.
    pub(super) fn call_crew(&self, mut state: MutexGuard<'_, State<W>>) {
        let is_stop = state.order.next_ticket().is_some_and(|ticket| ticket.is_stop());
        if state.crew.call(is_stop) {
            self.called.notify_one();
        }
        if state.crew.is_empty() {
            // The system gives no thread: who waits is told so, instead of waiting for ever.
            let refused = state.order.dismiss(|waiter| matches!(waiter, Waiter::Work(_)));
            if let Some(Waiter::Thread(thread)) = state.order.next() {
                thread.unpark();
            }
            // Who is told may want the queue, and may take long.
            drop(state);
            drop(refused);
        }
    }
}

/// Leaves the crew however its thread ends.
struct Member<'a, W>(&'a Queue<W>);

impl<W> Drop for Member<'_, W> {
    /// Whoever is next may have counted on it.
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.crew.has_left();
        self.0.call_next(state);
    }
}

impl<W> State<W> {
    /// Takes the line for the next one, if it is free and that one is work.
    fn take_work(&mut self) -> Option<(Ticket, W)> {
        if self.owner.is_some() || !matches!(self.order.next(), Some(Waiter::Work(_))) {
            return None;
        }
        let ticket = self.order.next_ticket()?;
        let work = self.order.take(ticket)?.into_work()?;
        self.owner = Some((ticket, thread::current()));
        Some((ticket, work))
    }
}
