//! Work that waits in the queue of a bus without a thread, and the bus's own threads that carry it out: how many there
//! are, who is on the way, and what each does next. What it is that they carry out stands in `errand`.

use std::sync::{Arc, MutexGuard, PoisonError, Weak};
use std::thread::{self, Thread};
use std::time::Duration;

use drivebus_rtu::UnitAddress;

use crate::bus::Bus;
use crate::bus::errand::{self, Errand};
use crate::turns::order::{Priority, Ticket};
use crate::turns::queue::{NoTurn, Queue, State, Turn};

/// Most threads of one bus, but for stops, which always get one. One has the line; others stand by for units that are
/// silent, and of those there may be many.
const MOST: usize = 64;

/// Who waits for the line.
#[derive(Debug)]
pub(crate) enum Waiter {
    /// A thread that will use it.
    Thread(Thread),
    /// What one of the crew is to do with it.
    Work(Errand),
}

impl Waiter {
    pub(crate) fn into_work(self) -> Option<Errand> {
        match self {
            Self::Work(work) => Some(work),
            Self::Thread(_) => None,
        }
    }
}

/// Makes a thread that works for a bus; whether the system gave one.
type Spawn = fn(Weak<Bus>) -> bool;

/// The crew of one bus.
#[derive(Debug)]
pub(crate) struct Crew {
    bus: Weak<Bus>,
    spawn: Spawn,
    threads: usize,
    /// Threads that wait to be called.
    idle: usize,
    /// Threads that were called and have not woken up yet.
    woken: usize,
    /// Whether one is on its way to look who is next.
    called: bool,
    dismissed: bool,
}

impl Default for Crew {
    fn default() -> Self {
        let spawn: Spawn = |bus| {
            let thread = thread::Builder::new().name(String::from("drivebus-worker"));
            thread.spawn(move || errand::work(&bus)).is_ok()
        };
        Self { bus: Weak::new(), spawn, threads: 0, idle: 0, woken: 0, called: false, dismissed: false }
    }
}

impl Crew {
    /// How long a thread waits for more work before it ends.
    pub(crate) const PATIENCE: Duration = Duration::from_secs(10);

    pub(crate) fn belongs_to(&mut self, bus: &Arc<Bus>) {
        if self.bus.strong_count() == 0 {
            self.bus = Arc::downgrade(bus);
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
        if (self.threads < MOST || is_stop) && (self.spawn)(Weak::clone(&self.bus)) {
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

impl Queue {
    /// Leaves `work` in the queue, to be done when its turn comes; gives it back where nothing is taken any more, or too
    /// much waits.
    pub(crate) fn leave_work(
        &self,
        priority: Priority,
        unit: Option<UnitAddress>,
        work: Errand,
        crew: &Arc<Bus>,
    ) -> Result<Ticket, (Errand, NoTurn)> {
        let mut state = self.lock();
        if state.crew.is_dismissed() {
            return Err((work, NoTurn::GivenUp));
        }
        if state.is_full_for(priority, self.room) {
            return Err((work, NoTurn::Full));
        }
        state.crew.belongs_to(crew);
        let ticket = state.order.ticket(priority, unit);
        state.order.wait(ticket, Waiter::Work(work));
        self.call_next(state);
        Ok(ticket)
    }

    /// Takes work back whose turn has not come.
    pub(crate) fn take_back(&self, ticket: Ticket) -> Option<Errand> {
        let mut state = self.lock();
        let waiter = state.order.leave(ticket);
        self.call_next(state);
        waiter.and_then(Waiter::into_work)
    }

    /// Ends the crew, and gives back the work that waits. None is taken from here on.
    pub(crate) fn dismiss(&self) -> Vec<Errand> {
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
    pub(crate) fn next_work(&self) -> Option<(Turn<'_>, Errand)> {
        let mut state = self.lock();
        let mut waited = false;
        loop {
            state.crew.has_come();
            if let Some((ticket, work)) = state.take_work() {
                return Some((Turn { queue: self, ticket }, work));
            }
            let is_needed = state.order.waiting().any(|waiter| matches!(waiter, Waiter::Work(_)));
            if state.crew.is_dismissed() || (waited && !is_needed) {
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

    /// One of the crew ends. Whoever is next may have counted on it.
    pub(crate) fn leave_crew(&self) {
        let mut state = self.lock();
        state.crew.has_left();
        self.call_next(state);
    }

    /// Wakes who is next, if the line is free. It looks for itself whether it still is.
    ///
    /// Nobody counts on a thread that has had its turn and comes back: first it tells what came of it, and who is told may
    /// take long.
    pub(crate) fn call_next(&self, state: MutexGuard<'_, State>) {
        if state.owner.is_some() {
            return;
        }
        match state.order.next() {
            Some(Waiter::Thread(thread)) => thread.unpark(),
            Some(Waiter::Work(_)) => self.call_crew(state),
            None => {}
        }
    }

    /// Calls one of the crew to the work that is next.
    fn call_crew(&self, mut state: MutexGuard<'_, State>) {
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

impl State {
    /// Takes the line for the next one, if it is free and that one is work.
    fn take_work(&mut self) -> Option<(Ticket, Errand)> {
        if self.owner.is_some() || !matches!(self.order.next(), Some(Waiter::Work(_))) {
            return None;
        }
        let ticket = self.order.next_ticket()?;
        let work = self.order.take(ticket)?.into_work()?;
        self.owner = Some((ticket, thread::current()));
        Some((ticket, work))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use drivebus_rtu::{Request, SerialFormat};

    use super::*;
    use crate::error::Failure;
    use crate::nobody;
    use crate::options::{BusOptions, CallOptions};

    #[test]
    fn who_is_told_that_there_is_no_thread_may_use_the_queue() {
        let bus = Bus::open(nobody::opener(), BusOptions::new(SerialFormat::DEFAULT), &mut || false).unwrap();
        let bus = Arc::new(bus);
        bus.queue.lock().crew.spawn = |_| false;
        let (tell, told) = channel();
        let queue = Arc::clone(&bus.queue);
        let unit = UnitAddress::new(1).unwrap();
        let errand = Errand::new(unit.into(), &Request::write(0x2000, 5), CallOptions::default(), move |outcome| {
            tell.send((outcome.unwrap_err().failure, queue.state.try_lock().is_ok())).unwrap();
        });
        bus.send(errand);
        assert_eq!(told.recv(), Ok((Failure::Closed, true)));
    }

    #[test]
    fn whose_turn_has_come_waits_no_longer_however_late_its_thread_comes() {
        let (tell, told) = channel();
        let options = BusOptions { queue: 2, ..BusOptions::new(SerialFormat::DEFAULT) };
        let bus = Arc::new(Bus::open(nobody::opener(), options, &mut || false).unwrap());
        bus.queue.lock().crew.spawn = |_| true;
        let unit = UnitAddress::new(1).unwrap();
        for number in 0..5 {
            let tell = tell.clone();
            bus.send(Errand::new(unit.into(), &Request::write(0x2000, 5), CallOptions::default(), move |outcome| {
                tell.send((number, outcome.unwrap_err().failure)).unwrap();
            }));
        }
        assert_eq!(
            told.try_iter().collect::<Vec<_>>(),
            [(3, Failure::QueueFull { room: 2 }), (4, Failure::QueueFull { room: 2 })]
        );
    }
}
