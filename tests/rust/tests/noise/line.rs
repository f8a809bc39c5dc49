//! A line in virtual time on which characters are damaged, and a unit behind it: character by character, as a wire has them.
//!
//! A register holds a word that depends on its address, so that a wrong answer shows.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{Line, LineClock, PortError};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Frame, Instant, Request, SerialFormat, UnitAddress};

/// The most words that the unit gives at once.
pub(crate) const LONGEST: u16 = 16;

/// A small generator (SplitMix64).
#[derive(Debug, Clone)]
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    pub(crate) fn word(&mut self) -> u16 {
        let [high, low, ..] = self.next().to_be_bytes();
        u16::from_be_bytes([high, low])
    }

    /// In `percent` of a hundred.
    fn happens(&mut self, percent: u64) -> bool {
        self.next() % 100 < percent
    }
}

/// What the unit makes of 08H.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Echoing {
    Returns,
    Refuses,
    Silent,
}

/// What goes wrong, each in hundredths: of the characters of answers, or of the answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Noise {
    /// Characters of which a bit is turned over.
    pub(crate) flipped: u64,
    /// Characters that are lost; those behind them come in their own time.
    pub(crate) lost: u64,
    /// Answers that are lost.
    pub(crate) missing: u64,
    /// Answers that come 150 ms later.
    pub(crate) late: u64,
    /// Whether those behind a late one come before it; else it holds them back.
    pub(crate) overtaking: bool,
}

impl Noise {
    pub(crate) const NONE: Self = Self { flipped: 0, lost: 0, missing: 0, late: 0, overtaking: false };
}

const LATE: Duration = Duration::from_millis(150);

/// The word in register `address`.
pub(crate) const fn word(address: u16) -> u16 {
    let mixed = (address as u32 ^ 0x9E37).wrapping_mul(0x85EB_CA6B);
    let [_, _, high, low] = (mixed ^ (mixed >> 15)).to_be_bytes();
    u16::from_be_bytes([high, low])
}

/// An answer on its way: when it is due, and its characters, of which the lost ones are none.
#[derive(Debug)]
struct Answering {
    due: Instant,
    characters: Vec<Option<u8>>,
}

/// What is on the wire, and when.
#[derive(Debug)]
pub(crate) struct Wire {
    pub(crate) now: Instant,
    format: SerialFormat,
    noise: Noise,
    echoing: Echoing,
    chance: Chance,
    /// When the last character ends that is on the wire.
    busy: Instant,
    /// Until when the unit is held up.
    held_up: Instant,
    answering: Vec<Answering>,
    coming: VecDeque<(Instant, u8)>,
}

impl Wire {
    fn answer(&mut self, request: &[u8]) -> Option<Vec<u8>> {
        let frame = Frame::parse(request).ok()?;
        let request = Request::parse(frame.pdu()).ok()?;
        let refusal = |code| Answer::exception(frame.pdu()[0], ExceptionCode(code));
        let words: Vec<u16>;
        let answer = match request {
            Request::Read { address, count, .. } if count <= LONGEST => {
                words = (address..address + count).map(word).collect();
                Answer::read(&words).ok()?
            }
            Request::Read { .. } => refusal(3),
            Request::Echo { .. } => match self.echoing {
                Echoing::Returns => Answer::confirming(&request)?,
                Echoing::Refuses => refusal(1),
                Echoing::Silent => return None,
            },
            _ => Answer::confirming(&request)?,
        };
        Some(Adu::answer(UnitAddress::new(frame.address()).ok()?, &answer).as_bytes().to_vec())
    }

    fn hear(&mut self, request: &[u8]) {
        let Some(answer) = self.answer(request).filter(|_| !self.chance.happens(self.noise.missing)) else { return };
        let Noise { flipped, lost, late, overtaking, .. } = self.noise;
        let chance = &mut self.chance;
        let spoilt = answer.into_iter().map(|byte| {
            let byte = if chance.happens(flipped) { byte ^ (1 << (chance.next() % 8)) } else { byte };
            (!chance.happens(lost)).then_some(byte)
        });
        let characters: Vec<Option<u8>> = spoilt.collect();
        let is_late = chance.happens(late);
        let mut due = self.busy + self.format.t35() + if is_late { LATE } else { Duration::ZERO };
        if !overtaking {
            let was_held_up = due < self.held_up;
            due = due.max(self.held_up);
            if is_late || was_held_up {
                self.held_up = due + self.time_of(characters.len()) + self.format.t35();
            }
        }
        self.answering.push(Answering { due, characters });
    }

    fn time_of(&self, characters: usize) -> Duration {
        self.format.chars(u32::try_from(characters).unwrap())
    }

    /// Puts on the wire what is due first, if that is by `until`.
    fn put_first(&mut self, until: Instant) -> bool {
        let first = (0..self.answering.len()).min_by_key(|&place| self.answering[place].due);
        let Some(first) = first.filter(|&first| self.answering[first].due <= until) else { return false };
        let Answering { due, characters } = self.answering.remove(first);
        let begin = due.max(self.busy);
        for (place, character) in characters.iter().enumerate() {
            if let Some(byte) = character {
                self.coming.push_back((begin + self.time_of(place + 1), *byte));
            }
        }
        self.busy = begin + self.time_of(characters.len());
        true
    }

    /// When the next character arrives, no later than `until`, as far as nobody sends anything.
    fn front(&self, until: Instant) -> Instant {
        self.coming.front().map_or(until, |&(at, _)| at.min(until))
    }

    /// Sends `request`, and returns when its last bit has left.
    pub(crate) fn send(&mut self, request: &[u8]) -> Instant {
        while self.put_first(self.now) {}
        let begin = self.now;
        // Two at a time: neither is heard.
        let collides = self.busy > begin;
        let end = begin + self.time_of(request.len());
        if collides {
            self.coming.retain(|&(at, _)| at <= begin);
        }
        self.busy = self.busy.max(end);
        if !collides {
            self.hear(request);
        }
        end
    }

    /// The next character that arrives until `until`; `None`: it is `until` then.
    pub(crate) fn next(&mut self, until: Instant) -> Option<u8> {
        let until = until.max(self.now);
        // What comes later is put on the wire later: who sends until then finds it free.
        while self.put_first(self.front(until)) {}
        match self.coming.front() {
            Some(&(at, byte)) if at <= until => {
                self.now = self.now.max(at);
                self.coming.pop_front();
                Some(byte)
            }
            _ => {
                self.now = until;
                None
            }
        }
    }
}

/// A line that a bus and a test hold.
#[derive(Debug, Clone)]
pub(crate) struct NoisyLine(pub(crate) Arc<Mutex<Wire>>);

impl NoisyLine {
    pub(crate) fn new(format: SerialFormat, noise: Noise, echoing: Echoing, seed: u64) -> Self {
        let wire = Wire {
            now: Instant::ZERO,
            format,
            noise,
            echoing,
            chance: Chance(seed),
            busy: Instant::ZERO,
            held_up: Instant::ZERO,
            answering: Vec::new(),
            coming: VecDeque::new(),
        };
        Self(Arc::new(Mutex::new(wire)))
    }

    pub(crate) fn now(&self) -> Instant {
        self.0.lock().unwrap().now
    }

    /// As [`Wire::send`].
    pub(crate) fn send_now(&self, request: &[u8]) -> Instant {
        self.0.lock().unwrap().send(request)
    }

    /// As [`Wire::next`].
    pub(crate) fn next(&self, until: Instant) -> Option<u8> {
        self.0.lock().unwrap().next(until)
    }
}

impl Line for NoisyLine {
    fn now(&self) -> Instant {
        self.0.lock().unwrap().now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        Ok(self.0.lock().unwrap().send(bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut wire = self.0.lock().unwrap();
        let (Some(byte), [first, ..]) = (wire.next(until), buffer) else { return Ok(0) };
        *first = byte;
        Ok(1)
    }

    fn sleep(&mut self, until: Instant) {
        let mut wire = self.0.lock().unwrap();
        wire.now = wire.now.max(until);
    }

    fn char_time(&self) -> Option<Duration> {
        Some(self.0.lock().unwrap().format.chars(1))
    }

    fn name(&self) -> String {
        "noisy".to_owned()
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn clock(&self) -> Option<LineClock> {
        let wire = Arc::clone(&self.0);
        Some(Arc::new(move || wire.lock().unwrap().now))
    }
}
