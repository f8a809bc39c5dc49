//! What came damaged, beside what is open: whether it is left of one of those, of which one, and how much may follow.

use super::{Doubts, Open};
use crate::expected::Expected;
use crate::sketch::{HEAD, could_be_left_of, damaged_head, is_left_of, is_surely_left_of, rest_of};
use crate::{Instant, UnitAddress};

impl Doubts {
    /// What came at `now` could be the answers that it `fits`: if these are alike, and it `is_it`, one of them is not open any
    /// more, unless it `stays`. Of several that is the one whose time ends first. Returns which one it is.
    pub(super) fn closes(
        &mut self,
        now: Instant,
        fits: impl Fn(&Open) -> bool,
        is_it: impl Fn(&Open) -> bool,
        stays: bool,
    ) -> Option<(UnitAddress, Expected)> {
        let still = |open: &&Open| fits(open) && self.may_come(now, open);
        let first = self.ledger.iter().flatten().filter(still).min_by_key(|open| open.last + open.window)?;
        let (unit, expected, end) = (first.unit, first.expected, first.last + first.window);
        let mut others = self.ledger.iter().flatten().filter(still);
        if !is_it(first) || others.any(|open| (open.unit, open.expected) != (unit, expected)) {
            return None;
        }
        if stays {
            return Some((unit, expected));
        }
        self.learns_lateness(now, unit, |open| fits(open) && !open.is_past(now));
        let is_first = |open: &Open| fits(open) && (open.unit, open.last + open.window) == (unit, end);
        if let Some(place) = self.ledger.iter().position(|place| place.as_ref().is_some_and(is_first)) {
            self.came(place);
        }
        self.ends_unless_open(now, unit);
        Some((unit, expected))
    }

    /// Something came damaged at `now` that answers nothing in flight. Where it is beyond doubt one that is open, and could be
    /// no other, that one is not any more, unless it `comes_again`. Returns which one it is.
    pub(crate) fn seen_damaged(
        &mut self,
        now: Instant,
        bytes: &[u8],
        is_idle: bool,
        comes_again: bool,
    ) -> Option<(UnitAddress, Expected)> {
        if now < self.forgotten_until {
            return None;
        }
        let (strangers, until, any_length) = (self.strangers, self.strangers_until, self.any_length);
        let strange = |unit| now < until && strangers.contains(unit);
        let could_be = |open: &Open| !open.again && could_be_left_of(open.unit, open.expected, bytes, HEAD - 1);
        let is_it = |open: &Open| {
            !open.expected.may_repeat_request()
                && !any_length.contains(open.unit)
                && !strange(open.unit)
                && is_left_of(open.unit, open.expected, bytes)
                && (is_idle || is_surely_left_of(open.unit, open.expected, bytes))
        };
        self.closes(now, could_be, is_it, comes_again)
    }

    /// Whether `bytes`, which came in the place of the answer of `unit` to `expected`, could be left of another open one.
    ///
    /// No more of that one's beginning is damaged then than of this.
    pub(crate) fn could_be_another(&self, now: Instant, unit: UnitAddress, expected: Expected, bytes: &[u8]) -> bool {
        let most = damaged_head(unit, expected, bytes);
        let is_other = |open: &Open| {
            (open.unit != unit || !open.expected.could_pass_for(expected))
                && self.may_come(now, open)
                && could_be_left_of(open.unit, open.expected, bytes, most)
        };
        now < self.forgotten_until || self.gives_any_length(unit) || self.ledger.iter().flatten().any(is_other)
    }

    /// How many bytes may follow `bytes`, which came in the place of the answer of `unit` to `expected` and cannot be told: of
    /// the longest among the answers that begin like them.
    pub(crate) fn rest(&self, now: Instant, unit: UnitAddress, expected: Expected, bytes: &[u8]) -> usize {
        let open = self.ledger.iter().flatten().filter(|open| self.may_come(now, open));
        let open = open.map(|open| rest_of(open.unit, open.expected, bytes));
        let own = rest_of(unit, expected, bytes);
        open.fold(
            own,
            |best, other| if other.0 < best.0 || (other.0 == best.0 && other.1 > best.1) { other } else { best },
        )
        .1
    }
}
