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

/// Answers that may overlap one request; older ones are over.
const SPANS_KEPT: usize = 16;

/// Names one of the masters on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Listener(u64);

impl Listener {
    /// The one of this number.
    pub(crate) const fn new(number: u64) -> Self {
        Self(number)
    }

    /// Chance of its own, from the seed of the world.
    pub(crate) fn chance(self, seed: u64) -> u64 {
        Random::of(seed, self.0)
    }
}

/// What happened on the wire.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Silence ended a frame of the master's; every unit heard it.
    Heard {
        bytes: Vec<u8>,
        /// When the 3.5 characters of silence after it are over: the earliest that a unit may answer.
        silent: Instant,
    },
    /// What is in [`Wire::arrived`] came from a unit and arrived at every master: a character, or several of which
    /// nothing can tell that they did not come one by one.
    Delivered,
    /// A character of a master's has passed: `back` says whether its adapter hands it back.
    Passed { from: Listener, byte: u8, back: bool },
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
    may_be_passed: bool,
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
    /// When the next character is over.
    next_end: Instant,
    /// Before which character, and how long.
    pauses: VecDeque<(usize, Duration)>,
}

impl Talking {
    /// The first character of the next pause, or the end.
    fn until(&self) -> usize {
        self.pauses.front().map_or(self.bytes.len(), |&(before, _)| before)
    }
}

/// A character of a master's that it hears again, or an ear does.
#[derive(Debug)]
struct Echo {
    from: Listener,
    byte: u8,
    span: Span,
    back: bool,
}

/// The wire.
#[derive(Debug)]
pub(crate) struct Wire {
    format: SerialFormat,
    /// Of the format.
    t35: Duration,
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
    /// What was delivered last.
    pub(crate) arrived: Vec<u8>,
    /// The buffer of a frame that is over, for the next one.
    pub(crate) spare_frame: Vec<u8>,
    /// The same of an answer.
    spare_answer: Vec<u8>,
    /// Every character for itself, also where nothing can interfere.
    #[cfg(test)]
    pub(crate) plodding: bool,
    /// Whether masters hear what they send.
    pub(crate) echo: bool,
    /// How many others do.
    pub(crate) ears: usize,
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
            t35: format.t35(),
            strict_silence,
            heard: Heard::default(),
            cut_short: VecDeque::new(),
            master: None,
            talking: None,
            waiting: VecDeque::new(),
            answers: VecDeque::new(),
            echoes: VecDeque::new(),
            arrived: Vec::new(),
            spare_frame: Vec::new(),
            spare_answer: Vec::new(),
            #[cfg(test)]
            plodding: false,
            echo: false,
            ears: 0,
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
    /// They start now, or where the previous piece ends if that is still on its way. `sent_as` is what the master's
    /// adapter is set to, where that is not what the units are set to: none of them then makes anything of it.
    pub(crate) fn transmit(
        &mut self,
        from: Listener,
        now: Instant,
        bytes: &[u8],
        sent_as: Option<SerialFormat>,
    ) -> Instant {
        let begin = self.master.map_or(now, |span| now.max(span.end));
        if bytes.is_empty() {
            return begin;
        }
        let whole = !self.heard.is_empty() && self.heard.is_whole();
        if self.heard.is_empty() || whole {
            let too_soon = self.last_bit().is_some_and(|last| begin < last + self.t35);
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

        let format = sent_as.unwrap_or(self.format);
        self.heard.push(bytes, begin, &format);
        if sent_as.is_some() {
            self.heard.ignore();
        }
        if self.echo || self.ears > 0 {
            let back = self.echo;
            let spans = (0..).map(|place| Span::of_char(&format, begin, place));
            self.echoes.extend(bytes.iter().zip(spans).map(|(&byte, span)| Echo { from, byte, span, back }));
        }
        let end = Span::of_char(&format, begin, bytes.len() - 1).end;
        self.master = Some(match self.master {
            Some(span) if span.end == begin => Span { begin: span.begin, end },
            _ => Span { begin, end },
        });
        end
    }

    /// The adapter is pulled out: what it was still sending is cut off.
    pub(crate) fn cut_off(&mut self, now: Instant) {
        self.heard.cut(now, &self.format);
        self.echoes.clear();
        if let Some(master) = &mut self.master {
            master.end = master.end.min(now);
        }
    }

    /// What units and adapters that fit are set to.
    pub(crate) fn format(&self) -> &SerialFormat {
        &self.format
    }

    /// Sets every unit to `format`. What is on its way is lost.
    pub(crate) fn set_format(&mut self, now: Instant, format: SerialFormat) {
        self.cut_off(now);
        self.heard = Heard::default();
        self.cut_short.clear();
        self.talking = None;
        self.waiting.clear();
        for answer in &mut self.answers {
            answer.end = answer.end.min(now).max(answer.begin);
        }
        self.format = format;
        self.t35 = format.t35();
        self.faults.silence = self.t35;
    }

    /// What arrives where an adapter is set to something else than the units: as many characters, none of them right.
    pub(crate) fn misread(&mut self) -> Vec<u8> {
        self.arrived.iter().map(|byte| byte ^ self.random.next_nonzero()).collect()
    }

    /// The same of one character.
    pub(crate) fn misread_one(&mut self, byte: u8) -> u8 {
        byte ^ self.random.next_nonzero()
    }

    /// `unit` answers, from `begin` on, after whatever the wire was told to do to answers, and whatever `hits` it.
    ///
    /// Assumption: a unit answers in the order it was asked, so an answer that is held back holds back those after it. Only
    /// one that may be passed does not.
    pub(crate) fn answer(&mut self, unit: u8, begin: Instant, answer: &[u8], hits: Hits) {
        let outgoing = if self.spoil.is_idle() {
            let mut bytes = std::mem::take(&mut self.spare_answer);
            bytes.clear();
            bytes.extend_from_slice(answer);
            Some(Outgoing { bytes, ..Outgoing::default() })
        } else {
            self.spoil.apply(answer)
        };
        let outgoing = outgoing.and_then(|outgoing| self.faults.apply(hits, outgoing));
        let Some(Outgoing { bytes, pauses, delay, may_be_passed }) = outgoing else { return };
        if bytes.is_empty() {
            return;
        }
        let holds_back = |waiting: &&Waiting| waiting.unit == unit && !waiting.may_be_passed;
        let earlier = self.waiting.iter().rfind(holds_back).map(|waiting| waiting.begin);
        let begin = earlier.map_or(begin + delay, |earlier| earlier.max(begin + delay));
        let place = self.waiting.partition_point(|waiting| waiting.begin <= begin);
        self.waiting.insert(place, Waiting { unit, begin, bytes, pauses: pauses.into(), may_be_passed });
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
                return self.pass();
            } else if self.talking.is_some() {
                return self.deliver(to);
            } else {
                self.begin_answer(next);
            }
        }
    }

    /// When to call [`step`](Self::step) next.
    pub(crate) fn next_wakeup(&self) -> Option<Wakeup> {
        let character = match (&self.talking, self.waiting.front()) {
            (Some(talking), _) => {
                Some(Wakeup { at: talking.next_end, exact: talking.delivered + 1 == talking.until() })
            }
            (None, Some(waiting)) => Some(Wakeup { at: self.earliest(waiting), exact: false }),
            (None, None) => None,
        };
        let frame = self.heard_until().map(|at| Wakeup { at, exact: false });
        let echo = self.echoes.front().map(|echo| Wakeup { at: echo.span.end, exact: false });
        [frame, echo, character].into_iter().flatten().min_by_key(|wakeup| wakeup.at)
    }

    /// Whether more characters follow those that have come, without a pause; `by_all`: of masters too.
    #[cfg(unix)]
    pub(crate) fn is_amid_run(&self, by_all: bool) -> bool {
        (by_all && !self.echoes.is_empty())
            || self.talking.as_ref().is_some_and(|talking| talking.delivered > talking.from)
    }

    /// When to call [`step`](Self::step) next, if `count` more characters at once are enough, or all before a pause.
    #[cfg(unix)]
    pub(crate) fn next_lump(&self, count: usize) -> Option<Wakeup> {
        // Of two that may speak at once, each character counts: both fill one FIFO.
        let both = !self.echoes.is_empty() && (self.talking.is_some() || !self.waiting.is_empty());
        let count = if both { 1 } else { count };
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
        self.heard.end().map(|end| end + self.t35)
    }

    /// The frame is over: what the units heard of it.
    fn end_frame(&mut self) {
        let Some(silent) = self.heard_until() else { return };
        let (answers, random, collisions) = (&self.answers, &mut self.random, &mut self.collisions);
        // Answers come one after the other: where the last one was over, all were.
        let alone = answers.back().is_none_or(|last| self.heard.begin().is_some_and(|begin| last.end <= begin));
        let spoil = (!alone).then_some(|byte: u8, span: Span| {
            if answers.iter().any(|answer| answer.overlaps(span)) { garble(byte, random, collisions) } else { byte }
        });
        let mut bytes = std::mem::take(&mut self.spare_frame);
        if self.heard.take(&mut bytes, &self.format, spoil) {
            self.cut_short.push_back(Step::Heard { bytes, silent });
        } else {
            self.spare_frame = bytes;
        }
    }

    /// Assumption: a unit that is to speak while another speaks waits for it and for the silence after it.
    fn earliest(&self, waiting: &Waiting) -> Instant {
        let silent = self.answers.back().map_or(Instant::ZERO, |span| span.end + self.t35);
        waiting.begin.max(silent)
    }

    fn begin_answer(&mut self, begin: Instant) {
        let Some(Waiting { bytes, pauses, .. }) = self.waiting.pop_front() else { return };
        if self.answers.len() == SPANS_KEPT {
            self.answers.pop_front();
        }
        let paused: Duration = pauses.iter().map(|&(_, pause)| pause).sum();
        self.answers.push_back(Span { begin, end: begin + self.chars(bytes.len()) + paused });
        let next_end = begin + self.chars(1);
        let talking = Talking { begin, bytes, from: 0, delivered: 0, next_end, pauses };
        self.trace.begin(begin, Side::Unit, &talking.bytes[..talking.until()]);
        self.talking = Some(talking);
    }

    fn chars(&self, count: usize) -> Duration {
        self.format.chars(u32::try_from(count).unwrap_or(u32::MAX))
    }

    /// What comes of the answer until `to`, of which one character at least is over.
    ///
    /// Where the master is silent, and with it its echo, and no frame of it waits for its end, nothing can come between
    /// two characters of a run.
    fn deliver(&mut self, to: Instant) -> Option<Step> {
        let mut talking = self.talking.take()?;
        let begun = talking.delivered;
        let first = Span::of_char(&self.format, talking.begin, begun - talking.from);
        let master_is_over = self.master.is_none_or(|master| master.end <= first.begin);
        let mut upto = begun + 1;
        if master_is_over && self.heard.is_empty() && !self.plods() {
            upto = talking.until();
            if talking.begin + self.chars(upto - talking.from) > to {
                let whole = |place: &usize| talking.begin + self.chars(place + 1 - talking.from) <= to;
                upto = (begun + 1..upto).take_while(whole).last().map_or(begun + 1, |last| last + 1);
            }
        }
        self.arrived.clear();
        self.arrived.extend_from_slice(talking.bytes.get(begun..upto)?);
        if self.master.is_some_and(|master| master.overlaps(first)) {
            self.arrived[0] = garble(self.arrived[0], &mut self.random, &mut self.collisions);
        }
        talking.delivered = upto;
        if upto == talking.bytes.len() {
            self.spare_answer = talking.bytes;
            return Some(Step::Delivered);
        }
        if let Some(&(before, pause)) = talking.pauses.front()
            && before == upto
        {
            talking.pauses.pop_front();
            let end = talking.begin + self.chars(upto - talking.from);
            (talking.begin, talking.from) = (end + pause, before);
            self.trace.begin(talking.begin, Side::Unit, &talking.bytes[before..talking.until()]);
        }
        talking.next_end = talking.begin + self.chars(upto + 1 - talking.from);
        self.talking = Some(talking);
        Some(Step::Delivered)
    }

    #[cfg(test)]
    fn plods(&self) -> bool {
        self.plodding
    }

    #[cfg(not(test))]
    #[expect(clippy::unused_self, reason = "tests can ask for it")]
    const fn plods(&self) -> bool {
        false
    }

    /// One character of a master's own has passed.
    fn pass(&mut self) -> Option<Step> {
        let Echo { from, byte, span, back } = self.echoes.pop_front()?;
        let spoilt = self.answers.iter().any(|answer| answer.overlaps(span));
        // Who only overhears it adds nothing to what is counted.
        let mut uncounted = 0;
        let collisions = if back { &mut self.collisions } else { &mut uncounted };
        let byte = if spoilt { garble(byte, &mut self.random, collisions) } else { byte };
        Some(Step::Passed { from, byte, back })
    }
}

/// What a port of that speed is set to: for the rest, what the units are.
#[cfg(unix)]
pub(crate) fn at_speed(speed: u32, units: &SerialFormat) -> Option<SerialFormat> {
    SerialFormat::new(speed, units.data_bits(), units.parity(), units.stop_bits(), units.silence()).ok()
}

/// Both sides drove the wire: what arrives is neither's.
fn garble(byte: u8, random: &mut Random, collisions: &mut u64) -> u8 {
    *collisions += 1;
    byte ^ random.next_nonzero()
}
