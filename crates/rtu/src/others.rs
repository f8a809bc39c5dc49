//! What another master asks on the same line, as far as its answers are overheard.
//!
//! Some serial servers copy every byte of their line to all who are connected. So a master hears the answers to another's
//! questions, which say nothing of whom they are for. What nobody here asked for is taken down by its *shape*: unit,
//! function and length, and what an answer to a write repeats. From then on an answer of that shape proves nothing, until
//! none was heard for ten times as long as they were heard for, a minute at least.
//!
//! | comes from the unit that is asked | is |
//! | --- | --- |
//! | words, of a shape that another master asks for | nobody's answer: the read has to have another length |
//! | a refusal, of a function that another master uses | told at the end of the wait, where nothing better came |
//! | another length, another echo | the other's, where another uses the function; told at the end of the wait |
//! | the echo of 05H or 06H | the answer: whoever asked for it, the unit says that it took this value |
//!
//! What comes in first contact counts until that is over: it may answer what this program asked before it was started again.

use core::time::Duration;

use crate::expected::Expected;
use crate::frame::{Adu, Frame};
use crate::pdu::function::{EXCEPTION_BIT, WRITE_COILS, WRITE_MULTIPLE};
use crate::unit_set::UnitSet;
use crate::{Instant, UnitAddress};

/// How long what was heard once counts at least.
pub const OTHERS: Duration = Duration::from_secs(60);

/// How many times as long as it was heard for it counts.
const AS_LONG: u32 = 10;

/// Shapes that are told apart; of more, only the unit and the time are kept.
const KEPT: usize = 48;

/// What an answer looks like, whatever it says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shape {
    unit: u8,
    /// Without the bit that makes it a refusal.
    function: u8,
    /// Of the PDU; 0 for a refusal.
    len: u8,
    /// Address and count, where it repeats those.
    repeats: [u8; 4],
}

impl Shape {
    #[expect(clippy::cast_possible_truncation, reason = "at most 253 bytes")]
    fn of(frame: &Frame<'_>) -> Self {
        let (unit, pdu) = (frame.address(), frame.pdu());
        let (function, len, repeats) = match *pdu {
            [function, ..] if function & EXCEPTION_BIT != 0 => (function & !EXCEPTION_BIT, 0, [0; 4]),
            [function @ (WRITE_COILS | WRITE_MULTIPLE), a, b, c, d] => (function, 5, [a, b, c, d]),
            [function, ..] => (function, pdu.len() as u8, [0; 4]),
            [] => (0, 0, [0; 4]),
        };
        Self { unit, function, len, repeats }
    }
}

/// A shape that another master asked for.
#[derive(Debug, Clone, Copy)]
struct Theirs {
    shape: Shape,
    /// When it was heard first.
    first: Instant,
    /// How long it counts.
    until: Instant,
}

/// What was heard of others.
#[derive(Debug, Clone)]
pub(crate) struct Others {
    /// Whether there can be any.
    may_be: bool,
    heard: [Option<Theirs>; KEPT],
    /// Units of which something had to be forgotten, and until when the latest of it counts.
    forgotten: UnitSet,
    forgotten_until: Instant,
    /// What came last in the place of the answer in flight, and may be theirs.
    passed: Adu,
}

impl Others {
    pub(crate) const NONE: Self = Self {
        may_be: false,
        heard: [None; KEPT],
        forgotten: UnitSet::EMPTY,
        forgotten_until: Instant::ZERO,
        passed: Adu::new(),
    };

    /// Whether there may be others from now on.
    pub(crate) const fn expect(&mut self, may_be: bool) {
        self.may_be = may_be;
    }

    /// Whether there may be others.
    pub(crate) const fn may_be(&self) -> bool {
        self.may_be
    }

    /// `frame` came, which nobody here asked for. `strange_until`: where it may be an own answer from before, until when
    /// that is so.
    #[cold]
    pub(crate) fn hear(&mut self, now: Instant, frame: &Frame<'_>, strange_until: Option<Instant>) {
        let shape = Shape::of(frame);
        let known = self.heard.iter().flatten().find(|theirs| theirs.shape == shape);
        let first = known.filter(|_| strange_until.is_none()).map_or(now, |theirs| theirs.first);
        let counts = OTHERS.max(now.saturating_duration_since(first).saturating_mul(AS_LONG));
        let until = strange_until.unwrap_or(now + counts);
        let until = known.map_or(until, |theirs| theirs.until.max(until));
        let theirs = Theirs { shape, first, until };
        let is_same = |place: &Option<Theirs>| place.is_some_and(|known| known.shape == shape);
        let is_free = |place: &Option<Theirs>| place.is_none_or(|known| now >= known.until);
        let place = self.heard.iter().position(is_same).or_else(|| self.heard.iter().position(is_free));
        if let Some(place) = place {
            self.heard[place] = Some(theirs);
        } else if let Some(oldest) = self.heard.iter_mut().flatten().min_by_key(|theirs| theirs.until) {
            if let Some(unit) = UnitAddress::of_answer(oldest.shape.unit) {
                self.forgotten.insert(unit);
                self.forgotten_until = self.forgotten_until.max(oldest.until);
            }
            *oldest = theirs;
        }
    }

    /// Until when the answer of `unit` to `expected` may be that to another's question; `None`: it is not.
    #[inline]
    pub(crate) fn ask(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Option<Instant> {
        if self.may_be { self.look_up(now, unit, expected) } else { None }
    }

    #[cold]
    fn look_up(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Option<Instant> {
        if expected.is_echo() || expected.repeats_value() {
            return None;
        }
        let fits = |shape: &Shape| {
            let len = expected.pdu_len().is_none_or(|len| len == usize::from(shape.len));
            shape.len != 0 && len && expected.repeats().is_none_or(|repeats| repeats == shape.repeats)
        };
        let same = self.at(now, unit, expected.function()).filter(|theirs| fits(&theirs.shape));
        same.map(|theirs| theirs.until).chain(self.has_forgotten(now, unit)).max()
    }

    /// Whether others use the function of `expected` at `unit`: then neither a refusal nor what does not fit need be its own.
    pub(crate) fn use_function(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        self.may_be
            && (self.at(now, unit, expected.function()).next().is_some() || self.has_forgotten(now, unit).is_some())
    }

    /// Whether others ask `unit` anything.
    pub(crate) fn are_at(&self, now: Instant, unit: UnitAddress) -> bool {
        let is_there = |theirs: &Theirs| theirs.shape.unit == unit.get() && now < theirs.until;
        self.may_be && (self.heard.iter().flatten().any(is_there) || self.has_forgotten(now, unit).is_some())
    }

    /// A request goes out: nothing came in its answer's place yet.
    #[inline]
    pub(crate) const fn goes_out(&mut self) {
        self.passed.clear();
    }

    /// `frame` came in the place of the answer in flight, and may be theirs.
    #[cold]
    pub(crate) fn pass(&mut self, frame: &Frame<'_>) {
        self.passed = Adu::copy_of(frame);
    }

    /// What came last in the place of the answer in flight, if anything did.
    pub(crate) fn passed(&self) -> Option<Frame<'_>> {
        let bytes = self.passed.as_bytes();
        (!bytes.is_empty()).then(|| Frame::found(bytes))
    }

    fn at(&self, now: Instant, unit: UnitAddress, function: u8) -> impl Iterator<Item = &Theirs> {
        let is_it = move |theirs: &&Theirs| {
            theirs.shape.unit == unit.get() && theirs.shape.function == function && now < theirs.until
        };
        self.heard.iter().flatten().filter(is_it)
    }

    fn has_forgotten(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        (now < self.forgotten_until && self.forgotten.contains(unit)).then_some(self.forgotten_until)
    }
}
