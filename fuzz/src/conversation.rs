//! Invariant: whatever is said to a conversation at whatever moments, it sends a write twice only where it has looked between,
//! never more than eight requests for each time that it may ask, tells only words that a valid frame carried, and ends.
//!
//! The line is not kept to any rule: bytes come before anything was asked, requests are said to be out that never were, time goes
//! back, the port is opened under a request, and another call begins on the same line.

use std::time::Duration;

use drivebus_rtu::{
    Answer, AnswerLength, Conversation, Cut, Destination, FreshWords, Instant, Known, Opened, Outcome, OwnEcho,
    Question, Request, SerialFormat, Step, Table, UnitAddress, Urgency,
};

use crate::oracle;
use crate::stream::{GAPS, Input, Lumps};

const TIMEOUT: Duration = Duration::from_millis(100);
const SENDING: Duration = Duration::from_millis(4);
/// Requests for each time that a call may ask.
const EACH: usize = 8;
/// What a stop may ask beyond that, in shapes that each come once, before it asks its question at first contact.
const PREPARED: usize = 20;
/// More steps than this nothing takes that ends.
const STEPS: usize = 10_000;

type Line = Known<3, 4>;

/// See the file's first lines. The input: the line, the question, and then what is said.
pub fn conversation(data: &[u8]) {
    let mut input = Input::new(data);
    let how = input.byte();
    let echo = [OwnEcho::Unknown, OwnEcho::Present, OwnEcho::Absent][usize::from(how % 3)];
    let mut known = Line::new(SerialFormat::DEFAULT, echo, how.into());
    known.opened(Instant::ZERO, &Opened::new().may_have_others(how & 8 != 0).gapless(how & 16 != 0));
    let words = [5, 6];
    let [kind, flags] = [input.byte(), input.byte()];
    let Some(question) = question(kind, flags, &words) else { return };
    let prepared = if question.urgency == Urgency::Stop { PREPARED } else { 0 };
    let mut run = Run {
        known,
        now: Instant::ZERO + if how & 32 != 0 { Duration::from_secs(5) } else { Duration::ZERO },
        sent: Vec::new(),
        heard: Vec::new(),
        is_looked_at: false,
        limit: EACH * (usize::from(flags & 3) + 1) + prepared,
        question,
        lumps: Lumps::default(),
    };
    let fresh = FreshWords::beginning_at(0x1234);
    let mut call = Conversation::new(question, &fresh);
    while !input.is_empty() {
        run.say(&mut call, &mut input);
    }
    // From here on nobody answers.
    let steps = (0..STEPS).take_while(|_| !run.follow(&mut call, &[])).count();
    assert!(steps < STEPS, "no end to {question:?}");
    let sent = run.sent.len();
    assert!(run.follow(&mut call, &[]) && run.sent.len() == sent, "what is over stays over");
}

fn question(kind: u8, flags: u8, words: &[u16]) -> Option<Question<'_>> {
    let request = match kind & 7 {
        0 | 1 => Request::read(9, 1 + u16::from(kind & 1)),
        2 => Request::read_of(Table::Coil, 9, 3),
        3 => Ok(Request::write(9, 5)),
        4 => Request::write_many(9, words),
        5 => Ok(Request::echo(7)),
        6 => Request::custom(&[0x41, 1], AnswerLength::BySilence),
        _ => Ok(Request::write_coil(9, true)),
    };
    let to = if kind & 0xF0 == 0xF0 { Destination::Broadcast } else { UnitAddress::MIN.into() };
    let urgency = [Urgency::Call, Urgency::Poll, Urgency::Stop, Urgency::Call][usize::from(flags >> 2 & 3)];
    Some(
        Question::new(to, request.ok()?, TIMEOUT)
            .retries((flags & 3).into())
            .urgency(urgency)
            .in_doubt(flags & 16 != 0)
            .verify(flags & 32 != 0)
            .read_back((flags & 64 != 0).then_some(9))
            .connection((flags & 128 != 0).then_some(0)),
    )
}

struct Run<'r> {
    known: Line,
    now: Instant,
    sent: Vec<Vec<u8>>,
    /// All that was given to it.
    heard: Vec<u8>,
    /// A read went out since the last write.
    is_looked_at: bool,
    limit: usize,
    question: Question<'r>,
    lumps: Lumps,
}

impl Run<'_> {
    fn say(&mut self, call: &mut Conversation<'_>, input: &mut Input<'_>) {
        let what = input.byte();
        let gap = Duration::from_micros(GAPS[usize::from(what >> 4)]);
        match what & 0x0F {
            // What it asks for is done; sometimes nothing comes.
            0..=4 => {
                for arrival in self.lumps.next(input, &self.sent) {
                    self.now = self.now + arrival.gap;
                    self.follow(call, &arrival.bytes);
                }
            }
            5 | 6 => drop(self.follow(call, &[])),
            7 => {
                let _ = call.next(self.now, &mut self.known);
            }
            8 => {
                let _ = call.sent(&mut self.known, self.now + gap);
            }
            9 => {
                for arrival in self.lumps.next(input, &self.sent) {
                    if call.heard(self.now + gap, &mut self.known, &arrival.bytes).is_ok() {
                        self.now = self.now + gap;
                        self.heard.extend_from_slice(&arrival.bytes);
                    }
                }
            }
            10 => {
                let why = [Cut::Lost, Cut::Unusable, Cut::GivenUp, Cut::Lost][usize::from(what >> 4 & 3)];
                call.cut_short(self.now, &mut self.known, why);
            }
            11 => call.give_way(self.now, &mut self.known, gap),
            12 => call.is_wanted(what & 16 != 0),
            13 => self.known.opened(self.now, &Opened::new().may_have_others(what & 16 != 0).gapless(what & 32 != 0)),
            14 => match what >> 4 & 3 {
                0 => self.known.abort(self.now),
                1 => self.known.closed(),
                2 => self.known.is_connection(u64::from(what >> 6)),
                _ => self.now = Instant::ZERO + self.now.saturating_duration_since(Instant::ZERO + gap),
            },
            _ => self.another(what >> 4),
        }
    }

    /// Another call begins, and is left as it is.
    fn another(&mut self, unit: u8) {
        let fresh = FreshWords::beginning_at(9);
        let Ok((unit, read)) = UnitAddress::new(1 + unit % 6)
            .map_err(drop)
            .and_then(|unit| Ok((unit, Request::read(9, 1).map_err(drop)?)))
        else {
            return;
        };
        let mut another = Conversation::new(Question::new(unit.into(), read, TIMEOUT), &fresh);
        for _ in 0..6 {
            match another.next(self.now, &mut self.known) {
                Step::Send(_) => drop(another.sent(&mut self.known, self.now)),
                Step::Listen(_) => drop(another.heard(self.now, &mut self.known, &[])),
                _ => {}
            }
        }
    }

    /// Does what the call asks for, with `came` where it listens; whether it is over.
    fn follow(&mut self, call: &mut Conversation<'_>, came: &[u8]) -> bool {
        match call.next(self.now, &mut self.known) {
            Step::Send(frame) => {
                match frame[1] {
                    5 | 6 | 16 => {
                        let again = self.sent.iter().any(|sent| sent == frame);
                        assert!(!again || self.is_looked_at, "{frame:02X?} went out twice, and nobody looked");
                        self.is_looked_at = false;
                    }
                    1..=4 => self.is_looked_at = self.question.read_back.is_some(),
                    _ => {}
                }
                self.sent.push(frame.to_vec());
                assert!(self.sent.len() <= self.limit, "{} requests, {} are allowed", self.sent.len(), self.limit);
                self.now = self.now + SENDING;
                assert!(call.sent(&mut self.known, self.now).is_ok());
            }
            Step::Listen(until) => {
                if came.is_empty() {
                    self.now = self.now.max(until);
                }
                let mut rest = came;
                while let Ok(count) = call.heard(self.now, &mut self.known, rest) {
                    self.heard.extend_from_slice(&rest[..count]);
                    rest = &rest[count..];
                    // What there is no room for there is after looking; what is over has no use for it.
                    if rest.is_empty() || !matches!(call.next(self.now, &mut self.known), Step::Listen(_)) {
                        break;
                    }
                }
            }
            Step::StandBy(until) => self.now = self.now.max(until),
            Step::Done(outcome) => {
                if let Outcome::Answered { answer: Some(Answer::Read { table: Table::Holding, words, .. }), .. } =
                    outcome
                {
                    let words: Vec<u8> = words.iter().flat_map(u16::to_be_bytes).collect();
                    assert!(self.has_heard(&words), "{words:02X?} told, {:02X?} heard", self.heard);
                }
                return true;
            }
            _ => {}
        }
        false
    }

    /// Whether a valid answer came that begins with `words`.
    fn has_heard(&self, words: &[u8]) -> bool {
        self.heard.windows(3).enumerate().any(|(start, head)| {
            let len = 5 + usize::from(head[2]);
            let frame = self.heard.get(start..start + len).and_then(oracle::frame);
            head[..2] == [1, 3] && frame.is_some_and(|(_, pdu)| pdu[2..].starts_with(words))
        })
    }
}
