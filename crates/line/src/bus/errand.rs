//! Requests of callers that do not wait in a thread of their own, such as those of an event loop.
//!
//! An [`Errand`] waits in the queue of its bus like any caller, and a thread of the bus's crew carries it out when its turn
//! has come. Who does not want it any more takes it back: what still waits is never sent, and what is on the wire is left to
//! end by itself, so that the line stays clean, and is not repeated.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::thread;

use drivebus_rtu::{Adu, Answer, AnswerLength, Destination, Frame, Instant, Request};

use crate::ask::Done;
use crate::bus::Bus;
use crate::bus::call::Call;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::turns::crew::Employer;
use crate::turns::order::{Priority, Ticket};
use crate::turns::queue::{NoTurn, Queue, Turn};

/// A request, and who is told what became of it.
pub struct Errand {
    destination: Destination,
    /// The whole request frame.
    frame: Vec<u8>,
    /// For a request that is carried as it is.
    answer: Option<AnswerLength>,
    options: CallOptions,
    wanted: Arc<AtomicBool>,
    /// Taken when it is called.
    then: Option<Then>,
}

type Then = Box<dyn FnOnce(Result<Reply, Box<CallError>>) + Send>;

/// What came of an errand that went well.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Reply {
    /// The answer's PDU; empty after a broadcast.
    pub pdu: Vec<u8>,
    /// When it happened.
    pub done: Done,
}

/// An errand on its way.
#[derive(Debug)]
pub struct Running {
    bus: Weak<Bus>,
    ticket: Ticket,
    wanted: Arc<AtomicBool>,
}

impl Errand {
    /// `request` to `destination`; `then` is called once, by another thread, with what came of it.
    ///
    /// What is not carried out because the bus was closed ends with [`Failure::Closed`].
    pub fn new(
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        then: impl FnOnce(Result<Reply, Box<CallError>>) + Send + 'static,
    ) -> Self {
        let frame = Adu::request(destination, request).as_bytes().to_vec();
        let answer = match *request {
            Request::Custom { answer, .. } => Some(answer),
            _ => None,
        };
        let wanted = Arc::new(AtomicBool::new(true));
        Self { destination, frame, answer, options, wanted, then: Some(Box::new(then)) }
    }

    fn request(&self) -> Option<Request<'_>> {
        let pdu = Frame::parse(&self.frame).ok()?.pdu();
        match self.answer {
            Some(length) => Request::custom(pdu, length),
            None => Request::parse(pdu),
        }
        .ok()
    }

    /// Asks, in the turn of this errand, and tells what came of it.
    fn carry_out(mut self, bus: &Bus, turn: Turn<'_, Errand>) {
        // Always one: it was made of a request.
        let Some(request) = self.request() else { return };
        let mut pdu = Vec::new();
        let ask = bus.ask(self.destination, &request, &self.options);
        let result = Call::new(bus, ask, self.options)
            .while_wanted(&self.wanted)
            .run_in(turn, &mut || bus.is_shut(), &mut |answer| pdu = pdu_of(self.destination, &answer))
            .map(|done| Reply { pdu, done });
        if bus.is_shut() {
            bus.close();
        }
        self.tell(result);
    }

    fn fail(mut self, bus: &Bus, failure: Failure) {
        let now = bus.now_if_known();
        self.failed(failure, now);
    }

    fn failed(&mut self, failure: Failure, ended: Option<Instant>) {
        let (destination, request) = (self.destination, std::mem::take(&mut self.frame));
        self.tell(Err(Box::new(CallError { failure, destination, request, raw: Vec::new(), sent: None, ended })));
    }

    fn tell(&mut self, result: Result<Reply, Box<CallError>>) {
        if let Some(then) = self.then.take() {
            then(result);
        }
    }
}

impl Drop for Errand {
    /// Nobody waits for ever: the thread that carried it out panicked, or its bus is gone.
    fn drop(&mut self) {
        if self.then.is_some() {
            self.failed(Failure::Closed, None);
        }
    }
}

impl fmt::Debug for Errand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Errand")
            .field("destination", &self.destination)
            .field("frame", &self.frame)
            .finish_non_exhaustive()
    }
}

impl Running {
    /// Its result is no longer wanted: `then` is not called where its turn has not come; where it has, nothing that has
    /// not begun yet is sent.
    pub fn abandon(&self) {
        self.wanted.store(false, Ordering::Release);
        if let Some(bus) = self.bus.upgrade()
            && bus.is_of_this_process()
            && let Some(mut errand) = bus.queue.take_back(self.ticket)
        {
            errand.then = None;
        }
    }
}

impl Bus {
    /// Leaves `errand` in the queue, and returns at once; `None` where it has ended already, and was told so.
    ///
    /// It waits in the order of all who wait, and a thread of the bus's own carries it out as [`call`](Self::call) would.
    pub fn send(self: &Arc<Self>, errand: Errand) -> Option<Running> {
        let failure = if !self.is_of_this_process() {
            Failure::Forked
        } else if self.is_shut() {
            Failure::Closed
        } else {
            match errand.request() {
                Some(request) if self.options().read_only && request.is_write() => {
                    Failure::ReadOnly { function: request.function() }
                }
                request => return self.enqueue(request.is_some_and(|request| request.is_write()), errand),
            }
        };
        errand.fail(self, failure);
        None
    }

    fn enqueue(self: &Arc<Self>, is_write: bool, errand: Errand) -> Option<Running> {
        let priority = errand.options.priority.unwrap_or(if is_write { Priority::Write } else { Priority::Read });
        let unit = match errand.destination {
            Destination::Unit(unit) => Some(unit),
            Destination::Broadcast => None,
        };
        let wanted = Arc::clone(&errand.wanted);
        match self.queue.leave_work(priority, unit, errand, || Box::new(Worked(Arc::downgrade(self)))) {
            Ok(ticket) => Some(Running { bus: Arc::downgrade(self), ticket, wanted }),
            Err((errand, why)) => {
                let failure = if why == NoTurn::Full { self.no_turn(why) } else { Failure::Closed };
                errand.fail(self, failure);
                None
            }
        }
    }

    /// Ends the crew; what waits ends with [`Failure::Closed`].
    pub(crate) fn dismiss(&self) {
        for errand in self.queue.dismiss() {
            errand.fail(self, Failure::Closed);
        }
    }
}

/// The answer as it came.
fn pdu_of(from: Destination, answer: &Answer<'_>) -> Vec<u8> {
    match from {
        Destination::Unit(unit) => {
            let frame = Adu::answer(unit, answer);
            Frame::parse(frame.as_bytes()).map(|frame| frame.pdu().to_vec()).unwrap_or_default()
        }
        Destination::Broadcast => Vec::new(),
    }
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
        Arc::clone(&bus.queue)
    }) else {
        return;
    };
    let _member = Member(&queue);
    while let Some((turn, errand)) = queue.next_work() {
        // Where the bus is gone, dropping the errand tells so.
        if let Some(bus) = bus.upgrade() {
            errand.carry_out(&bus, turn);
        }
    }
}

/// Leaves the crew however its thread ends.
struct Member<'a>(&'a Queue<Errand>);

impl Drop for Member<'_> {
    fn drop(&mut self) {
        self.0.leave_crew();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use drivebus_rtu::{SerialFormat, UnitAddress};

    use super::*;
    use crate::nobody;
    use crate::options::BusOptions;

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
        bus.queue.lock().crew.works_for(|| Box::new(Gives(false)));
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
        bus.queue.lock().crew.works_for(|| Box::new(Gives(true)));
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
