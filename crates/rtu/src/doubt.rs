//! Which units may still answer something that was asked before, and how that doubt ends.
//!
//! RTU answers carry no number. What is remembered here is therefore all that tells a late answer from the right one:
//! what was asked of whom and left open, and whether another program may have asked before this one opened the line.
//!
//! | doubt ends by | which doubt | what is assumed of the unit |
//! | --- | --- | --- |
//! | the echo (08H) of a fresh word | any | it answers in the order it was asked |
//! | the answer to a read that no open answer could pass for | requests of our own | the same |
//! | the refusal of an echo (exception to 08H), while no other echo is open | requests of our own | the same |
//! | [`FIRST_CONTACT`] after the line was opened | questions of others | it answers within that time or never |
//! | [`PATIENCE`] after the last request it left open | requests of our own, to a unit that returns no echo | the same |
//!
//! Behind a gateway answers may overtake each other, and none of the orders above holds. There an open answer counts as
//! possible for [`OVERTAKING`], and a read that it could pass for has to be repeated: see [`Attribution`]. What another
//! client of the gateway asked is not known to anybody; at first contact an echo is believed there too.

use core::time::Duration;

use crate::answer::Expected;
use crate::unit_set::UnitSet;
use crate::{Instant, UnitAddress};

/// How long after a line was opened the answer to another program's question may come.
///
/// Five times the longest response delay that a drive known here can be set to (P14.03, 200 ms).
pub const FIRST_CONTACT: Duration = Duration::from_secs(1);

/// How long a unit that never returned an echo may owe an answer. After that it is taken as never to come.
pub const PATIENCE: Duration = Duration::from_secs(3);

/// How long behind a gateway an answer may be overtaken by later ones.
pub const OVERTAKING: Duration = Duration::from_secs(3);

/// Longest time that one answer given up may count as possible. Each answer taken meanwhile may have been the open one, so
/// that its own is open instead; an answer that is displaced so three times over is not expected of any gateway.
const LONGEST: Duration = Duration::from_secs(9);

/// After so many echoes that stayed open, one that returned some before counts as a unit that never did: another one may
/// have its address now.
const MUTE: u8 = 5;

/// Open requests that are told apart; of more, only the unit and the time are kept.
const KEPT: usize = 16;

/// More answers than this that could pass for one are waited for, not outvoted.
const MAX_RIVALS: u8 = 3;

/// How sure the answer to a request can be, before it is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attribution {
    /// What the master takes for the answer is the answer.
    Certain,
    /// Open answers behind a gateway could pass for it: a read has to bring the same words `words` times in a row, or
    /// the same refusal `refusal` times, so that at least one of them is the answer.
    Repeat {
        /// Times for the words read; 1 where no open answer could pass for them.
        words: u8,
        /// Times for a refusal.
        refusal: u8,
    },
    /// Open answers could pass for it, and repeating does not help: ask at this moment or later.
    Wait(Instant),
}

/// Requests of one kind to one unit that were left open.
#[derive(Debug, Clone, Copy)]
struct Open {
    unit: UnitAddress,
    expected: Expected,
    count: u8,
    /// When the latest of them was given up.
    given_up: Instant,
    /// The same, or when the latest answer was taken that one of them may have been.
    last: Instant,
}

/// All doubts of one line.
#[derive(Debug, Clone)]
pub(crate) struct Doubts {
    /// Units that another program may have asked, and until when that matters.
    strangers: UnitSet,
    strangers_until: Instant,
    /// Units that left a request of ours open.
    open: UnitSet,
    /// Units that have returned an echo, and did not leave [`MUTE`] open since.
    echoers: UnitSet,
    ledger: [Option<Open>; KEPT],
    /// Units of which something had to be forgotten, and when the latest of it was asked.
    forgotten: UnitSet,
    forgotten_at: Instant,
    overtaking: bool,
}

impl Doubts {
    pub(crate) const NONE: Self = Self {
        strangers: UnitSet::EMPTY,
        strangers_until: Instant::ZERO,
        open: UnitSet::EMPTY,
        echoers: UnitSet::EMPTY,
        ledger: [None; KEPT],
        forgotten: UnitSet::EMPTY,
        forgotten_at: Instant::ZERO,
        overtaking: false,
    };

    /// The line was opened at `now`: anybody may have asked anything before.
    pub(crate) fn opened(&mut self, now: Instant) {
        self.strangers = UnitSet::ALL;
        self.strangers_until = now + FIRST_CONTACT;
    }

    pub(crate) const fn may_overtake(&mut self, overtaking: bool) {
        self.overtaking = overtaking;
    }

    /// `unit` was asked for `expected`, and at `now` the answer is given up.
    pub(crate) fn left_open(&mut self, now: Instant, unit: UnitAddress, expected: Expected) {
        self.open.insert(unit);
        self.enter(now, unit, expected);
    }

    fn enter(&mut self, now: Instant, unit: UnitAddress, expected: Expected) {
        let alike = |open: &Open| {
            open.unit == unit && (open.expected == expected || (expected.is_echo() && open.expected.is_echo()))
        };
        if let Some(open) = self.ledger.iter_mut().flatten().find(|open| alike(open)) {
            open.count = open.count.saturating_add(1);
            open.given_up = now;
            open.last = now;
            if expected.is_echo() && open.count >= MUTE {
                self.echoers.remove(unit);
            }
            return;
        }
        let open = Open { unit, expected, count: 1, given_up: now, last: now };
        let over =
            |open: &Option<Open>| open.is_none_or(|open| !self.open.contains(open.unit) && is_past(now, open.last));
        if let Some(place) = self.ledger.iter().position(over) {
            self.ledger[place] = Some(open);
        } else if let Some(oldest) = self.ledger.iter_mut().flatten().min_by_key(|open| open.last) {
            self.forgotten.insert(oldest.unit);
            self.forgotten_at = self.forgotten_at.max(oldest.last);
            *oldest = open;
        }
    }

    /// Whether `unit` may still answer something else than what it is asked next.
    pub(crate) fn contains(&self, now: Instant, unit: UnitAddress) -> bool {
        self.is_strange(now, unit) || (self.open.contains(unit) && !self.is_over(now, unit))
    }

    /// Whether `unit` may owe anything, echoes included.
    pub(crate) fn may_owe_an_echo(&self, now: Instant, unit: UnitAddress) -> bool {
        self.is_strange(now, unit) || self.open.contains(unit)
    }

    /// Whether `unit` owes an answer, and what it answers to `expected` can still be told apart: what does not fit is
    /// late then, and not wrong.
    pub(crate) fn sorts_out(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        let owes = self.contains(now, unit) || (expected.is_echo() && self.open.contains(unit));
        owes && self.tells_apart(now, unit, expected)
    }

    /// Whether the answer of `unit` to `expected` cannot be mistaken for one that it may still give.
    pub(crate) fn tells_apart(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        expected.is_echo()
            || (expected.is_read()
                && !self.is_strange(now, unit)
                && !self.forgotten.contains(unit)
                && !self.of(unit).any(|open| open.expected.could_pass_for(expected)))
    }

    /// Whether a refusal that `unit` gives to `expected` may be meant for something else that it was asked before.
    pub(crate) fn may_refuse_another(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        let owes = self.contains(now, unit);
        let may_come = |last| owes || (self.overtaking && !is_past(now, last));
        let rival = |open: &Open| open.expected != expected && open.expected.function() == expected.function();
        self.is_strange(now, unit)
            || (self.forgotten.contains(unit) && may_come(self.forgotten_at))
            || self.of(unit).any(|open| rival(open) && may_come(open.last))
    }

    /// `unit` has answered what could not be mistaken, and with it everything before.
    pub(crate) fn settle(&mut self, unit: UnitAddress, echoed: bool) {
        self.strangers.remove(unit);
        self.open.remove(unit);
        if echoed {
            self.echoers.insert(unit);
        }
        if !self.overtaking {
            self.forget(unit, |_| true);
            self.forgotten.remove(unit);
        }
    }

    /// `unit` has refused an echo. Refusals look alike: where another echo is open, this may be the refusal of that one,
    /// and prove nothing of what was asked since.
    pub(crate) fn refused_echo(&mut self, now: Instant, unit: UnitAddress) {
        let earlier = self
            .of(unit)
            .any(|open| open.expected.function() == Expected::ECHO.function() && now < open.last + PATIENCE);
        if earlier || self.is_strange(now, unit) || self.forgotten.contains(unit) {
            self.left_open(now, unit, Expected::ECHO);
        } else {
            self.settle(unit, false);
        }
    }

    /// `unit` was asked for `expected`, and an answer or a refusal was taken for its own.
    pub(crate) fn taken(&mut self, now: Instant, unit: UnitAddress, expected: Expected, refused: bool) {
        if !self.overtaking {
            return;
        }
        let mut displaced = false;
        for open in self.ledger.iter_mut().flatten() {
            let rival =
                open.expected.could_pass_for(expected) || (refused && open.expected.function() == expected.function());
            if open.unit == unit && rival && !is_past(now, open.last) {
                open.last = now.min(open.given_up + LONGEST.saturating_sub(OVERTAKING));
                displaced |= open.expected != expected;
            }
        }
        if displaced {
            self.enter(now, unit, expected);
        }
    }

    /// How sure the answer of `unit` to `expected` can be, asked at `now`.
    pub(crate) fn attribution(&self, now: Instant, unit: UnitAddress, expected: Expected) -> Attribution {
        if !self.overtaking || expected.is_echo() {
            return Attribution::Certain;
        }
        if self.forgotten.contains(unit) && !is_past(now, self.forgotten_at) {
            return Attribution::Wait(self.forgotten_at + OVERTAKING);
        }
        let (mut words, mut refusal, mut latest) = (1_u8, 1_u8, None);
        for open in self.of(unit).filter(|open| !is_past(now, open.last)) {
            if open.expected.could_pass_for(expected) {
                words = words.saturating_add(open.count);
            }
            if open.expected.function() == expected.function() {
                refusal = refusal.saturating_add(open.count);
                latest = latest.max(Some(open.last + OVERTAKING));
            }
        }
        match latest {
            None => Attribution::Certain,
            Some(latest) if !expected.is_read() || refusal > 1 + MAX_RIVALS => Attribution::Wait(latest),
            Some(_) => Attribution::Repeat { words, refusal },
        }
    }

    /// When the doubt of first contact with `unit` will be over by itself, if there is one.
    pub(crate) fn first_contact_ends(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        self.is_strange(now, unit).then_some(self.strangers_until)
    }

    fn is_strange(&self, now: Instant, unit: UnitAddress) -> bool {
        self.strangers.contains(unit) && now < self.strangers_until
    }

    /// Whether `unit` never returned an echo and owes nothing any more.
    fn is_over(&self, now: Instant, unit: UnitAddress) -> bool {
        let forgotten = self.forgotten.contains(unit).then_some(self.forgotten_at);
        // An echo that is still open can be mistaken for nothing but an echo.
        let asked = self.of(unit).filter(|open| !open.expected.is_echo()).map(|open| open.last).max().max(forgotten);
        !self.echoers.contains(unit) && asked.is_none_or(|asked| now >= asked + PATIENCE)
    }

    fn of(&self, unit: UnitAddress) -> impl Iterator<Item = &Open> {
        self.ledger.iter().flatten().filter(move |open| open.unit == unit)
    }

    fn forget(&mut self, unit: UnitAddress, which: impl Fn(&Open) -> bool) {
        for place in &mut self.ledger {
            if place.as_ref().is_some_and(|open| open.unit == unit && which(open)) {
                *place = None;
            }
        }
    }
}

/// Whether an answer that was given up at `last` can overtake nothing any more.
fn is_past(now: Instant, last: Instant) -> bool {
    now >= last + OVERTAKING
}
