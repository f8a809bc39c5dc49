//! Which units may still answer something that was asked before, and how that doubt ends.
//!
//! RTU answers carry no number. What is remembered here is therefore all that tells a late answer from the right one:
//! what was asked of whom and left open, and whether another program may have asked before this one opened the line.
//!
//! | doubt ends by | which doubt | what is assumed of the unit |
//! | --- | --- | --- |
//! | the echo (08H) of a fresh word | any | it answers in the order it was asked |
//! | the answer to a read that no open answer could pass for | requests of our own | the same |
//! | the refusal of an echo (exception to 08H) | requests of our own | the same |
//! | [`FIRST_CONTACT`] after the line was opened | questions of others | it answers within that time or never |
//! | [`PATIENCE`] after the last request it left open | requests of our own, to a unit that returns no echo | the same |
//! | every open answer was seen | requests of our own | it answers at most once |
//! | it came damaged, and on this line such never come again (`master/torn.rs`) | reads of our own | the same |
//!
//! A radio bridge, a serial server or a gateway may let answers overtake each other, and nobody can tell from a port
//! whether one stands behind it. There none of the orders above holds. So on every line an open answer counts as possible
//! for [`OVERTAKING`], doubt or not, until it is seen. A read that it could pass for is asked in a longer form, whose answer
//! it cannot pass for, or again and again: see [`Attribution`]. What another program asked is not known to anybody; at
//! first contact an echo is believed on every line.

mod attribution;
mod damaged;
mod lateness;
mod lengths;
mod owed;

use core::time::Duration;

use crate::answer::Answer;
use crate::expected::Expected;
use crate::frame::Frame;
use crate::unit_set::UnitSet;
use crate::{Instant, UnitAddress};

pub use attribution::Attribution;
use lateness::Lateness;
use lengths::{is_read_by, passes};

/// How long after a line was opened the answer to another program's question may come.
///
/// Five times the longest response delay that a drive known here can be set to (P14.03, 200 ms).
pub const FIRST_CONTACT: Duration = Duration::from_secs(1);

/// How long a unit that never returned an echo may owe an answer. After that it is taken as never to come.
pub const PATIENCE: Duration = Duration::from_secs(3);

/// How long after it was given up an answer may be overtaken by later ones; four time-outs where that is longer.
pub const OVERTAKING: Duration = Duration::from_secs(3);

/// The same, in time-outs of the request that was given up.
const OVERTAKING_TIMEOUTS: u32 = 4;

/// Longest time that one answer given up may count as possible, in times of the one before. Each answer taken meanwhile may
/// have been the open one, so that its own is open instead; an answer that is displaced so three times over is not expected
/// of any line.
const LONGEST: u32 = 3;

/// After so many echoes that stayed open, one that returned some before counts as a unit that never did: another one may
/// have its address now.
const MUTE: u8 = 5;

/// Open requests that are told apart; of more, only the unit and the time are kept.
const KEPT: usize = 32;

/// So many open requests of one kind have each its own time; more share that of the latest.
const APART: usize = 4;

/// Why an answer may still come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Because {
    /// None came.
    NoneCame,
    /// It came damaged, and may come again.
    Damaged,
    /// What was taken for it may have been another one.
    Displaced,
}

/// Requests of one kind to one unit that were left open.
#[derive(Debug, Clone, Copy)]
struct Open {
    unit: UnitAddress,
    expected: Expected,
    /// Whether they came damaged, and may come again.
    again: bool,
    count: u8,
    /// How many of them the unit owes more than it has answered: see [`owed`].
    owed: u8,
    /// When the latest of them was given up, or the one that it displaced.
    given_up: Instant,
    /// The same, or when the latest answer was taken that one of them may have been.
    last: Instant,
    /// How long after that it may still come.
    window: Duration,
    /// Until when it may come right behind the answer that was taken first and may have been it.
    follows: Option<Instant>,
}

impl Open {
    /// Whether the answer can overtake nothing any more.
    fn is_past(&self, now: Instant) -> bool {
        now >= self.last + self.window
    }
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
    /// Units that the ledger has something of; nothing is looked up of the others.
    listed: UnitSet,
    /// Units of which something had to be forgotten, and until when the latest of it may come.
    forgotten: UnitSet,
    forgotten_until: Instant,
    /// The frame that was heard last since a request went out, by unit and CRC, and when: a line may bring it twice at once.
    heard: Option<(u8, [u8; 2], Instant)>,
    /// How late answers come that come late.
    lateness: Lateness,
    /// Units whose answers have any number of words: one had another than it was asked for.
    any_length: UnitSet,
}

impl Doubts {
    pub(crate) const NONE: Self = Self {
        strangers: UnitSet::EMPTY,
        strangers_until: Instant::ZERO,
        open: UnitSet::EMPTY,
        echoers: UnitSet::EMPTY,
        ledger: [None; KEPT],
        listed: UnitSet::EMPTY,
        forgotten: UnitSet::EMPTY,
        forgotten_until: Instant::ZERO,
        heard: None,
        lateness: Lateness::UNKNOWN,
        any_length: UnitSet::EMPTY,
    };

    /// The line was opened at `now`: anybody may have asked anything before.
    pub(crate) fn opened(&mut self, now: Instant) {
        self.strangers = UnitSet::ALL;
        self.strangers_until = now + FIRST_CONTACT;
    }

    /// `unit` was asked for `expected` with a time-out of `timeout`, and at `now` the answer is given up.
    pub(crate) fn left_open(&mut self, now: Instant, unit: UnitAddress, expected: Expected, timeout: Duration) {
        self.leave_open(now, (unit, expected, Because::NoneCame), timeout);
    }

    fn leave_open(&mut self, now: Instant, what: (UnitAddress, Expected, Because), timeout: Duration) {
        self.enter(now, what, window(timeout), now);
        self.open.insert(what.0);
    }

    /// The same, but a refusal came, which is its own or that of another that is open. `others`: or that of another master.
    pub(crate) fn left_open_or_refused(
        &mut self,
        now: Instant,
        (unit, expected): (UnitAddress, Expected),
        timeout: Duration,
        others: bool,
    ) {
        let because = if self.owed(unit) > 0 { self.taken_because(now, unit, others) } else { Because::NoneCame };
        self.leave_open(now, (unit, expected, because), timeout);
    }

    /// Why `unit` may still answer where something came of it that may have been the answer to something else.
    fn taken_because(&self, now: Instant, unit: UnitAddress, others: bool) -> Because {
        // What somebody else asked is not in the ledger, and so it is owed besides.
        let may_be_anybodys = others || self.is_strange(now, unit) || self.has_forgotten(now, unit);
        if may_be_anybodys { Because::NoneCame } else { Because::Displaced }
    }

    /// The answer of `unit` to `expected` came damaged. It may come again within `window`; after that it does not, in order or
    /// not.
    pub(crate) fn may_come_again(&mut self, now: Instant, unit: UnitAddress, expected: Expected, window: Duration) {
        self.enter(now, (unit, expected, Because::Damaged), window, now);
    }

    /// The line has shown that what came damaged does not come again: nor did what came so before of `unit`, in the place of
    /// another answer.
    pub(crate) fn none_came_again(&mut self, unit: UnitAddress) {
        self.forget(unit, |open| open.again);
    }

    /// What is open: of whom, what, and why. `since`: when the answer was given up that started it.
    fn enter(
        &mut self,
        now: Instant,
        (unit, expected, because): (UnitAddress, Expected, Because),
        window: Duration,
        since: Instant,
    ) {
        let again = because == Because::Damaged;
        let owed = u8::from(because != Because::Displaced);
        let last = capped(now, since, window);
        let alike = |open: &Open| {
            open.unit == unit
                && open.again == again
                && (open.expected == expected || (expected.is_echo() && open.expected.is_echo()))
        };
        // Each has its own time, as long as they are few.
        let is_one_more =
            expected.is_read() && !again && self.ledger.iter().flatten().filter(|open| alike(open)).count() < APART;
        let latest = self.ledger.iter_mut().flatten().filter(|open| alike(open)).max_by_key(|open| open.last);
        if let Some(open) = latest.filter(|_| !is_one_more) {
            let over = open.is_past(now) && !self.open.contains(unit) && !expected.is_echo();
            let before = *open;
            (open.count, open.owed) =
                if over { (1, owed) } else { (open.count.saturating_add(1), open.owed.saturating_add(owed)) };
            open.given_up = open.given_up.max(since);
            open.last = open.last.max(last);
            open.window = if over { window } else { open.window.max(window) };
            if expected.is_echo() && open.count >= MUTE {
                self.echoers.remove(unit);
            }
            if over {
                self.is_owed_still(before);
            }
            return;
        }
        self.listed.insert(unit);
        let open = Open { unit, expected, again, count: 1, owed, given_up: since, last, window, follows: None };
        let over = |open: &Option<Open>| open.is_none_or(|open| !self.open.contains(open.unit) && open.is_past(now));
        let displaced = if let Some(place) = self.ledger.iter().position(over) {
            self.ledger[place].replace(open)
        } else if let Some(oldest) = self.ledger.iter_mut().flatten().min_by_key(|open| open.last) {
            self.forgotten.insert(oldest.unit);
            self.forgotten_until = self.forgotten_until.max(oldest.last + oldest.window);
            Some(core::mem::replace(oldest, open))
        } else {
            None
        };
        if let Some(open) = displaced {
            self.is_owed_still(open);
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

    /// Whether `unit` may owe an answer, and what it answers to `expected` can still be told apart: what does not fit is
    /// late then, and not wrong.
    pub(crate) fn sorts_out(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        let owes = self.contains(now, unit) || self.possible(now, unit).next().is_some();
        (owes || (expected.is_echo() && self.open.contains(unit))) && self.tells_apart(now, unit, expected)
    }

    /// Whether the answer of `unit` to `expected` cannot be mistaken for one that it may still give, even if that one has
    /// fewer words than were asked for.
    pub(crate) fn tells_apart(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        expected.is_echo()
            || (expected.is_read()
                && !self.is_strange(now, unit)
                && !self.has_forgotten(now, unit)
                && !self
                    .possible(now, unit)
                    .any(|open| self.could_pass(open, expected) || open.expected.could_pass_for_cut(expected)))
    }

    /// Whether a refusal that `unit` gives to `expected` may be meant for something else that it was asked before.
    pub(crate) fn may_refuse_another(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        let rival = |open: &Open| open.expected != expected && open.expected.function() == expected.function();
        self.is_strange(now, unit) || self.has_forgotten(now, unit) || self.possible(now, unit).any(rival)
    }

    /// At `now` `unit` has answered what could not be mistaken, and, if it answers in order, everything before.
    pub(crate) fn settle(&mut self, now: Instant, unit: UnitAddress, echoed: bool) {
        self.strangers.remove(unit);
        self.open.remove(unit);
        if echoed {
            self.echoers.insert(unit);
        }
        if self.listed.contains(unit) {
            // Echoes are counted as long as none comes back, and can be mistaken for nothing but echoes.
            self.forget(unit, |open| open.is_past(now) || open.expected.is_echo());
        }
        if now >= self.forgotten_until {
            self.forgotten.remove(unit);
        }
    }

    /// A request goes out: what is heard from here on is not the same frame twice.
    pub(crate) fn goes_out(&mut self) {
        self.heard = None;
    }

    /// A whole frame came that answers nothing in flight. Where it can only be an answer that is open, that one is not any
    /// more.
    ///
    /// Not so an answer that looks like its request, which an adapter may have sent back; nor one of the first second, which
    /// another program may have asked for; nor the same frame again within `at_once`, which the line may have brought twice.
    ///
    /// Returns whether it can be none of ours, as far as is remembered.
    pub(crate) fn seen(&mut self, now: Instant, frame: &Frame<'_>, at_once: Duration) -> bool {
        let is_new = self.hear(now, frame, at_once);
        let Some(unit) = UnitAddress::of_answer(frame.address()) else { return false };
        let fits = |open: &Open| open.expected.judge_frame(unit, frame).is_ok();
        // The frame before it once more, or one that is late.
        if !is_new {
            self.learns_lateness(now, unit, fits);
            return false;
        }
        let is_nobodys = !self.has_forgotten(now, unit) && !self.of(unit).any(fits);
        if self.is_strange(now, unit) {
            return is_nobodys;
        }
        // Which of its open reads it answers, if any, nothing tells.
        if self.gives_any_length(unit) && self.of(unit).any(|open| is_read_by(open, frame)) {
            return false;
        }
        let answers = |open: &Open| {
            open.unit == unit
                && matches!(open.expected.judge(frame.pdu()), Ok(answer) if !matches!(answer, Answer::Exception { .. }))
        };
        self.closes(now, answers, |open| !open.expected.may_repeat_request(), false);
        is_nobodys
    }

    /// What came at `now` may be an answer that is open and `fits`: how late that is, the latest of them, is learned. Nothing
    /// follows from it of what is open.
    fn learns_lateness(&mut self, now: Instant, unit: UnitAddress, fits: impl Fn(&Open) -> bool) {
        let open = self.possible(now, unit).filter(|open| !open.again && fits(open));
        if let Some(given_up) = open.map(|open| open.given_up).max() {
            self.lateness.came(now, unit, given_up);
        }
    }

    /// At `now` it is known by other means that `unit` owes no answer to `expected`.
    pub(crate) fn owes_no(&mut self, now: Instant, unit: UnitAddress, expected: Expected) {
        self.forget(unit, |open| open.expected == expected);
        self.ends_unless_open(now, unit);
    }

    /// Ends the doubt about requests of our own to `unit` where none of them is open.
    fn ends_unless_open(&mut self, now: Instant, unit: UnitAddress) {
        if !self.has_forgotten(now, unit) && self.of(unit).all(|open| open.expected.is_echo()) {
            self.open.remove(unit);
        }
    }

    /// Whether `frame` is, as it stands, the answer to something that `unit` left open.
    pub(crate) fn owes(&self, now: Instant, unit: UnitAddress, frame: &Frame<'_>) -> bool {
        self.possible(now, unit).any(|open| open.expected.judge_frame(unit, frame).is_ok())
    }

    /// Whether `frame` is, as it stands, the answer to something that `unit` left open and of which nothing came.
    pub(crate) fn awaits(&self, now: Instant, unit: UnitAddress, frame: &Frame<'_>) -> bool {
        self.possible(now, unit).any(|open| !open.again && open.expected.judge_frame(unit, frame).is_ok())
    }

    /// Whether `frame`, which came whole at `now`, [is new](Self::is_new). It is the last that came from now on.
    pub(crate) fn hear(&mut self, now: Instant, frame: &Frame<'_>, at_once: Duration) -> bool {
        let is_new = self.is_new(now, frame, at_once);
        self.heard = Some((frame.address(), frame.crc(), now));
        is_new
    }

    /// Whether `frame`, which came whole at `now`, is another one than the last since a request went out, or came later than
    /// `at_once` after it.
    fn is_new(&self, now: Instant, frame: &Frame<'_>, at_once: Duration) -> bool {
        self.heard.is_none_or(|(unit, crc, then)| {
            unit != frame.address() || crc != frame.crc() || now.saturating_duration_since(then) >= at_once
        })
    }

    /// `unit` has refused an echo, this one or one that was asked before. What was asked before both is answered, if it
    /// answers in order; what was asked between them counts as possible for [`OVERTAKING`] in any case.
    pub(crate) fn refused_echo(&mut self, now: Instant, unit: UnitAddress) {
        if self.is_strange(now, unit) || self.has_forgotten(now, unit) {
            self.left_open(now, unit, Expected::ECHO, Duration::ZERO);
        } else {
            self.settle(now, unit, false);
        }
    }

    /// `unit` was asked for `expected` with a time-out of `timeout`, and an answer or a refusal was taken for its own. `others`: it
    /// may have been that of another master.
    pub(crate) fn taken(
        &mut self,
        now: Instant,
        (unit, expected): (UnitAddress, Expected),
        timeout: Duration,
        refused: bool,
        follow: Duration,
        others: bool,
    ) {
        if !self.listed.contains(unit) {
            return;
        }
        let mut displaced = None;
        let any_length = self.gives_any_length(unit);
        for open in self.ledger.iter_mut().flatten() {
            let rival =
                passes(open, expected, any_length) || (refused && open.expected.function() == expected.function());
            if open.unit == unit && rival && !open.is_past(now) {
                if !open.again && !refused {
                    open.follows.get_or_insert(now + follow);
                }
                open.window = open.window.max(window(timeout));
                open.last = capped(now, open.given_up, open.window);
                if open.expected != expected {
                    displaced = displaced.max(Some((open.given_up, open.window)));
                }
            }
        }
        if let Some((since, window)) = displaced {
            let because = self.taken_because(now, unit, others);
            self.enter(now, (unit, expected, because), window, since);
        }
    }

    /// Until when it is worth to wait whether an answer that `unit` owes is seen, before it is asked for `expected`: a little while,
    /// where that is soon to come if it comes: no longer than `timeout` after it was given up, and less where the unit can be
    /// asked `otherwise`. Nothing is asked then that would meet it on the wire, or be taken for it.
    pub(crate) fn worth_watching(
        &self,
        now: Instant,
        unit: UnitAddress,
        expected: Expected,
        timeout: Duration,
        otherwise: bool,
    ) -> Option<Instant> {
        let is_open = |open: &&Open| !open.expected.is_echo() && !open.is_past(now);
        let count = self.of(unit).filter(is_open).count();
        let until = self.of(unit).filter(is_open).map(|open| {
            let worth = match expected.is_read() && self.could_pass(open, expected) {
                true if open.again => open.last + open.window,
                true => open.given_up + self.lateness.worth(unit, timeout, otherwise, count),
                false => Instant::ZERO,
            };
            open.follows.map_or(worth, |follows| follows.max(worth))
        });
        until.max().filter(|&until| now < until)
    }

    /// Whether an answer of `unit` that came damaged may come again, and pass for that to `expected`.
    pub(crate) fn may_come_whole(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        self.of(unit).any(|open| open.again && !open.is_past(now) && self.could_pass(open, expected))
    }

    /// When the doubt of first contact with `unit` will be over by itself, if there is one.
    pub(crate) fn first_contact_ends(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        self.is_strange(now, unit).then_some(self.strangers_until)
    }

    /// When whatever is doubted of `unit`, which returns no echo, will be over by itself, if anything is.
    pub(crate) fn ends(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        let asked = self.asked_last(unit).map(|asked| asked + PATIENCE);
        let forgotten = self.forgotten.contains(unit).then_some(self.forgotten_until);
        [self.first_contact_ends(now, unit), asked, forgotten].into_iter().flatten().max().filter(|&end| now < end)
    }

    fn is_strange(&self, now: Instant, unit: UnitAddress) -> bool {
        self.strangers.contains(unit) && now < self.strangers_until
    }

    /// When `unit` was last asked what it still owes. An echo can be mistaken for nothing but an echo: it does not count.
    fn asked_last(&self, unit: UnitAddress) -> Option<Instant> {
        self.of(unit).filter(|open| !open.expected.is_echo()).map(|open| open.last).max()
    }

    /// Whether `unit` never returned an echo and owes nothing any more.
    fn is_over(&self, now: Instant, unit: UnitAddress) -> bool {
        let asked = self.asked_last(unit);
        !self.echoers.contains(unit)
            && !self.has_forgotten(now, unit)
            && asked.is_none_or(|asked| now >= asked + PATIENCE)
    }

    /// Whether of what `unit` was asked something may still come that is not in the ledger. Where only an echo ends its
    /// quarantine, that is until then.
    fn has_forgotten(&self, now: Instant, unit: UnitAddress) -> bool {
        let is_left = now < self.forgotten_until || (self.echoers.contains(unit) && self.open.contains(unit));
        is_left && self.forgotten.contains(unit)
    }

    /// What may still come of `unit`, in order or not. Echoes aside: they can be mistaken for nothing but echoes.
    fn possible(&self, now: Instant, unit: UnitAddress) -> impl Iterator<Item = &Open> {
        let in_doubt = self.contains(now, unit);
        self.of(unit).filter(move |open| !open.expected.is_echo() && (in_doubt || !open.is_past(now)))
    }

    /// Whether the answer may still come: its unit is in quarantine, or it may overtake.
    fn may_come(&self, now: Instant, open: &Open) -> bool {
        self.open.contains(open.unit) || !open.is_past(now)
    }

    fn of(&self, unit: UnitAddress) -> impl Iterator<Item = &Open> {
        let ledger = if self.listed.contains(unit) { &self.ledger[..] } else { &[] };
        ledger.iter().flatten().filter(move |open| open.unit == unit)
    }

    fn forget(&mut self, unit: UnitAddress, which: impl Fn(&Open) -> bool) {
        for place in 0..KEPT {
            if let Some(open) = self.ledger[place].take_if(|open| open.unit == unit && which(open)) {
                self.is_owed_still(open);
            }
        }
        if self.of(unit).next().is_none() {
            self.listed.remove(unit);
        }
    }
}

/// When, `now` or before, an answer counts as open that was given up at `given_up`, or displaced one that was.
fn capped(now: Instant, given_up: Instant, window: Duration) -> Instant {
    now.min(given_up + window.saturating_mul(LONGEST - 1))
}

/// How long an answer may be overtaken that was waited for for `timeout`.
fn window(timeout: Duration) -> Duration {
    OVERTAKING.max(timeout.saturating_mul(OVERTAKING_TIMEOUTS))
}
