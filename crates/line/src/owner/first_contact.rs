//! A stop's reads on a line that was just opened: how the answer is told from another program's where no echo comes back.
//!
//! A program that had the line before may have left questions open, and nobody knows which. They are answered in order, and
//! before all that is asked here. So what is taken for the answer to a question is another program's only where what was
//! taken for the answers to the questions before it was, too. Behind [`LEFT_OPEN`] answers the next one is ours; whose
//! question it answers its shape tells, where nothing else that this program asked since has the same: words in a number
//! that was not asked for before, or another function. It proves that the unit has caught up, as an echo does.

use std::collections::BTreeSet;
use std::time::Duration;

use drivebus_rtu::{Attribution, Instant, Master, Request, Table, UnitAddress};

use crate::by_unit::ByUnit;
use crate::owner::longer_reads::Longer;

/// Questions to one unit that other programs may have left open when the line was opened: of one that asks one at a time,
/// the one that it gave up and the one behind it.
const LEFT_OPEN: u8 = 2;

/// How a stop's read is put at first contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Put {
    /// As it is: the unit has caught up.
    Plain,
    /// As a read of so many words. If words come, they are the answer, and the unit has caught up.
    Apart(u16),
    /// The same, but what comes may be another program's: it is asked once more.
    First(u16),
    /// Behind a read of one input register, whose answer and whose refusal have a function of their own.
    BehindInput,
}

/// The function of an answer to a read, and how long it is.
type Shape = (u8, Option<usize>);

/// What each unit was asked and has answered since the line was opened.
#[derive(Debug, Default)]
pub(crate) struct Met(ByUnit<Known>);

#[derive(Debug, Default)]
struct Known {
    /// Answers and refusals that were taken for those to what it was asked.
    answers: u8,
    /// The reads that it was asked for in doubt, whatever became of them.
    reads: BTreeSet<Shape>,
    /// Reads of these places that were answered or refused, perhaps not by their own answer: that is still owed then.
    unproven: Vec<(Table, u16, u16)>,
    /// Something was asked in doubt whose answer may have any shape.
    is_blurred: bool,
    /// It has caught up.
    is_sure: bool,
}

impl Met {
    /// The line was opened.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// `unit` is asked `request` in doubt.
    pub(crate) fn asked(&mut self, unit: UnitAddress, request: &Request<'_>) {
        let known = self.0.of(unit);
        match *request {
            Request::Read { .. } => {
                known.reads.insert(shape(request));
            }
            Request::Custom { .. } => known.is_blurred = true,
            _ => {}
        }
    }

    /// `unit` answered what it was asked, or refused it, as far as anybody can tell.
    pub(crate) fn answered(&mut self, unit: UnitAddress) {
        let known = self.0.of(unit);
        known.answers = known.answers.saturating_add(1);
    }

    /// `unit` gave what could only be the answer: nothing that it was asked before is owed.
    pub(crate) fn is_sure(&mut self, master: &mut Master, now: Instant, unit: UnitAddress) {
        let known = self.0.of(unit);
        known.is_sure = true;
        for (table, address, count) in known.unproven.drain(..) {
            if let Ok(read) = Request::read_of(table, address, count) {
                master.owed_no_more(now, unit, &read);
            }
        }
    }

    /// What `unit` gave for `request`, a read that was waited for for `timeout`, may have been another program's.
    pub(crate) fn is_unproven(
        &mut self,
        master: &mut Master,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
        timeout: Duration,
    ) {
        if let Request::Read { table, address, count, .. } = *request {
            self.0.of(unit).unproven.push((table, address, count));
            master.still_owed(now, unit, request, timeout);
        }
    }

    /// Whether the next answer of `unit` in a shape of its own is no other program's.
    pub(crate) fn is_behind_all(&self, unit: UnitAddress) -> bool {
        self.0.get(unit).is_some_and(|known| known.answers >= LEFT_OPEN)
    }

    /// How to put `request`, a read, to `unit`; `None` where its answer could not be told.
    pub(crate) fn put(
        &self,
        master: &Master,
        longer: &Longer,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
    ) -> Option<Put> {
        let Request::Read { address, .. } = *request else { return None };
        let nothing = Known::default();
        let known = self.0.get(unit).unwrap_or(&nothing);
        if known.is_sure && master.attribution(now, unit, request) == Attribution::Certain {
            return Some(Put::Plain);
        }
        if known.is_blurred {
            return None;
        }
        let apart = longer.lengths(unit, request).find(|(_, read)| {
            !known.reads.contains(&shape(read)) && !master.attribution(now, unit, read).may_be_mistaken()
        });
        match apart.map(|(words, _)| words) {
            Some(words) if self.is_behind_all(unit) => Some(Put::Apart(words)),
            Some(words) => Some(Put::First(words)),
            None => {
                let input = Request::read_of(Table::Input, address, 1).ok()?;
                let function = input.expected().function();
                let is_new = known.reads.iter().all(|(asked, _)| *asked != function)
                    && master.attribution(now, unit, &input) == Attribution::Certain;
                is_new.then_some(Put::BehindInput)
            }
        }
    }
}

fn shape(read: &Request<'_>) -> Shape {
    let expected = read.expected();
    (expected.function(), expected.adu_len())
}
