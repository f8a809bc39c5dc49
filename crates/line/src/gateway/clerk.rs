//! Who is at the desk of one connection: asks the line what the client asks, and answers.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::SystemTime;

use drivebus_rtu::{Destination, ExceptionCode, Instant, Request};

use crate::bus::Bus;
use crate::bus::errand::Errand;
use crate::bus::workers::Running;
use crate::gateway::asked::Asked;
use crate::gateway::audit::Entry;
use crate::gateway::connection::Connection;
use crate::gateway::desk::{Desk, Failed};
use crate::gateway::mailbox::{Answered, Found, Mail, Mailbox};
use crate::gateway::rights::{Judged, Means, Written, request_of};
use crate::gateway::silence::Silence;
use crate::gateway::stream::{HURRY, Stream, is_late};
use crate::gateway::together::Asker;
use crate::gateway::writing::{Record, Step, Writing, outcome_of};
use crate::options::CallOptions;
use crate::system::clock::monotonic;
use crate::turns::order::Priority;

/// The clerk of one connection.
pub(super) struct Clerk {
    connection: Connection,
    desk: Desk,
    on_their_way: BTreeMap<u64, OnItsWay>,
    silence: Silence,
}

/// A request on its way to the line.
enum OnItsWay {
    Read {
        asker: Arc<Asker>,
        /// `None`: it has ended already.
        running: Option<Running>,
    },
    Write(Box<Writing>),
}

impl Clerk {
    pub(super) fn new(connection: Connection, desk: Desk) -> Self {
        let silence = Silence::new(connection.common.dead_man, monotonic());
        Self { connection, desk, on_their_way: BTreeMap::new(), silence }
    }

    /// Asks and answers until the connection ends; why it does.
    pub(super) fn work(mut self, mailbox: &Arc<Mailbox>) -> String {
        let why = loop {
            let found = mailbox.next(self.next_due());
            if self.waits_for_the_last_alone(mailbox) {
                self.give_up();
            }
            let message = match found {
                Found::Over(why) => break why,
                Found::Nothing => None,
                Found::Mail(Mail::Asked(asked, at)) => self.ask(&asked, at, mailbox),
                Found::Mail(Mail::Came(number, result)) => self.came(number, result, mailbox),
            };
            let now = monotonic();
            let late = self.desk.late(now);
            for (number, _) in &late {
                self.connection.common.counts.late();
                if let Some(way) = self.on_their_way.remove(number) {
                    self.take_back(&way);
                }
            }
            if message.is_some() || !late.is_empty() {
                self.silence.heard(now);
            }
            if self.silent_at().is_some_and(|due| due <= now) {
                self.connection.gone("is silent");
            }
            let mut all = message.into_iter().chain(late.into_iter().map(|(_, message)| message));
            if let Some(why) = all.find_map(|message| write(&*self.connection.stream, &message).err()) {
                break why;
            }
        };
        for way in self.on_their_way.values() {
            self.take_back(way);
        }
        let is_closed = self.connection.place.is_closed();
        self.connection.gone(if is_closed { "is cut off as the gateway closes" } else { "has hung up" });
        if !why.is_empty() {
            self.connection.common.counts.cut_off(&self.connection.name, &why);
        }
        why
    }

    /// When something is to be done though nothing comes.
    fn next_due(&self) -> Option<Instant> {
        self.desk.due().into_iter().chain(self.silent_at()).min()
    }

    /// Until when the client has to ask something, lest what it commanded is halted.
    fn silent_at(&self) -> Option<Instant> {
        let ends = self.silence.ends(self.desk.due().is_some())?;
        self.connection.common.commanders.has(self.connection.place.number).then_some(ends)
    }

    /// Whether the client has asked something else meanwhile, so that any other answer would be taken for that one's.
    fn waits_for_the_last_alone(&self, mailbox: &Mailbox) -> bool {
        !self.connection.common.framing.tells_answers_apart() && mailbox.has_asked()
    }

    /// What the client does not wait for any more is taken back.
    fn give_up(&mut self) {
        for number in self.desk.give_up() {
            self.connection.common.counts.given_up();
            if let Some(way) = self.on_their_way.remove(&number) {
                self.take_back(&way);
            }
        }
    }

    /// Asks the line, or answers at once.
    fn ask(&mut self, asked: &Asked, at: Instant, mailbox: &Arc<Mailbox>) -> Option<Vec<u8>> {
        self.silence.heard(at);
        self.connection.place.asks(at);
        let common = Arc::clone(&self.connection.common);
        common.counts.asked();
        self.connection.seat.asked();
        self.give_up();
        if self.waits_for_the_last_alone(mailbox) {
            common.counts.given_up();
            return None;
        }
        let judged = common.rights.judge(self.connection.host, asked.unit, &asked.pdu);
        match judged {
            Judged::Wrong(code) => return Some(self.desk.refused(asked, code)),
            Judged::Refused(why) => return Some(self.refuse(asked, &why)),
            _ => {}
        }
        let Some(bus) = common.open_bus() else {
            return Some(self.desk.refused(asked, ExceptionCode::GATEWAY_PATH_UNAVAILABLE));
        };
        let Some(number) = self.desk.take(asked, at) else {
            common.counts.busy();
            return Some(self.desk.refused(asked, ExceptionCode::BUSY));
        };
        match judged {
            Judged::Read(destination, request) => self.read(&bus, (asked, number), (destination, &request), mailbox),
            Judged::Write(destination, written) => {
                if let Err(why) = self.may_begin(asked.unit, &written) {
                    let answer = self.refuse(asked, &why);
                    return self.desk.came(number, Err(ExceptionCode::ILLEGAL_FUNCTION)).map(|_| answer);
                }
                self.begin_to_write(&bus, (asked, number, at), (destination, written));
                return self.go_on(number, mailbox);
            }
            Judged::Wrong(_) | Judged::Refused(_) => {}
        }
        None
    }

    fn refuse(&self, asked: &Asked, why: &str) -> Vec<u8> {
        self.connection.common.counts.refused(&self.connection.name, why, asked);
        self.desk.refused(asked, ExceptionCode::ILLEGAL_FUNCTION)
    }

    fn read(
        &mut self,
        bus: &Arc<Bus>,
        (asked, number): (&Asked, u64),
        (destination, request): (Destination, &Request<'_>),
        mailbox: &Arc<Mailbox>,
    ) {
        let common = &self.connection.common;
        let (together, counts) = (Arc::clone(&common.together), Arc::clone(&common.counts));
        let itself = together.wait((asked.unit, asked.pdu.clone()), Arc::clone(mailbox), number);
        // Who gets what this one reads, from when it has begun.
        let others: Arc<OnceLock<Vec<Arc<Asker>>>> = Arc::default();
        let (who, told, waiting) = (Arc::clone(&itself), Arc::clone(&others), Arc::clone(&together));
        let errand = Errand::new(destination, request, CallOptions::new(), move |result| {
            let answered = result.map(|reply| reply.pdu).map_err(|error| Failed::from(&*error));
            match told.get() {
                Some(askers) => askers.iter().for_each(|one| one.hear(answered.clone())),
                // It ended before its turn came.
                None if waiting.take_back(&who) => who.hear(answered),
                None => {}
            }
        });
        let (who, wanted) = (Arc::clone(&itself), errand.wanted());
        let errand = errand.of_program(self.connection.seat.program).beginning(move || {
            let askers = together.begin(&who, &wanted);
            counts.together(askers.len());
            !askers.is_empty() && others.set(askers).is_ok()
        });
        let running = bus.send(errand);
        self.on_their_way.insert(number, OnItsWay::Read { asker: itself, running });
    }

    /// Whether what is `written` to `unit` may begin, beside what the rules say; `Err`: why not, for people.
    fn may_begin(&self, unit: u8, written: &Written) -> Result<(), String> {
        let (common, now) = (&self.connection.common, monotonic());
        if let Err(place) = common.wear.takes(unit, written.wears.iter().map(|&(place, _)| place), now) {
            let instead = written.wears.iter().find(|(worn, _)| *worn == place).and_then(|(_, instead)| *instead);
            let advice = instead.map_or_else(
                || "it has no other place for it".to_owned(),
                |ram| format!("{ram:04X}H is the same in RAM, which does not wear"),
            );
            return Err(format!(
                "writes {place:04X}H of unit {unit} again and again, and each write wears the memory of the drive: {advice}"
            ));
        }
        let needs_will = written.means == Means::Moves && common.dead_man.is_some();
        if needs_will && !common.commanders.begins(self.connection.place.number, unit, &self.connection.wills()) {
            return Err(format!(
                "may not move the motor of unit {unit} now: nobody could halt it for a client that is gone"
            ));
        }
        Ok(())
    }

    fn begin_to_write(
        &mut self,
        bus: &Bus,
        (asked, number, at): (&Asked, u64, Instant),
        (destination, written): (Destination, Written),
    ) {
        let connection = &self.connection;
        let (common, means) = (&connection.common, written.means);
        let opening = bus.reconnects();
        let will = common.rights.units.get(&asked.unit).map(|known| &known.will);
        let look = will.and_then(|will| will.look.clone()).filter(|_| !common.seen.has(asked.unit, opening));
        let (question, others) = look.map_or_else(Default::default, |(question, others)| (Some(question), others));
        let count = u16::try_from(written.words.len()).unwrap_or(u16::MAX);
        let old = written.shown_at.map(|at| [&[0x03][..], &at.to_be_bytes(), &count.to_be_bytes()].concat());
        let steps = [Some(Step::Go), old.map(Step::Old), question.map(Step::Look)].into_iter().flatten().collect();
        let halts = destination.unit().filter(|_| means == Means::Moves).map(|unit| bus.halts(unit));
        let entry = Entry {
            at: SystemTime::now(),
            client: connection.name.clone(),
            unit: asked.unit,
            function: asked.pdu.first().copied().unwrap_or_default(),
            written,
            old: None,
        };
        let (due, stream) = (at + common.within, Arc::clone(&connection.stream));
        let record = Arc::new(Record::new(Arc::clone(common), connection.place.number, due, stream, entry));
        let pdu = asked.pdu.clone();
        let writing =
            Writing { pdu, unit: asked.unit, destination, means, opening, halts, steps, others, record, running: None };
        self.on_their_way.insert(number, OnItsWay::Write(Box::new(writing)));
    }

    /// Sends the next step of write `number`; what the client is told, where that cannot be.
    fn go_on(&mut self, number: u64, mailbox: &Arc<Mailbox>) -> Option<Vec<u8>> {
        let Some(OnItsWay::Write(writing)) = self.on_their_way.get_mut(&number) else { return None };
        let Some(bus) = self.connection.common.open_bus() else {
            return self.not_sent(number, Failed::before(ExceptionCode::GATEWAY_PATH_UNAVAILABLE));
        };
        let step = writing.steps.last().cloned().unwrap_or(Step::Go);
        let is_write = step == Step::Go;
        let pdu = match step {
            Step::Look(pdu) | Step::Old(pdu) => pdu,
            Step::Go => writing.pdu.clone(),
        };
        let Some(request) = request_of(&pdu) else {
            return self.not_sent(number, Failed::before(ExceptionCode::ILLEGAL_VALUE));
        };
        let options = CallOptions::new().connection(writing.opening);
        let options = match writing.means {
            Means::Stops => options.urgent(&request),
            _ => options.priority(Priority::Write).halts(writing.halts.filter(|_| is_write)),
        };
        let (record, destination, letters) = (Arc::clone(&writing.record), writing.destination, Arc::clone(mailbox));
        let errand = Errand::new(destination, &request, options, move |result| {
            let answered: Answered = result.map(|reply| reply.pdu).map_err(|error| Failed::from(&*error));
            if is_write {
                record.ended(outcome_of(answered.as_ref(), destination));
            }
            letters.come(number, answered);
        });
        let mut errand = errand.of_program(self.connection.seat.program);
        if is_write {
            let record = Arc::clone(&writing.record);
            errand = errand.beginning(move || record.begins());
        }
        writing.running = bus.send(errand);
        None
    }

    /// Write `number` is not sent; the answer that says so.
    fn not_sent(&mut self, number: u64, failed: Failed) -> Option<Vec<u8>> {
        if let Some(way) = self.on_their_way.remove(&number) {
            self.take_back(&way);
        }
        self.answer(number, &Err(failed))
    }

    /// What has not been sent is not sent any more.
    fn take_back(&self, way: &OnItsWay) {
        match way {
            OnItsWay::Write(writing) => writing.take_back(),
            OnItsWay::Read { asker, running: Some(running) } if self.connection.common.together.take_back(asker) => {
                running.abandon();
            }
            OnItsWay::Read { asker, running: None } => {
                self.connection.common.together.take_back(asker);
            }
            OnItsWay::Read { .. } => {}
        }
    }

    /// The answer by what came; none where the client was answered before, or something else comes first.
    fn came(&mut self, number: u64, result: Answered, mailbox: &Arc<Mailbox>) -> Option<Vec<u8>> {
        let Some(OnItsWay::Write(writing)) = self.on_their_way.get_mut(&number) else {
            self.on_their_way.remove(&number);
            return self.answer(number, &result);
        };
        let common = &self.connection.common;
        match writing.steps.last() {
            Some(Step::Look(_)) => match writing.looked(&result) {
                Ok(said)
                    if !writing.others.contains(&said) && common.seen.is_same(writing.unit, writing.opening, &said) =>
                {
                    self.go_on(number, mailbox)
                }
                Ok(_) => {
                    common.counts.another(&self.connection.name, writing.unit);
                    self.not_sent(number, Failed::before(ExceptionCode::GATEWAY_TARGET_SILENT))
                }
                Err(failed) => self.not_sent(number, failed),
            },
            Some(Step::Old(_)) => match writing.read(&result) {
                Ok(()) => self.go_on(number, mailbox),
                Err(failed) => self.not_sent(number, failed),
            },
            Some(Step::Go) | None => {
                // Nobody answers for all units: the client hears that it went out, by what a unit would say.
                let echo = writing.pdu.get(..5).map(<[u8]>::to_vec).unwrap_or_default();
                let is_for_all = writing.destination == Destination::Broadcast;
                self.on_their_way.remove(&number);
                self.answer(number, &result.map(|pdu| if is_for_all { echo } else { pdu }))
            }
        }
    }

    fn answer(&mut self, number: u64, result: &Answered) -> Option<Vec<u8>> {
        let message = self.desk.came(number, result.as_deref().map_err(|failed| failed.code))?;
        self.connection.common.counts.answered(result.is_ok());
        if result.is_ok() {
            self.connection.seat.answered();
        }
        Some(message)
    }
}

/// Writes `message`; the error is why the connection ends.
fn write(stream: &dyn Stream, message: &[u8]) -> Result<(), String> {
    stream.write(message).map_err(|error| {
        // Otherwise it has hung up.
        if is_late(&error) {
            format!("an answer that was not taken within {} s", HURRY.as_secs())
        } else {
            String::new()
        }
    })
}
