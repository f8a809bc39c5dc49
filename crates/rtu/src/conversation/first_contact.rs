//! A stop's reads on a line that was just opened: how the answer is told from another program's where no echo comes back.
//!
//! A program that had the line before may have left questions open, and nobody knows which. They are answered in order, and
//! before all that is asked here. So what is taken for the answer to a question is another program's only where what was
//! taken for the answers to the questions before it was, too. Behind [`LEFT_OPEN`] answers the next one is ours; whose
//! question it answers its shape tells, where nothing else that this program asked since has the same: words in a number
//! that was not asked for before, or another function. It proves that the unit has caught up, as an echo does.

use core::time::Duration;

use super::longer_reads::{Longer, Shape, shape};
use crate::{Attribution, Instant, Master, Request, Table, UnitAddress};

/// Questions to one unit that other programs may have left open when the line was opened: of one that asks one at a time,
/// the one that it gave up and the one behind it.
const LEFT_OPEN: u8 = 2;

/// How a stop's read is put at first contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Put {
    /// As it is: the unit has caught up.
    Plain,
    /// As a read of so many words. If words come, they are the answer, and the unit has caught up.
    Apart(u16),
    /// The same, but what comes may be another program's: it is asked once more.
    First(u16),
    /// Behind a read of one input register, whose answer and whose refusal have a function of their own.
    BehindInput,
}

/// Reads of a unit whose shape is remembered. With more it is as if something was asked whose answer may have any shape.
const READS: usize = 16;

/// Reads of a unit that may not have been answered by their own answer: of more it is not known any more that they are
/// owed by it no longer, and they count as owed.
const UNPROVEN: usize = 8;

/// What a unit was asked and has answered since the line was opened.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Met {
    /// Answers and refusals that were taken for those to what it was asked.
    answers: u8,
    /// The shapes of the reads that it was asked for in doubt, whatever became of them.
    reads: [Option<Shape>; READS],
    /// Reads of these places that were answered or refused, perhaps not by their own answer: that is still owed then.
    unproven: [Option<(Table, u16, u16)>; UNPROVEN],
    /// Something was asked in doubt whose answer may have any shape.
    is_blurred: bool,
    /// It has caught up.
    is_sure: bool,
}

impl Met {
    /// It is asked `request` in doubt.
    pub(super) fn asked(&mut self, request: &Request<'_>) {
        match *request {
            Request::Read { .. } => {
                let shape = shape(request);
                match self.reads.iter_mut().find(|read| read.is_none_or(|read| read == shape)) {
                    Some(read) => *read = Some(shape),
                    None => self.is_blurred = true,
                }
            }
            Request::Custom { .. } | Request::Huanyang(_) => self.is_blurred = true,
            _ => {}
        }
    }

    /// It answered what it was asked, or refused it, as far as anybody can tell.
    pub(super) fn answered(&mut self) {
        self.answers = self.answers.saturating_add(1);
    }

    /// `unit` gave what could only be the answer: nothing that it was asked before is owed.
    pub(super) fn is_sure(&mut self, master: &mut Master, now: Instant, unit: UnitAddress) {
        self.is_sure = true;
        for (table, address, count) in self.unproven.iter_mut().filter_map(Option::take) {
            if let Ok(read) = Request::read_of(table, address, count) {
                master.owed_no_more(now, unit, &read);
            }
        }
    }

    /// What `unit` gave for `request`, a read that was waited for for `timeout`, may have been another program's.
    pub(super) fn is_unproven(
        &mut self,
        master: &mut Master,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
        timeout: Duration,
    ) {
        if let Request::Read { table, address, count, .. } = *request {
            if let Some(free) = self.unproven.iter_mut().find(|read| read.is_none()) {
                *free = Some((table, address, count));
            }
            master.still_owed(now, unit, request, timeout);
        }
    }

    /// Whether the next answer in a shape of its own is no other program's.
    pub(super) const fn is_behind_all(&self) -> bool {
        self.answers >= LEFT_OPEN
    }

    fn has_read(&self, is_it: impl Fn(Shape) -> bool) -> bool {
        self.reads.iter().flatten().any(|&shape| is_it(shape))
    }

    /// How to put `request`, a read, to `unit`; `None` where its answer could not be told.
    pub(super) fn put<const N: usize>(
        &self,
        master: &Master,
        longer: &Longer<N>,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
    ) -> Option<Put> {
        let Request::Read { address, .. } = *request else { return None };
        if self.is_sure && master.attribution(now, unit, request) == Attribution::Certain {
            return Some(Put::Plain);
        }
        if self.is_blurred {
            return None;
        }
        let apart = longer.lengths(unit, request).find(|(_, read)| {
            let asked = shape(read);
            !self.has_read(|shape| shape == asked) && !master.attribution(now, unit, read).may_be_mistaken()
        });
        match apart.map(|(words, _)| words) {
            Some(words) if self.is_behind_all() => Some(Put::Apart(words)),
            Some(words) => Some(Put::First(words)),
            None => {
                let input = Request::read_of(Table::Input, address, 1).ok()?;
                let function = input.expected().function();
                let is_new = !self.has_read(|asked| asked.function() == function)
                    && master.attribution(now, unit, &input) == Attribution::Certain;
                is_new.then_some(Put::BehindInput)
            }
        }
    }
}
