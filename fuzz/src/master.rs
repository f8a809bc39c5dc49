//! Invariant: whatever bytes come at whatever moments, the master tells an answer only if the bytes that came since it
//! sent hold a valid one, ends every request within its time, and takes a unit out of quarantine only for an answer that
//! could not be mistaken, or when its time is over.
//!
//! The model beside it knows what was sent, what came since, what each unit left open, and when each request must end.

use std::time::Duration;

use drivebus_rtu::{
    AnswerError, AnswerLength, BeginError, Destination, FIRST_CONTACT, Instant, Master, PATIENCE, Request, TURNAROUND,
    Tally, UnitAddress,
};

use crate::doubts::{Known, Stream};
use crate::oracle::{self, Asked, Length, Verdict};
use crate::stream::{Arrival, GAPS, Input, Lumps, SILENCE};
use crate::told::{Said, pdu_of};

const UNITS: u8 = 3;
/// Open requests that a master tells apart.
const REMEMBERED: usize = 32;

/// See the file's first lines. The input: the line, then requests with what happens while each is under way.
pub fn master(data: &[u8]) {
    let mut input = Input::new(data);
    let how = input.byte();
    // Zero: frames are told apart by something else than silence.
    let silence = if how & 2 == 0 { SILENCE } else { Duration::ZERO };
    let mut run = Run {
        master: Master::with_silence(silence),
        silence,
        strips_echo: how & 1 == 1,
        now: Instant::ZERO,
        last_byte: Instant::ZERO,
        request_left: Instant::ZERO,
        units: Default::default(),
        is_crowded: false,
        sent: Vec::new(),
        fed: 0,
        stream: Stream::default(),
        lumps: Lumps::default(),
    };
    run.master.strip_echo(run.strips_echo);
    while !input.is_empty() {
        run.act(&mut input);
        run.check();
    }
}

/// A request as the model knows it.
struct Job {
    destination: Destination,
    asked: Asked,
    frame: Vec<u8>,
    timeout: Duration,
    /// It went out whatever was in doubt.
    in_doubt: bool,
}

/// How far a request has come.
struct Progress {
    /// When it must have ended, as far as is known by now.
    limit: Instant,
    /// It went out.
    transmitted: bool,
    /// How many bytes had come on the line by then.
    place: usize,
    /// What came since.
    heard: Vec<u8>,
}

struct Run {
    master: Master,
    silence: Duration,
    strips_echo: bool,
    now: Instant,
    /// When something was on the line that the master did not send.
    last_byte: Instant,
    /// When the latest request has left, as far as the master can know.
    request_left: Instant,
    /// Number 0 is nobody.
    units: [Known; UNITS as usize + 1],
    /// More was open at once than the master tells apart: it may doubt more than this model does.
    is_crowded: bool,
    sent: Vec<Vec<u8>>,
    fed: usize,
    /// All that came.
    stream: Stream,
    lumps: Lumps,
}

impl Run {
    fn act(&mut self, input: &mut Input<'_>) {
        let what = input.byte();
        let number = 1 + (what >> 4) % UNITS;
        let Ok(unit) = UnitAddress::new(number) else { return };
        match what & 0x0F {
            0 => self.now = self.now + PATIENCE / 2,
            1 => {
                self.master.opened(self.now);
                self.last_byte = self.last_byte.max(self.now);
                for known in self.units.iter_mut().skip(1) {
                    known.strange_until = Some(self.now + FIRST_CONTACT);
                }
            }
            // Something comes although nothing was asked.
            2 | 3 => {
                for arrival in self.lumps.next(input, &self.sent) {
                    self.now = self.now + arrival.gap;
                    self.feed(&arrival.bytes, |_, event| assert!(event.is_none(), "{event:?} out of nothing"));
                }
            }
            4 => self.request(Destination::Broadcast, false, input),
            5 => self.request(unit.into(), true, input),
            _ => self.request(unit.into(), false, input),
        }
    }

    /// Gives `bytes` to the master as they fit, and looks after each part.
    fn feed(&mut self, bytes: &[u8], mut look: impl FnMut(&mut Self, Option<Said>)) {
        let mut rest = bytes;
        loop {
            let count = self.master.receive(self.now, rest);
            assert!(count > 0 || rest.is_empty(), "no room after looking");
            self.fed += count;
            self.stream.push(&rest[..count], UNITS);
            rest = &rest[count..];
            if count > 0 {
                self.last_byte = self.last_byte.max(self.now);
            }
            let said = self.master.poll(self.now).map(Said::of);
            let ended = said.as_ref().is_some_and(|said| !matches!(said, Said::Transmit(_)));
            look(self, said);
            if rest.is_empty() || ended {
                return;
            }
        }
    }

    fn request(&mut self, destination: Destination, in_doubt: bool, input: &mut Input<'_>) {
        let kind = input.byte();
        let timeout = Duration::from_micros(GAPS[usize::from(kind >> 4)]);
        let (first, second) = (input.word(), input.word());
        let words: Vec<u16> = (0..=second % 123).map(|n| n ^ first).collect();
        let custom = [0x41, first.to_be_bytes()[1]];
        let len = u8::try_from(1 + second % 253).unwrap_or(1);
        let request = match kind & 7 {
            0 => Request::read(first, 1 + second % 125),
            1 => Request::read(first, 1 + second % 3),
            2 => Ok(Request::write(first, second)),
            3 | 4 => Ok(Request::echo(second)),
            5 => Request::write_many(first, &words),
            6 => Request::custom(&custom, AnswerLength::BySilence),
            _ => Request::custom(&custom, AnswerLength::Bytes(len)),
        };
        let Ok(request) = request else { return };
        let timeout = if destination == Destination::Broadcast { TURNAROUND } else { timeout };
        let begun = if in_doubt {
            self.master.begin_in_doubt(self.now, destination, &request, timeout)
        } else {
            self.master.begin(self.now, destination, &request, timeout)
        };
        let known = &self.units[usize::from(destination.to_wire())];
        let doubtful = known.is_doubtful(self.now);
        let is_echo = matches!(request, Request::Echo { .. });
        match (begun, destination) {
            (Err(BeginError::BroadcastRead), Destination::Broadcast) => return assert!(!request.is_write()),
            (Err(BeginError::Quarantine { unit }), Destination::Unit(asked)) => {
                let may_owe = !known.open.is_empty() || known.is_strange(self.now);
                return assert!(may_owe && !is_echo && !in_doubt && unit == asked);
            }
            (begun, _) => assert_eq!(begun, Ok(())),
        }
        let other_read = matches!(request, Request::Read { .. })
            && !known.is_strange(self.now)
            && !known.owes_read_like(self.now, &pdu_of(&request), destination.to_wire(), &self.stream);
        assert!(!doubtful || is_echo || in_doubt || other_read, "a unit in quarantine was asked {request:?}");
        let length = match kind & 7 {
            6 => Length::Any,
            7 => Length::Given(len),
            _ => Length::Named,
        };
        let asked = Asked { pdu: pdu_of(&request), length };
        let frame = oracle::sealed(&[&[destination.to_wire()], &asked.pdu[..]].concat());
        let job = Job { destination, asked, frame, timeout, in_doubt };
        self.follow(&job, input);
    }

    /// Sees the request to its end: what comes before it goes out, while it does, and after it.
    fn follow(&mut self, job: &Job, input: &mut Input<'_>) {
        let mut progress =
            Progress { limit: self.now + self.silence + job.timeout, transmitted: false, place: 0, heard: Vec::new() };
        let mut coming = match input.byte() {
            7 => self.lumps.next(input, &self.sent),
            0xFF => return self.give_up(job, &progress),
            _ => Vec::new(),
        };
        let mut said = self.master.poll(self.now).map(Said::of);
        loop {
            if let Some(event) = said.take() {
                if self.hear(job, &mut progress, event, input) {
                    return;
                }
                said = self.master.poll(self.now).map(Said::of);
                continue;
            }
            let Some(deadline) = self.master.deadline() else {
                unreachable!("a request under way without a deadline");
            };
            assert!(self.now < deadline && deadline <= progress.limit, "{deadline:?}, {:?}", progress.limit);
            if coming.is_empty() && !input.is_empty() && progress.transmitted {
                if input.byte() == 0xFF {
                    return self.give_up(job, &progress);
                }
                coming = self.lumps.next(input, &self.sent);
            }
            match coming.first().cloned() {
                Some(Arrival { gap, bytes }) if self.now + gap < deadline => {
                    coming.remove(0);
                    self.now = self.now + gap;
                    let transmitted = progress.transmitted;
                    let before = self.fed;
                    let mut events = Vec::new();
                    self.feed(&bytes, |_, event| events.extend(event));
                    if transmitted {
                        progress.heard.extend_from_slice(&bytes[..self.fed - before]);
                    }
                    assert!(events.len() <= 1);
                    said = events.pop();
                }
                next => {
                    // What comes later comes so much sooner after this moment.
                    if let (Some(_), Some(first)) = (next, coming.first_mut()) {
                        first.gap = first.gap.saturating_sub(deadline.saturating_duration_since(self.now));
                    }
                    self.now = deadline;
                    said = self.master.poll(self.now).map(Said::of);
                }
            }
        }
    }

    fn give_up(&mut self, job: &Job, progress: &Progress) {
        let was_sent = self.master.abort(self.now);
        assert_eq!(was_sent, progress.transmitted);
        self.leave_open(job, was_sent, progress.place);
    }

    /// The request goes out.
    fn transmit(&mut self, job: &Job, progress: &mut Progress, frame: Vec<u8>, input: &mut Input<'_>) {
        let Progress { limit, transmitted, place, heard } = progress;
        assert!(!*transmitted, "sent twice");
        assert_eq!(frame, job.frame);
        let quiet_from = self.last_byte.max(self.request_left);
        assert!(self.now >= quiet_from + self.silence, "the silence before a request was cut short");
        self.sent.push(frame);
        *transmitted = true;
        *place = self.stream.len;
        assert_eq!(self.master.deadline(), None);
        let end = self.now + Duration::from_micros(573) * u32::try_from(job.frame.len()).unwrap_or(0);
        // What is whole before the request has left is no answer to it; what has only begun may become one.
        if input.byte() & 7 == 7 {
            for arrival in self.lumps.next(input, &self.sent) {
                self.feed(&arrival.bytes, |_, event| assert!(event.is_none(), "{event:?} while sending"));
                heard.extend_from_slice(&arrival.bytes);
            }
        }
        self.master.sent(end);
        self.request_left = self.request_left.max(end);
        *limit = end + job.timeout;
    }

    /// Judges what the master says; whether that ends the request.
    fn hear(&mut self, job: &Job, progress: &mut Progress, said: Said, input: &mut Input<'_>) -> bool {
        if let Said::Transmit(frame) = said {
            self.transmit(job, progress, frame, input);
            return false;
        }
        let Progress { limit, transmitted, place, heard } = progress;
        assert_eq!(*transmitted, !matches!(said, Said::Busy));
        let unit = match job.destination {
            Destination::Unit(unit) => unit.get(),
            Destination::Broadcast => {
                assert!(matches!(said, Said::BroadcastDone | Said::Busy), "{said:?} to a broadcast");
                assert!(self.now >= *limit);
                return true;
            }
        };
        let (now, place, is_echo) = (self.now, *place, job.asked.pdu[0] == 8);
        let known = &mut self.units[usize::from(unit)];
        let is_apart = job.asked.pdu[0] == 3 && !known.is_strange(now) && !known.has_read_like(&job.asked.pdu);
        let may_be_apart = job.asked.pdu[0] == 3
            && !known.is_strange(now)
            && !known.owes_read_like(now, &job.asked.pdu, unit, &self.stream);
        match said {
            Said::Answer { pdu, exception } => {
                let verdict = job.asked.judge(&pdu);
                assert_eq!(verdict, if exception { Verdict::Refusal } else { Verdict::Right }, "{pdu:02X?}");
                let wire = oracle::sealed(&[&[unit], &pdu[..]].concat());
                // Where the adapter sends the request back, the first copy of it was the adapter's.
                let copies = 1 + usize::from(self.strips_echo && wire == job.frame);
                let came = heard.windows(wire.len()).filter(|part| *part == wire).count();
                assert!(came >= copies, "{wire:02X?} told, {heard:02X?} came");
                match (is_echo, exception) {
                    (true, false) => {
                        known.settle();
                        known.echoed = true;
                    }
                    // The refusal of another program's echo looks the same.
                    (true, true) if known.is_strange(now) => {
                        known.leave_open(job.asked.clone(), now, place);
                    }
                    (true, true) => {
                        // With so much open that not all is remembered, the master waits for an echo.
                        if UnitAddress::new(unit).is_ok_and(|unit| !self.master.in_quarantine(now, unit)) {
                            known.settle();
                            // Or it has refused so many that it counts as one that returns none.
                            known.echoed &= !self.is_crowded;
                        } else {
                            known.leave_open(job.asked.clone(), now, place);
                        }
                    }
                    (false, true) => {
                        let is_sure = !known.is_doubtful(now) || !is_apart || self.is_crowded || job.in_doubt;
                        assert!(is_sure || known.may_be_free(now, unit, &self.stream), "a refusal that may be late");
                    }
                    (false, false) if self.is_crowded || may_be_apart => {
                        if UnitAddress::new(unit).is_ok_and(|unit| !self.master.in_quarantine(now, unit)) {
                            known.open.clear();
                        }
                    }
                    // It answers in the order it was asked: what was open before will not come any more.
                    (false, false) if is_apart && known.holds(now) => known.open.clear(),
                    (false, false) => {}
                }
                // An answer proves that the request has left, whatever was computed.
                self.request_left = self.request_left.min(self.now);
            }
            Said::Wrong { frame, error } => {
                let Some((address, pdu)) = oracle::frame(&frame) else {
                    unreachable!("{frame:02X?} is no frame");
                };
                assert!(address == unit && pdu[0] & 0x7F == job.asked.pdu[0], "{frame:02X?} is foreign");
                // A read's refusal may be meant for another read.
                let refused =
                    matches!(error, AnswerError::Refusal { .. }) && job.asked.pdu[0] == 3 && !known.open.is_empty();
                assert_eq!(job.asked.judge(pdu), if refused { Verdict::Refusal } else { Verdict::Wrong });
                // What was seen, or is open for longer than it may come, is late no more.
                let owes = !known.may_be_free(now, unit, &self.stream);
                assert!(!(owes && is_echo && matches!(error, AnswerError::Echo { .. })), "a late echo is no answer");
                assert!(heard.windows(frame.len()).any(|part| part == frame));
                // An answer proves that the request has left, whatever was computed.
                self.request_left = self.request_left.min(self.now);
                self.leave_open(job, true, place);
            }
            Said::Corrupt(bytes) => {
                // In the order in which they came; whole frames of others may have come between them.
                let mut rest = heard.iter();
                assert!(!bytes.is_empty() && bytes.iter().all(|byte| rest.any(|came| came == byte)));
                self.leave_open(job, true, place);
            }
            Said::NoAnswer(bytes) => {
                assert!(self.now >= *limit && heard.ends_with(&bytes));
                self.leave_open(job, true, place);
            }
            Said::Busy => assert!(self.now >= *limit),
            Said::BroadcastDone | Said::Transmit(_) => unreachable!("{said:?} to a request for one unit"),
        }
        true
    }

    fn leave_open(&mut self, job: &Job, sent: bool, place: usize) {
        if let (Destination::Unit(unit), true) = (job.destination, sent) {
            self.units[usize::from(unit.get())].leave_open(job.asked.clone(), self.now, place);
            self.is_crowded |= self.units.iter().map(|known| known.open.len()).sum::<usize>() > REMEMBERED;
        }
    }

    /// What holds whenever nothing is under way.
    fn check(&mut self) {
        assert_eq!(self.master.poll(self.now).map(Said::of), None);
        assert!(self.master.deadline().is_none_or(|deadline| deadline > self.now), "a deadline in the past for ever");
        for number in 1..=UNITS {
            let unit = UnitAddress::new(number).unwrap_or(UnitAddress::MIN);
            let in_quarantine = self.master.in_quarantine(self.now, unit);
            let known = &mut self.units[usize::from(number)];
            let is_free =
                in_quarantine || !known.is_doubtful(self.now) || known.may_be_free(self.now, number, &self.stream);
            assert!(is_free, "unit {number} is free, {known:?}");
            let may_owe = !known.open.is_empty() || known.is_strange(self.now);
            assert!(!in_quarantine || may_owe || self.is_crowded, "unit {number} owes nothing");
        }
        let Tally { late, foreign, noise, own_echo, .. } = self.master.take_tally();
        let frames = usize::try_from(late + foreign + own_echo).unwrap_or(usize::MAX);
        assert!(4 * frames + usize::try_from(noise).unwrap_or(usize::MAX) <= self.fed, "counted what never came");
        // What is held may be counted later.
        self.fed = self.fed.min(2 * 256);
    }
}
