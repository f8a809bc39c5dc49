//! One half-duplex wire: characters with their times, silence, collisions.
//!
//! It reads no clock: [`Wire::step`] says what happened next up to a moment. It knows frames only as far as silence
//! makes them; what they mean is the units' business.

use std::collections::VecDeque;
use std::time::Duration;

use drivebus_rtu::{Instant, SerialFormat};

use crate::faults::{Faults, Hits, Outgoing};
use crate::heard::{Heard, Span};
use crate::random::Random;
use crate::spoil::Spoil;
use crate::trace::{Side, Trace};
use crate::world::Listener;

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
    /// A character from a unit arrived at every master.
    Delivered(u8),
    /// A character came back to the master that sent it.
    Echoed(Listener, u8),
}

/// When the wire wants to be stepped next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wakeup {
    pub(crate) at: Instant,
    /// Whether a master waits for this very moment: the last character of an answer.
    pub(crate) exact: bool,
}

/// An answer that waits for its moment.
#[derive(Debug)]
struct Waiting {
    unit: u8,
    begin: Instant,
    bytes: Vec<u8>,
    pauses: VecDeque<(usize, Duration)>,
}

/// An answer that is on the wire.
#[derive(Debug)]
struct Talking {
    /// Where the characters that come next without a pause begin.
    begin: Instant,
    bytes: Vec<u8>,
    /// The first of those characters.
    from: usize,
    delivered: usize,
    /// Before which character, and how long.
    pauses: VecDeque<(usize, Duration)>,
}

impl Talking {
    /// The first character of the next pause, or the end.
    fn until(&self) -> usize {
        self.pauses.front().map_or(self.bytes.len(), |&(before, _)| before)
    }
}

/// A character on its way back to its master.
#[derive(Debug)]
struct Echo {
    to: Listener,
    byte: u8,
    span: Span,
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
    echoes: VecDeque<Echo>,
    /// Whether masters hear what they send.
    pub(crate) echo: bool,
    random: Random,
    pub(crate) spoil: Spoil,
    pub(crate) faults: Faults,
    pub(crate) trace: Trace,
    pub(crate) requests: u64,
    pub(crate) silence_violations: u64,
    pub(crate) collisions: u64,
}

impl Wire {
    pub(crate) fn new(format: SerialFormat, strict_silence: bool, seed: u64) -> Self {
        Self {
            format,
            strict_silence,
            heard: Heard::default(),
            cut_short: VecDeque::new(),
            master: None,
            talking: None,
            waiting: VecDeque::new(),
            answers: VecDeque::new(),
            echoes: VecDeque::new(),
            echo: false,
            random: Random::new(seed),
            spoil: Spoil::default(),
            faults: Faults::new(seed, format.t35()),
            trace: Trace::default(),
            requests: 0,
            silence_violations: 0,
            collisions: 0,
        }
    }

    /// The master that hears as `from` sends `bytes` in one piece; returns when the last character has left.
    ///
    /// They start now, or where the previous piece ends if that is still on its way.
    pub(crate) fn transmit(&mut self, from: Listener, now: Instant, bytes: &[u8]) -> Instant {
        let begin = self.master.map_or(now, |span| now.max(span.end));
        if bytes.is_empty() {
            return begin;
        }
        let whole = self.heard.is_whole();
        if self.heard.is_empty() || whole {
            let too_soon = self.last_bit().is_some_and(|last| begin < last + self.format.t35());
            self.requests += 1;
            self.silence_violations += u64::from(too_soon);
            self.trace.begin(begin, Side::Master, bytes);
            if self.strict_silence {
                // Without the silence this is, to a unit, more of what came before; its CRC cannot be right.
                if too_soon {
                    self.heard.ignore();
                }
            } else if whole {
                self.end_frame();
            }
        } else {
            self.trace.extend(Side::Master, bytes);
        }

        let ends = (1..=u32::MAX).map(|count| begin + self.format.chars(count));
        let mut end = begin;
        for (&byte, char_end) in bytes.iter().zip(ends) {
            let span = Span { begin: end, end: char_end };
            self.heard.push(byte, span);
            if self.echo {
                self.echoes.push_back(Echo { to: from, byte, span });
            }
            end = char_end;
        }
        self.master = Some(match self.master {
            Some(span) if span.end == begin => Span { begin: span.begin, end },
            _ => Span { begin, end },
        });
        end
    }

    /// The adapter is pulled out: what it was still sending is cut off.
    pub(crate) fn cut_off(&mut self, now: Instant) {
        self.heard.cut(now);
        self.echoes.clear();
        if let Some(master) = &mut self.master {
            master.end = master.end.min(now);
        }
    }

    /// `unit` answers, from `begin` on, after whatever the wire was told to do to answers, and whatever `hits` it.
    ///
    /// Assumption: a unit answers in the order it was asked, so an answer that is held back holds back those after it.
    pub(crate) fn answer(&mut self, unit: u8, begin: Instant, answer: &[u8], hits: Hits) {
        let spoilt = self.spoil.apply(answer);
        let Some(outgoing) = spoilt.and_then(|outgoing| self.faults.apply(hits, outgoing)) else { return };
        let Outgoing { bytes, pauses, delay } = outgoing;
        if bytes.is_empty() {
            return;
        }
        let earlier = self.waiting.iter().rfind(|waiting| waiting.unit == unit).map(|waiting| waiting.begin);
        let begin = earlier.map_or(begin + delay, |earlier| earlier.max(begin + delay));
        let place = self.waiting.partition_point(|waiting| waiting.begin <= begin);
        self.waiting.insert(place, Waiting { unit, begin, bytes, pauses: pauses.into() });
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
            } else if self.echoes.front().is_some_and(|echo| echo.span.end == next) {
                return self.echo_back();
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
                Some(Wakeup { at: self.char_end(talking), exact: talking.delivered + 1 == talking.until() })
            }
            (None, Some(waiting)) => Some(Wakeup { at: self.earliest(waiting), exact: false }),
            (None, None) => None,
        };
        let frame = self.heard_until().map(|at| Wakeup { at, exact: false });
        let echo = self.echoes.front().map(|echo| Wakeup { at: echo.span.end, exact: false });
        [frame, echo, character].into_iter().flatten().min_by_key(|wakeup| wakeup.at)
    }

    /// Whether more characters follow those that have come, without a pause.
    #[cfg(unix)]
    pub(crate) fn is_amid_run(&self) -> bool {
        !self.echoes.is_empty() || self.talking.as_ref().is_some_and(|talking| talking.delivered > talking.from)
    }

    /// When to call [`step`](Self::step) next, if it is enough to have `count` more characters at once, or as many as
    /// there are before a pause.
    #[cfg(unix)]
    pub(crate) fn next_lump(&self, count: usize) -> Option<Wakeup> {
        let answer = match (&self.talking, self.waiting.front()) {
            (Some(talking), _) => {
                let upto = talking.until().min(talking.delivered + count);
                let at = talking.begin + self.chars(upto - talking.from);
                Some(Wakeup { at, exact: upto == talking.until() })
            }
            (None, Some(waiting)) => {
                let run = waiting.pauses.front().map_or(waiting.bytes.len(), |&(before, _)| before);
                let at = self.earliest(waiting) + self.chars(run.min(count));
                Some(Wakeup { at, exact: run <= count })
            }
            (None, None) => None,
        };
        let frame = self.heard_until().map(|at| Wakeup { at, exact: false });
        let echo = self.echoes.get(count - 1).or(self.echoes.back());
        let echo = echo.map(|echo| Wakeup { at: echo.span.end, exact: false });
        [frame, echo, answer].into_iter().flatten().min_by_key(|wakeup| wakeup.at)
    }

    /// The end of the last character from either side; in the future while one is under way.
    fn last_bit(&self) -> Option<Instant> {
        self.master.map(|span| span.end).max(self.answers.back().map(|span| span.end))
    }

    /// When silence ends the frame that is being heard.
    fn heard_until(&self) -> Option<Instant> {
        self.heard.end().map(|end| end + self.format.t35())
    }

    /// The frame is over: what the units heard of it.
    fn end_frame(&mut self) {
        let Some(silent) = self.heard_until() else { return };
        let (answers, random, collisions) = (&self.answers, &mut self.random, &mut self.collisions);
        let bytes = self.heard.take(|byte, span| {
            if answers.iter().any(|answer| answer.overlaps(span)) { garble(byte, random, collisions) } else { byte }
        });
        if let Some(bytes) = bytes {
            self.cut_short.push_back(Step::Heard { bytes, silent });
        }
    }

    /// Assumption: a unit that is to speak while another speaks waits for it and for the silence after it.
    fn earliest(&self, waiting: &Waiting) -> Instant {
        let silent = self.answers.back().map_or(Instant::ZERO, |span| span.end + self.format.t35());
        waiting.begin.max(silent)
    }

    fn begin_answer(&mut self, begin: Instant) {
        let Some(Waiting { bytes, pauses, .. }) = self.waiting.pop_front() else { return };
        if self.answers.len() == SPANS_KEPT {
            self.answers.pop_front();
        }
        let paused: Duration = pauses.iter().map(|&(_, pause)| pause).sum();
        self.answers.push_back(Span { begin, end: begin + self.chars(bytes.len()) + paused });
        let talking = Talking { begin, bytes, from: 0, delivered: 0, pauses };
        self.trace.begin(begin, Side::Unit, &talking.bytes[..talking.until()]);
        self.talking = Some(talking);
    }

    fn char_end(&self, talking: &Talking) -> Instant {
        talking.begin + self.chars(talking.delivered - talking.from + 1)
    }

    fn chars(&self, count: usize) -> Duration {
        self.format.chars(u32::try_from(count).unwrap_or(u32::MAX))
    }

    /// One character of the answer arrives.
    fn deliver(&mut self) -> Option<Step> {
        let mut talking = self.talking.take()?;
        let end = self.char_end(&talking);
        let character = Span { begin: talking.begin + self.chars(talking.delivered - talking.from), end };
        let sent = *talking.bytes.get(talking.delivered)?;
        talking.delivered += 1;
        if talking.delivered < talking.bytes.len() {
            if let Some(&(before, pause)) = talking.pauses.front()
                && before == talking.delivered
            {
                talking.pauses.pop_front();
                (talking.begin, talking.from) = (end + pause, before);
                self.trace.begin(talking.begin, Side::Unit, &talking.bytes[before..talking.until()]);
            }
            self.talking = Some(talking);
        }
        let spoilt = self.master.is_some_and(|master| master.overlaps(character));
        Some(Step::Delivered(if spoilt { garble(sent, &mut self.random, &mut self.collisions) } else { sent }))
    }

    /// One character of a master's own comes back to it.
    fn echo_back(&mut self) -> Option<Step> {
        let Echo { to, byte, span } = self.echoes.pop_front()?;
        let spoilt = self.answers.iter().any(|answer| answer.overlaps(span));
        Some(Step::Echoed(to, if spoilt { garble(byte, &mut self.random, &mut self.collisions) } else { byte }))
    }
}

/// Both sides drove the wire: what arrives is neither's.
fn garble(byte: u8, random: &mut Random, collisions: &mut u64) -> u8 {
    *collisions += 1;
    byte ^ random.next_nonzero()
}
