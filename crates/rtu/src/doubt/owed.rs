//! How many answers a unit owes, whichever they are.
//!
//! Where an open answer could pass for another one, it counts as possible that it was taken for that, and that the other one is
//! open instead. So the ledger lists more than can come: of a request and what took its place, one. What can come is counted
//! here. A unit answers each request once at most, so that it owes as many answers as it was asked for and did not give,
//! whatever each of them was taken for; and what came damaged may come once more.
//!
//! The count is kept with what was left open. It is carried over to what took its place where that is forgotten first, and so is
//! never too low.

use super::{Doubts, Open};
use crate::UnitAddress;

impl Doubts {
    /// How many answers of `unit` may come at most, echoes aside.
    pub(super) fn owed(&self, unit: UnitAddress) -> u8 {
        let answers = self.of(unit).filter(|open| !open.expected.is_echo());
        answers.fold(0, |owed, open| owed.saturating_add(open.owed))
    }

    /// One of those at `place` in the ledger came.
    pub(super) fn came(&mut self, place: usize) {
        let Some(open) = &mut self.ledger[place] else { return };
        open.owed = open.owed.saturating_sub(1);
        open.count -= 1;
        if open.count == 0
            && let Some(open) = self.ledger[place].take()
        {
            self.is_owed_still(open);
        }
    }

    /// `open` is not in the ledger any more. What it owes may be listed as what took its place: that owes it now.
    pub(super) fn is_owed_still(&mut self, open: Open) {
        // What comes damaged and not again was no other either.
        if open.again || open.expected.is_echo() {
            return;
        }
        let mut owed = open.owed;
        for other in self.ledger.iter_mut().flatten() {
            if other.unit == open.unit && !other.expected.is_echo() {
                let more = owed.min(other.count.saturating_sub(other.owed));
                other.owed += more;
                owed -= more;
            }
        }
    }
}
