//! What arrives, judged: the answer, somebody else's, one that comes late, our own request sent back, or noise.

use core::ops::Range;
use core::time::Duration;

use super::beside::Why;
use super::overheard::passed_over;
use super::torn::{BEHIND, Open, is_left_of_answer, is_long_enough};
use super::{Master, State};
use crate::answer::{Answer, AnswerError};
use crate::event::Event;
use crate::expected::Expected;
use crate::frame::{Frame, FrameError};
use crate::framer::Step;
use crate::pdu::function::DIAGNOSTICS;
use crate::sketch::{HEAD, could_be_left_of};
use crate::{Instant, UnitAddress};

/// How much later than the wire carries it an answer is handed over, where nothing holds it back.
const LAG: Duration = Duration::from_millis(2);

impl Master {
    /// What came of the request in flight by `now`, if anything did.
    pub(super) fn await_answer(
        &mut self,
        now: Instant,
        unit: UnitAddress,
        expected: Expected,
        timeout: Duration,
        until: Instant,
    ) -> Option<Event<'_>> {
        if now >= until {
            self.framer.is_late();
        }
        while let Some(step) = self.framer.step(now) {
            match step {
                Step::Skipped { range, error, expected: is_damaged } => {
                    self.skips(now, (unit, expected), range, (error, is_damaged));
                    if self.patience.is_none() && self.beside.is_spoilt() {
                        return Some(self.end_in_vain(now, unit, expected, timeout));
                    }
                }
                Step::Frame(range) if self.is_own_echo(&range, expected) => {
                    self.beside.cut();
                    self.tally.add_own_echo();
                    self.echo_due = false;
                    self.framer.forget_own();
                }
                Step::Frame(range) => {
                    let frame = self.framer.frame(range.clone());
                    let judged = expected.judge_frame(unit, &frame).and_then(|answer| self.check(expected, answer));
                    let doubted = self.in_quarantine(now, unit);
                    let apart = self.doubts.sorts_out(now, unit, expected);
                    if judged.is_err() && !self.others.may_be() {
                        let at_once = self.at_once(range.len());
                        self.doubts.learn_length(now, (unit, expected), &frame, at_once);
                    }
                    match judged {
                        // Nobody was asked for it, and it stands amid other bytes: it has a right CRC by chance.
                        Err(AnswerError::Unit { .. } | AnswerError::Function { .. })
                            if !self.others.may_be()
                                && !self.beside.in_a_row().is_empty()
                                && !self.is_owed_by_anybody(now, &frame) =>
                        {
                            self.add_beside(range);
                        }
                        Err(AnswerError::Unit { .. } | AnswerError::Function { .. }) => {
                            self.beside.cut();
                            self.count_other(now, &range, unit, doubted);
                            self.see(now, range);
                        }
                        // Another word than the fresh one, another length than the one chosen: an earlier request's.
                        Err(_) if apart || self.doubts.owes(now, unit, &frame) => {
                            self.beside.cut();
                            self.see(now, range);
                            self.tally.add_late();
                        }
                        // It may be theirs, and the own answer still comes.
                        Ok(Answer::Exception { .. }) | Err(_) if self.others.use_function(now, unit, expected) => {
                            self.beside.cut();
                            self.pass(now, range);
                        }
                        // Refusals of reads look alike: it may be meant for an earlier one, and then this one's is owed.
                        Ok(Answer::Exception { code, .. }) if apart && doubted && expected.is_read() => {
                            self.give_account(false);
                            self.state = State::Idle;
                            self.hear(now, range.clone());
                            let others = self.others.may_be();
                            self.doubts.left_open_or_refused(now, (unit, expected), timeout, others);
                            let frame = self.framer.held(range);
                            return Some(Event::Wrong { error: AnswerError::Refusal { code }, frame });
                        }
                        // Nothing tells whose words these are.
                        Ok(Answer::Read { .. } | Answer::ReadWrite { .. }) if self.is_anybodys(now, unit, expected) => {
                            self.give_account(false);
                            self.state = State::Idle;
                            self.hear(now, range.clone());
                            self.doubts.left_open(now, unit, expected, timeout);
                            let frame = self.framer.held(range);
                            return Some(Event::Wrong { error: AnswerError::Others, frame });
                        }
                        // So do those of writes, and what went out in doubt was not refused because another was.
                        Ok(Answer::Exception { .. })
                            if expected.is_write() && self.doubts.may_refuse_another(now, unit, expected) =>
                        {
                            self.beside.cut();
                            self.tally.add_late();
                        }
                        Err(error) if self.patience.is_some() => {
                            self.see_if_others(now, range.clone());
                            self.spoils(&range, Why::Wrong(error));
                            self.add_beside(range);
                        }
                        outcome => {
                            let refused = matches!(outcome, Ok(Answer::Exception { .. }));
                            let wrong = outcome.err();
                            self.is_told_by(
                                now,
                                (unit, expected, timeout),
                                range.clone(),
                                (refused, wrong),
                                (apart, doubted),
                            );
                            return Some(self.tell(expected, range, wrong));
                        }
                    }
                }
            }
        }
        self.ends_at = self.ends_at(now, unit, expected, timeout);
        if now < self.listens_until(until) {
            return None;
        }
        if self.ends_at.is_some() {
            self.gives_the_rest_up();
        }
        Some(self.end_in_vain(now, unit, expected, timeout))
    }

    /// The frame at `range` ends the request: it is the answer, or the refusal, or what is `wrong` with it.
    fn is_told_by(
        &mut self,
        now: Instant,
        (unit, expected, timeout): (UnitAddress, Expected, Duration),
        range: Range<usize>,
        (refused, wrong): (bool, Option<AnswerError>),
        (apart, doubted): (bool, bool),
    ) {
        let right = wrong.is_none();
        self.give_account(right);
        self.state = State::Idle;
        if right || !self.others.may_be() {
            self.hear(now, range);
        } else {
            self.see(now, range);
        }
        // The answer proves that the request has left the wire, whatever was computed; but not one that may be late.
        if apart || !doubted {
            self.busy = Some(now);
        }
        match (right, refused, expected.is_echo()) {
            (false, ..) => self.doubts.left_open(now, unit, expected, timeout),
            (true, true, true) => self.doubts.refused_echo(now, unit),
            (true, false, echo) if echo || apart => self.doubts.settle(now, unit, echo),
            (true, refused, _) => self.takes(now, unit, expected, timeout, refused),
        }
    }

    /// What came of `unit`, or its refusal, is taken for the answer to `expected`.
    fn takes(&mut self, now: Instant, unit: UnitAddress, expected: Expected, timeout: Duration, refused: bool) {
        let follow = self.time_to_follow(expected);
        self.doubts.taken(now, (unit, expected), timeout, refused, follow, self.others.may_be());
    }

    /// What came at `range` is no frame: noise, or `is_damaged`: it begins as the answer does.
    fn skips(
        &mut self,
        now: Instant,
        (unit, expected): (UnitAddress, Expected),
        range: Range<usize>,
        (error, is_damaged): (FrameError, bool),
    ) {
        if self.is_late_and_damaged(now, unit, expected, &range) {
            self.beside.cut();
            self.tally.add_noise(self.framer.held(range));
            return;
        }
        if is_damaged {
            self.spoils(&range, Why::Damaged(error));
        }
        self.add_beside(range);
        if !is_damaged && self.framer.pending().is_empty() {
            self.look_for_answer(unit, expected, error);
        }
    }

    /// What is held begins the answer, and no more of it is waited for.
    fn gives_the_rest_up(&mut self) {
        if !self.framer.pending().is_empty() {
            let range = self.framer.gives_up_rest();
            let error = Frame::parse(self.framer.held(range.clone())).err();
            self.spoils(&range, Why::Damaged(error.unwrap_or(FrameError::TooShort { len: range.len() })));
            self.add_beside(range);
        }
    }

    /// The request ends without its answer.
    fn end_in_vain(&mut self, now: Instant, unit: UnitAddress, expected: Expected, timeout: Duration) -> Event<'_> {
        self.give_account(false);
        self.state = State::Idle;
        let passed = self.others.passed().filter(|_| !self.beside.is_spoilt());
        let doubted = passed.is_some() && self.in_quarantine(now, unit);
        let is_refusal = |frame: Frame<'_>| matches!(expected.judge(frame.pdu()), Ok(Answer::Exception { .. }));
        if expected.is_read() && !doubted && passed.is_some_and(is_refusal) {
            // It counts as the own one; where it is not, that one is nobody's when it comes.
            self.takes(now, unit, expected, timeout, true);
            return match self.others.passed() {
                Some(frame) => passed_over(expected, frame, doubted),
                None => Event::NoAnswer { bytes: &[] },
            };
        }
        match self.is_still_open(now, unit, expected, timeout) {
            Open::No => {
                self.doubts.none_came_again(unit);
                self.takes(now, unit, expected, timeout, false);
            }
            Open::For(time) => self.doubts.may_come_again(now, unit, expected, time.max(timeout)),
            Open::Long => self.doubts.left_open(now, unit, expected, timeout),
        }
        if !self.beside.is_spoilt()
            && let Some(frame) = self.others.passed()
        {
            return passed_over(expected, frame, doubted);
        }
        self.instead.add(self.framer.pending());
        self.beside.event().unwrap_or(Event::NoAnswer { bytes: self.framer.pending() })
    }

    /// When nothing more is waited for behind what came in the place of the answer, where that is told, and damaged: at once on a
    /// line on which such do not come again, if nothing of it is missing. Else the right one may come right behind it; and what
    /// is missing may be the last lump of it.
    fn ends_at(&self, now: Instant, unit: UnitAddress, expected: Expected, timeout: Duration) -> Option<Instant> {
        let pending = self.framer.pending();
        let pause = self.patience.filter(|_| expected.is_read())?.pause;
        let came = match self.beside.damaged() {
            Some(damaged) if pending.is_empty() => damaged,
            None if !pending.is_empty() && self.beside.is_empty() => pending,
            _ => return None,
        };
        // Most looks find the beginning of an answer that goes on.
        if !is_long_enough(expected, came.len()) || !self.is_told(now, unit, expected, came) {
            return None;
        }
        let len = expected.adu_len();
        let behind = if pending.is_empty() && len == Some(came.len()) && self.torn.none_comes_again(now, timeout) {
            Duration::ZERO
        } else if len.is_some_and(|len| came.len() < len) {
            BEHIND.max(pause)
        } else {
            BEHIND
        };
        self.framer.last_byte().map(|last| last + behind)
    }

    /// Whether `came` is the answer that is waited for, damaged, and no other.
    fn is_told(&self, now: Instant, unit: UnitAddress, expected: Expected, came: &[u8]) -> bool {
        is_left_of_answer(unit, expected, self.request.as_bytes(), came)
            && !self.doubts.could_be_another(now, unit, expected, came)
    }

    /// Whether what came at `range` is a late answer, damaged, and not the one that is waited for.
    fn is_late_and_damaged(
        &mut self,
        now: Instant,
        unit: UnitAddress,
        expected: Expected,
        range: &Range<usize>,
    ) -> bool {
        !self.others.may_be()
            && self.beside.in_a_row().is_empty()
            && !could_be_left_of(unit, expected, self.framer.held(range.clone()), HEAD - 1)
            && self.sees_damaged(now, range.clone(), false)
    }

    /// Whether what came at `range` is beyond doubt a late answer, damaged. It is open no more where the line has shown that such
    /// do not come again.
    fn sees_damaged(&mut self, now: Instant, range: Range<usize>, is_idle: bool) -> bool {
        let comes_again = !self.torn.none_comes_again(now, Duration::MAX);
        let late = self.doubts.seen_damaged(now, self.framer.held(range), is_idle, comes_again);
        let Some(late) = late else { return false };
        self.torn.notes(now, late);
        true
    }

    /// Whether words that come for `expected` may be those that another master asked for.
    fn is_anybodys(&self, now: Instant, unit: UnitAddress, expected: Expected) -> bool {
        self.others.ask(now, unit, expected).is_some()
    }

    /// Whether `frame` is the answer to something that its unit left open.
    fn is_owed_by_anybody(&self, now: Instant, frame: &Frame<'_>) -> bool {
        UnitAddress::new(frame.address()).is_ok_and(|unit| self.doubts.owes(now, unit, frame))
    }

    /// Looks whether what came last, which looked like noise, is what is left of the answer.
    #[cold]
    fn look_for_answer(&mut self, unit: UnitAddress, expected: Expected, error: FrameError) {
        self.beside.look_for_lost_head(unit, expected);
        let is_told = |came: &[u8]| is_left_of_answer(unit, expected, self.request.as_bytes(), came);
        if expected.is_read() && !self.others.may_be() && !self.beside.is_spoilt() && is_told(self.beside.in_a_row()) {
            self.beside.is_all_spoilt(Why::Damaged(error));
        }
    }

    /// How long the answer may still come: what came in its place may have been the answer, damaged.
    fn is_still_open(&mut self, now: Instant, unit: UnitAddress, expected: Expected, timeout: Duration) -> Open {
        let damaged = self.beside.damaged().filter(|damaged| self.is_told(now, unit, expected, damaged));
        let Some(len) = damaged.map(<[u8]>::len) else {
            if !self.beside.noise(true).is_empty() || !self.framer.pending().is_empty() {
                let begun =
                    if self.beside.in_a_row().is_empty() { self.framer.pending() } else { self.beside.in_a_row() };
                self.torn.broke_off(now, self.doubts.rest(now, unit, expected, begun), timeout);
            }
            return Open::Long;
        };
        // Where nothing was waited for, the right one may follow; a stranger's may have been damaged; and a write or an echo
        // may have come back from the adapter.
        if !expected.is_read() || self.patience.is_none() || self.doubts.first_contact_ends(now, unit).is_some() {
            return Open::Long;
        }
        self.torn.came(now, (unit, expected), len, timeout)
    }

    /// Until when the answer is waited for that has to be there by `until`: no longer than something may still follow what
    /// came in its place.
    pub(super) fn listens_until(&self, until: Instant) -> Instant {
        let gives_up = self.framer.gives_up().filter(|_| self.beside.is_spoilt());
        [gives_up, self.ends_at].into_iter().flatten().fold(until, Ord::min)
    }

    /// The frame that ends the request, and what is wrong with it.
    fn tell(&self, expected: Expected, range: Range<usize>, wrong: Option<AnswerError>) -> Event<'_> {
        let frame = self.framer.frame(range);
        // Parsed again, because the answer could not be kept beside the change of state.
        match wrong.map_or_else(|| expected.parse(frame.pdu()), Err) {
            Ok(answer) => Event::Answer(answer),
            Err(error) => Event::Wrong { error, frame: frame.as_bytes() },
        }
    }

    /// `answer`, if it is all that the specification says of the answer to the request in flight.
    fn check<'a>(&self, expected: Expected, answer: Answer<'a>) -> Result<Answer<'a>, AnswerError> {
        if let (Answer::Custom { pdu, .. }, [_, asked @ .., _, _]) = (answer, self.request.as_bytes()) {
            expected.check_custom(asked, pdu)?;
        }
        Ok(answer)
    }

    /// A frame came that answers nothing in flight.
    pub(super) fn see(&mut self, now: Instant, range: Range<usize>) {
        let (at_once, frame) = (self.at_once(range.len()), self.framer.frame(range));
        let unit = UnitAddress::new(frame.address()).ok();
        // Of what is late nothing is learned.
        if !unit.is_some_and(|unit| self.doubts.awaits(now, unit, &frame)) {
            self.torn.see(&frame);
        }
        if !self.others.may_be()
            && let Some(unit) = unit
        {
            self.doubts.learn_length_beside(now, unit, &frame, at_once);
        }
        if self.doubts.seen(now, &frame, at_once) && self.others.may_be() && frame.as_bytes() != self.request.as_bytes()
        {
            let first_contact = UnitAddress::of_answer(frame.address());
            let strange_until = first_contact.and_then(|unit| self.doubts.first_contact_ends(now, unit));
            self.others.hear(now, &frame, strange_until);
        }
    }

    /// A frame came that answers what is in flight.
    fn hear(&mut self, now: Instant, range: Range<usize>) {
        let at_once = self.at_once(range.len());
        self.doubts.hear(now, &self.framer.frame(range), at_once);
    }

    /// How soon after another one a frame of `len` bytes can have come with no silence between them.
    fn at_once(&self, len: usize) -> Duration {
        // Less one character: what a unit answers right behind another has its silence to the last bit.
        let chars = u32::try_from(len.saturating_sub(1)).unwrap_or(u32::MAX);
        self.char_time.saturating_mul(chars).saturating_add(self.silence)
    }

    /// How long after one answer another of this kind can have come that the unit gave right behind it.
    fn time_to_follow(&self, expected: Expected) -> Duration {
        match expected.adu_len().and_then(|len| u32::try_from(len).ok()) {
            Some(len) if self.char_time != Duration::MAX => {
                self.char_time.saturating_mul(len).saturating_add(self.silence.saturating_mul(2)).saturating_add(LAG)
            }
            _ => Duration::ZERO,
        }
    }

    /// What was seen beside the request that ends; what came in the place of an answer that is `right` was none.
    #[inline]
    fn give_account(&mut self, right: bool) {
        if !self.beside.is_empty() {
            self.account_for_it(right);
        }
    }

    #[cold]
    fn account_for_it(&mut self, right: bool) {
        self.tally.add_noise(self.beside.noise(right));
        if right && self.beside.is_spoilt() {
            self.torn.forget();
        }
        self.tally.add_own_remnant(self.beside.holds_remnant_of(self.request.as_bytes()));
    }

    /// What came at `range` came in the place of the answer: noise gives way to it.
    fn spoils(&mut self, range: &Range<usize>, why: Why) {
        if !self.beside.is_spoilt() && !self.beside.has_room_for(range.len()) {
            self.give_account(false);
            self.beside.clear();
        }
        self.beside.spoils(why);
    }

    fn add_beside(&mut self, range: Range<usize>) {
        let bytes = self.framer.held(range);
        self.instead.add(bytes);
        self.tally.add_noise(self.beside.add(bytes));
    }

    /// Whether the frame is the request in flight, sent back by the adapter and not by the unit.
    fn is_own_echo(&self, range: &Range<usize>, expected: Expected) -> bool {
        let is_adapters = self.echo_due || !(expected.may_repeat_request() || self.never_echoes && expected.is_write());
        is_adapters && self.framer.held(range.clone()) == self.request.as_bytes()
    }

    /// Counts a whole frame that is not the answer, and keeps it, unless it is late or may be another master's.
    fn count_other(&mut self, now: Instant, range: &Range<usize>, unit: UnitAddress, doubted: bool) {
        let frame = self.framer.frame(range.clone());
        let is_met = self.doubts.first_contact_ends(now, unit).is_some();
        let of_unit = frame.address() == unit.get();
        // Nobody but a master of ours asks for an echo: one that comes unasked is a probe's.
        let is_echo = frame.pdu().first() == Some(&DIAGNOSTICS);
        if of_unit && doubted && (is_met || is_echo || self.doubts.owes(now, unit, &frame)) {
            self.tally.add_late();
            return;
        }
        if of_unit || frame.address() == 0 || !self.others.may_be() {
            self.instead.add(frame.as_bytes());
        }
        self.tally.add_foreign();
        if of_unit {
            self.tally.add_misfit();
        }
    }

    /// Counts what came while nothing was waited for.
    pub(super) fn count_strays(&mut self, now: Instant) {
        let broadcast = matches!(self.state, State::Turnaround { .. });
        while let Some(step) = self.framer.step(now) {
            match step {
                Step::Frame(range) if broadcast && self.framer.held(range.clone()) == self.request.as_bytes() => {
                    self.tally.add_own_echo();
                }
                Step::Frame(range) => {
                    self.see(now, range);
                    self.tally.add_late();
                }
                Step::Skipped { range, .. } => self.skip_stray(now, range),
            }
        }
    }

    /// What came at `range` while nothing was waited for is no frame: it may be left of one.
    pub(super) fn skip_stray(&mut self, now: Instant, range: Range<usize>) {
        if !self.others.may_be() {
            self.sees_damaged(now, range.clone(), true);
        }
        self.tally.add_noise(self.framer.held(range));
    }
}
