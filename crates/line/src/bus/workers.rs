//! The threads that carry out errands: each takes the next one from the queue in its turn, and asks as any caller would.

use std::sync::{Arc, Weak};

use crate::bus::Bus;
use crate::bus::errand::{Errand, Reply, pdu_of};
use crate::bus::shared::Shared;
use crate::error::Failure;
use crate::system::sync::atomic::{AtomicBool, Ordering};
use crate::system::sync::thread;
use crate::turns::crew::Employer;
use crate::turns::order::{Claim, Priority, Ticket};
use crate::turns::queue::{NoTurn, Turn};

/// An errand on its way.
#[derive(Debug)]
pub struct Running {
    bus: Weak<Bus>,
    ticket: Ticket,
    wanted: Arc<AtomicBool>,
}

impl Running {
    /// Its result is no longer wanted: `then` is not called where its turn has not come; where it has, nothing that has
    /// not begun yet is sent.
    pub fn abandon(&self) {
        self.wanted.store(false, Ordering::Release);
        if let Some(bus) = self.bus.upgrade()
            && bus.port().is_of_this_process()
            && let Some(errand) = bus.port().queue.take_back(self.ticket)
        {
            errand.forget();
        }
    }
}

impl Bus {
    /// Leaves `errand` in the queue, and returns at once; `None` where it has ended already, and was told so.
    ///
    /// It waits in the order of all who wait, and a thread of the bus's own carries it out as [`call`](Self::call) would.
    pub fn send(self: &Arc<Self>, errand: Errand) -> Option<Running> {
        let failure = if !self.port().is_of_this_process() {
            Failure::Forked
        } else if self.is_shut() {
            Failure::Closed
        } else {
            let request = errand.request(|| 0);
            match request.and_then(|request| self.options().kept_from(&request)) {
                Some(failure) => failure,
                None => return self.enqueue(request.is_some_and(|request| request.is_write()), errand),
            }
        };
        errand.fail(failure, self.port().now_if_known());
        None
    }

    fn enqueue(self: &Arc<Self>, is_write: bool, errand: Errand) -> Option<Running> {
        let priority = errand.options.priority.unwrap_or(if is_write { Priority::Write } else { Priority::Read });
        let unit = errand.destination.unit();
        let wanted = Arc::clone(&errand.wanted);
        let claim = Claim { priority, unit, program: errand.program };
        match self.port().queue.leave_work(claim, errand, || Box::new(Worked(Arc::downgrade(self)))) {
            Ok(ticket) => Some(Running { bus: Arc::downgrade(self), ticket, wanted }),
            Err((errand, why)) => {
                let failure = if why == NoTurn::Full { self.port().no_turn(why) } else { Failure::Closed };
                errand.fail(failure, self.port().now_if_known());
                None
            }
        }
    }
}

/// Asks, in the turn of `errand`, and tells what came of it.
fn carry_out(mut errand: Errand, bus: &Shared, turn: Turn<'_, Errand>) {
    if !errand.begins() {
        return errand.forget();
    }
    let mut pdu = Vec::new();
    let result = bus.carry_out(&errand, turn, &mut |answer| pdu = pdu_of(errand.destination, &answer));
    let Some(result) = result else { return };
    let result = result.map(|done| Reply { pdu, done });
    if bus.port.is_shut() {
        bus.port.close();
    }
    errand.tell(result);
}

/// The bus that a crew works for.
#[derive(Debug)]
struct Worked(Weak<Bus>);

impl Employer for Worked {
    fn is_there(&self) -> bool {
        self.0.strong_count() > 0
    }

    fn hire(&self) -> bool {
        let bus = Weak::clone(&self.0);
        thread::Builder::new().name(String::from("drivebus-worker")).spawn(move || work(&bus)).is_ok()
    }
}

/// One of the crew: carries out what is next, until nothing comes for a while or the bus is gone.
fn work(bus: &Weak<Bus>) {
    let Some(queue) = bus.upgrade().map(|bus| {
        bus.enter_thread();
        Arc::clone(&bus.port().queue)
    }) else {
        return;
    };
    queue.serve(|turn, errand| {
        // Where the bus is gone, dropping the errand tells so.
        if let Some(bus) = bus.upgrade() {
            carry_out(errand, &bus.shared, turn);
        }
    });
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use drivebus_rtu::{Request, SerialFormat, UnitAddress};

    use super::*;
    use crate::nobody;
    use crate::options::{BusOptions, CallOptions};

    /// A system that gives threads which never come, or none.
    #[derive(Debug)]
    struct Gives(bool);

    impl Employer for Gives {
        fn is_there(&self) -> bool {
            true
        }

        fn hire(&self) -> bool {
            self.0
        }
    }

    #[test]
    fn who_is_told_that_there_is_no_thread_may_use_the_queue() {
        let bus = Bus::open(nobody::opener(), BusOptions::new(SerialFormat::DEFAULT), &mut || false).unwrap();
        let bus = Arc::new(bus);
        bus.port().queue.lock().crew.works_for(|| Box::new(Gives(false)));
        let (tell, told) = channel();
        let queue = Arc::clone(&bus.port().queue);
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
        bus.port().queue.lock().crew.works_for(|| Box::new(Gives(true)));
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
