//! One half-duplex wire: characters with their times, silence, collisions.
//!
//! It reads no clock: [`Wire::step`] says what happened next up to a moment. It knows frames only as far as silence
//! makes them; what they mean is the units' business.

use std::collections::VecDeque;
use std::time::Duration;

use drivebus_rtu::{Frame, Instant, SerialFormat};

use crate::random::Random;
use crate::spoil::Spoil;
use crate::trace::{Side, Trace};

/// More than the longest frame; what a master babbles beyond it is of no use to anybody.
const LONGEST_HEARD: usize = 512;
/// Answers that may overlap one request; older ones are over.
const SPANS_KEPT: usize = 16;

/// What happened on the wire.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Silence ended a frame of the master's; every unit heard it.
    Heard {
        bytes: Vec<u8>,
        /// When the 3.5 characters of silence after it are over: the earliest that a unit may answer.
        silent: Instant,
    },
    /// A character from a unit arrived at the master.
    Delivered(u8),
}

/// When the wire wants to be stepped next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wakeup {
    pub(crate) at: Instant,
    /// Whether a master waits for this very moment: the last character of an answer.
    pub(crate) exact: bool,
}

/// From the first bit to the last.
#[derive(Debug, Clone, Copy)]
struct Span {
    begin: Instant,
    end: Instant,
}

impl Span {
    fn overlaps(self, other: Self) -> bool {
        self.begin < other.end && other.begin < self.end
    }
}

/// An answer that waits for its moment.
#[derive(Debug)]
struct Waiting {
    unit: u8,
    begin: Instant,
    bytes: Vec<u8>,
}

/// An answer that is on the wire.
#[derive(Debug)]
struct Talking {
    begin: Instant,
    bytes: Vec<u8>,
    delivered: usize,
}

/// What the master has sent since the last silence.
#[derive(Debug, Default)]
struct Heard {
    characters: Vec<(u8, Span)>,
    /// Units that insist on silence do not take this for a frame.
    ignored: bool,
}

/// The wire.
#[derive(Debug)]
pub(crate) struct Wire {
    format: SerialFormat,
    strict_silence: bool,
    heard: Heard,
    /// Frames that ended before their silence did, because the next request came too soon.
    cut_short: VecDeque<Step>,
    /// The master's latest run of characters without a gap.
    master: Option<Span>,
    talking: Option<Talking>,
    /// Sorted by their beginnings.
    waiting: VecDeque<Waiting>,
    answers: VecDeque<Span>,
    random: Random,
    pub(crate) spoil: Spoil,
    pub(crate) trace: Trace,
    pub(crate) requests: u64,
    pub(crate) silence_violations: u64,
    pub(crate) collisions: u64,
}

impl Wire {
    pub(crate) fn new(format: SerialFormat, strict_silence: bool, random: Random) -> Self {
        Self {
            format,
            strict_silence,
            heard: Heard::default(),
            cut_short: VecDeque::new(),
            master: None,
            talking: None,
            waiting: VecDeque::new(),
            answers: VecDeque::new(),
            random,
            spoil: Spoil::default(),
            trace: Trace::default(),
            requests: 0,
            silence_violations: 0,
            collisions: 0,
        }
    }

    /// The master sends `bytes` in one piece; returns when the last character has left.
    ///
    /// They start now, or where the previous piece ends if that is still on its way.
    pub(crate) fn transmit(&mut self, now: Instant, bytes: &[u8]) -> Instant {
        let begin = self.master.map_or(now, |span| now.max(span.end));
        if bytes.is_empty() {
            return begin;
        }
        let whole = self.heard_is_whole();
        if self.heard.characters.is_empty() || whole {
            let too_soon = self.last_bit().is_some_and(|last| begin < last + self.format.t35());
            self.requests += 1;
            self.silence_violations += u64::from(too_soon);
            self.trace.begin(begin, Side::Master, bytes);
            if self.strict_silence {
                // Without the silence this is, to a unit, more of what came before; its CRC cannot be right.
                self.heard.ignored |= too_soon;
            } else if whole {
                self.end_frame();
            }
        } else {
            self.trace.extend(Side::Master, bytes);
        }

        let ends = (1..=u32::MAX).map(|count| begin + self.format.chars(count));
        let mut end = begin;
        for (&byte, char_end) in bytes.iter().zip(ends) {
            if self.heard.characters.len() < LONGEST_HEARD {
                self.heard.characters.push((byte, Span { begin: end, end: char_end }));
            } else {
                self.heard.ignored = true;
            }
            end = char_end;
        }
        self.master = Some(match self.master {
            Some(span) if span.end == begin => Span { begin: span.begin, end },
            _ => Span { begin, end },
        });
        end
    }

    /// `unit` answers, from `begin` on, after whatever the wire was told to do to answers.
    ///
    /// Assumption: a unit answers in the order it was asked, so an answer that is held back holds back those after it.
    pub(crate) fn answer(&mut self, unit: u8, begin: Instant, answer: &[u8]) {
        let Some((bytes, delay)) = self.spoil.apply(answer) else { return };
        if bytes.is_empty() {
            return;
        }
        let earlier = self.waiting.iter().rfind(|waiting| waiting.unit == unit).map(|waiting| waiting.begin);
        let begin = earlier.map_or(begin + delay, |earlier| earlier.max(begin + delay));
        let place = self.waiting.partition_point(|waiting| waiting.begin <= begin);
        self.waiting.insert(place, Waiting { unit, begin, bytes });
    }

    /// What happens next, not later than `to`. `None`: nothing does.
    pub(crate) fn step(&mut self, to: Instant) -> Option<Step> {
        loop {
            if let Some(step) = self.cut_short.pop_front() {
                return Some(step);
            }
            let next = self.next_wakeup()?.at;
            if next > to {
                return None;
            }
            if self.heard_until() == Some(next) {
                self.end_frame();
            } else if self.talking.is_some() {
                return self.deliver();
            } else {
                self.begin_answer(next);
            }
        }
    }

    /// When to call [`step`](Self::step) next.
    pub(crate) fn next_wakeup(&self) -> Option<Wakeup> {
        let character = match (&self.talking, self.waiting.front()) {
            (Some(talking), _) => {
                Some(Wakeup { at: self.char_end(talking), exact: talking.delivered + 1 == talking.bytes.len() })
            }
            (None, Some(waiting)) => Some(Wakeup { at: self.earliest(waiting), exact: false }),
            (None, None) => None,
        };
        let frame = self.heard_until().map(|at| Wakeup { at, exact: false });
        [frame, character].into_iter().flatten().min_by_key(|wakeup| wakeup.at)
    }

    /// The end of the last character from either side; in the future while one is under way.
    fn last_bit(&self) -> Option<Instant> {
        self.master.map(|span| span.end).max(self.answers.back().map(|span| span.end))
    }

    /// Whether what was heard so far is a frame, and only the silence after it is missing.
    fn heard_is_whole(&self) -> bool {
        let bytes: Vec<u8> = self.heard.characters.iter().map(|&(byte, _)| byte).collect();
        Frame::parse(&bytes).is_ok()
    }

    /// When silence ends the frame that is being heard.
    fn heard_until(&self) -> Option<Instant> {
        let (_, last) = self.heard.characters.last()?;
        Some(last.end + self.format.t35())
    }

    /// The frame is over: what the units heard of it.
    fn end_frame(&mut self) {
        let Some(silent) = self.heard_until() else { return };
        let heard = std::mem::take(&mut self.heard);
        let mut bytes = Vec::with_capacity(heard.characters.len());
        for (byte, span) in heard.characters {
            let spoilt = self.answers.iter().any(|answer| answer.overlaps(span));
            bytes.push(if spoilt { self.garble(byte) } else { byte });
        }
        if !heard.ignored {
            self.cut_short.push_back(Step::Heard { bytes, silent });
        }
    }

    /// Assumption: a unit that is to speak while another speaks waits for it and for the silence after it.
    fn earliest(&self, waiting: &Waiting) -> Instant {
        let silent = self.answers.back().map_or(Instant::ZERO, |span| span.end + self.format.t35());
        waiting.begin.max(silent)
    }

    fn begin_answer(&mut self, begin: Instant) {
        let Some(Waiting { bytes, .. }) = self.waiting.pop_front() else { return };
        let count = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        if self.answers.len() == SPANS_KEPT {
            self.answers.pop_front();
        }
        self.answers.push_back(Span { begin, end: begin + self.format.chars(count) });
        self.trace.begin(begin, Side::Unit, &bytes);
        self.talking = Some(Talking { begin, bytes, delivered: 0 });
    }

    fn char_end(&self, talking: &Talking) -> Instant {
        talking.begin + self.chars(talking.delivered + 1)
    }

    fn chars(&self, count: usize) -> Duration {
        self.format.chars(u32::try_from(count).unwrap_or(u32::MAX))
    }

    /// One character of the answer arrives.
    fn deliver(&mut self) -> Option<Step> {
        let mut talking = self.talking.take()?;
        let character = Span { begin: talking.begin + self.chars(talking.delivered), end: self.char_end(&talking) };
        let sent = *talking.bytes.get(talking.delivered)?;
        talking.delivered += 1;
        if talking.delivered < talking.bytes.len() {
            self.talking = Some(talking);
        }
        let spoilt = self.master.is_some_and(|master| master.overlaps(character));
        Some(Step::Delivered(if spoilt { self.garble(sent) } else { sent }))
    }

    /// Both sides drove the wire: what arrives is neither's.
    fn garble(&mut self, byte: u8) -> u8 {
        self.collisions += 1;
        byte ^ self.random.next_nonzero()
    }
}
