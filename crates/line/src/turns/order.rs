//! Who is next among those who wait for the line: the rule alone, without threads and without a clock.

mod class;

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use drivebus_rtu::UnitAddress;

use class::{Class, Kin};

/// How many turns of a higher class, asked for later, somebody who waits lets go before it. Stops do not count.
///
/// Chosen so that the higher class keeps 32 of 33 turns however much waits below it, and so that who waits at a line
/// of 9600 bit/s, where a turn takes some 30 ms, waits about a second for each who came before it.
pub(crate) const OVERTAKEN_AT_MOST: u32 = 32;

/// Broadcasts are a unit of their own, with the address they have on the wire, as the device that is 0 over Modbus TCP.
const UNITS: usize = 256;
/// Those beside stops.
const CLASSES: usize = 3;

/// Who goes first among those who wait for the line.
///
/// Stops go in the order they came. Within each other class the programs that share the line take turns, of each its units
/// do, and the calls for one unit go in the order they came. Who waits while calls of a higher class that came later go
/// first 32 times goes before them then, and of several such the one that came first; but before a stop nobody goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[non_exhaustive]
pub enum Priority {
    /// What makes a motor stop, and the reads that confirm it: before all who wait.
    Stop,
    /// What changes something in a unit.
    Write,
    /// What somebody waits for.
    #[default]
    Read,
    /// What is asked again and again: when nobody else wants the line.
    Poll,
}

/// Which program a request is of: this one, or one of those that use the line through it. A number of the caller's
/// choosing, as low as can be: something is kept for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Program(pub(crate) u16);

/// What a turn is wanted for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Claim {
    pub(crate) priority: Priority,
    /// `None` for a broadcast and for what concerns the whole line.
    pub(crate) unit: Option<UnitAddress>,
    pub(crate) program: Program,
}

impl From<(Priority, Option<UnitAddress>)> for Claim {
    /// Of this program.
    fn from((priority, unit): (Priority, Option<UnitAddress>)) -> Self {
        Self { priority, unit, program: Program::default() }
    }
}

/// A place in the order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Ticket {
    number: Number,
    claim: Claim,
}

/// When somebody came, or had a turn: lower is earlier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Number(u64);

impl Ord for Number {
    fn cmp(&self, other: &Self) -> Ordering {
        #[cfg(test)]
        tests::compares();
        self.0.cmp(&other.0)
    }
}

impl PartialOrd for Number {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Those who wait, and when each program and each unit had its last turn. `T` is what the caller keeps about each.
///
/// The lowest is next: stops, who let them pass, who was overtaken too often, and then class by class. Within a class by the
/// last turn of the program and then of the unit, so that one with many tickets takes no more turns than one with few. Each
/// of these is kept sorted: a turn costs the logarithm of what waits.
#[derive(Debug)]
pub(crate) struct Order<T> {
    arrivals: u64,
    turns: u64,
    /// All who wait, by when they came.
    waiting: BTreeMap<Number, Waiting<T>>,
    stops: BTreeSet<Number>,
    /// Who had the turn already, and lets stops pass.
    aside: BTreeSet<Number>,
    /// The others, by class, the highest first.
    classes: [Class; CLASSES],
}

#[derive(Debug)]
struct Waiting<T> {
    ticket: Ticket,
    /// It had the turn already, and lets stops pass.
    aside: bool,
    whose: T,
}

impl Ticket {
    pub(crate) fn is_stop(&self) -> bool {
        self.claim.priority == Priority::Stop
    }

    /// Where its class is kept; none for a stop, which goes before all classes.
    fn class(&self) -> Option<usize> {
        (self.claim.priority as usize).checked_sub(Priority::Write as usize)
    }

    fn kin(&self) -> Kin {
        (self.claim.unit.map_or(0, UnitAddress::get), self.claim.program.0)
    }
}

impl<T> Default for Order<T> {
    fn default() -> Self {
        Self {
            arrivals: 0,
            turns: 0,
            waiting: BTreeMap::new(),
            stops: BTreeSet::new(),
            aside: BTreeSet::new(),
            classes: Default::default(),
        }
    }
}

impl<T> Order<T> {
    /// A ticket for somebody who comes now, and waits before anybody else has a turn.
    pub(crate) fn ticket(&mut self, claim: Claim) -> Ticket {
        self.arrivals += 1;
        let ticket = Ticket { number: Number(self.arrivals), claim };
        if let Some(class) = ticket.class() {
            self.classes[class].knows(claim.program.0);
        }
        ticket
    }

    /// `ticket` waits.
    pub(crate) fn wait(&mut self, ticket: Ticket, whose: T) {
        match ticket.class() {
            Some(class) => self.classes[class].wait(ticket.number, ticket.kin()),
            None => _ = self.stops.insert(ticket.number),
        }
        self.waiting.insert(ticket.number, Waiting { ticket, aside: false, whose });
    }

    /// `ticket`, which has the turn, waits until the stops have passed.
    pub(crate) fn step_aside(&mut self, ticket: Ticket, whose: T) {
        let set = if ticket.is_stop() { &mut self.stops } else { &mut self.aside };
        set.insert(ticket.number);
        self.waiting.insert(ticket.number, Waiting { ticket, aside: true, whose });
    }

    /// `ticket` waits no longer; `None` if it does not wait.
    pub(crate) fn leave(&mut self, ticket: Ticket) -> Option<T> {
        self.remove(ticket.number).map(|gone| gone.whose)
    }

    fn remove(&mut self, number: Number) -> Option<Waiting<T>> {
        let gone = self.waiting.remove(&number)?;
        match gone.ticket.class() {
            None => _ = self.stops.remove(&number),
            Some(_) if gone.aside => _ = self.aside.remove(&number),
            Some(class) => self.classes[class].leave(number, gone.ticket.kin()),
        }
        Some(gone)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// How many wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }

    /// What is kept about those who wait, in no order.
    #[cfg(test)]
    pub(crate) fn waiting(&self) -> impl Iterator<Item = &T> {
        self.waiting.values().map(|waiting| &waiting.whose)
    }

    pub(crate) fn has_stop(&self) -> bool {
        !self.stops.is_empty()
    }

    /// Who is next.
    pub(crate) fn next(&self) -> Option<&T> {
        self.waiting.get(&self.next_number()?).map(|waiting| &waiting.whose)
    }

    /// The place of who is next.
    pub(crate) fn next_ticket(&self) -> Option<Ticket> {
        self.waiting.get(&self.next_number()?).map(|waiting| waiting.ticket)
    }

    /// All who wait and of whom `who` says so wait no longer.
    pub(crate) fn dismiss(&mut self, who: impl Fn(&T) -> bool) -> Vec<T> {
        let gone = self.waiting.iter().filter(|(_, waiting)| who(&waiting.whose)).map(|(&number, _)| number);
        let gone: Vec<Number> = gone.collect();
        gone.into_iter().filter_map(|number| self.remove(number)).map(|gone| gone.whose).collect()
    }

    /// `ticket` has the turn now, if it is next.
    pub(crate) fn take(&mut self, ticket: Ticket) -> Option<T> {
        let number = self.next_number().filter(|&number| number == ticket.number)?;
        let taken = self.remove(number)?;
        // The turn of one who stepped aside was counted when it began.
        if !taken.aside {
            let late = ticket.class().is_some_and(|class| self.classes[class].is_late(number));
            self.count(ticket, late);
        }
        Some(taken.whose)
    }

    /// `ticket` has the turn without waiting: nobody waits.
    pub(crate) fn begin(&mut self, ticket: Ticket) {
        self.count(ticket, false);
    }

    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    fn count(&mut self, ticket: Ticket, late: bool) {
        self.turns += 1;
        let Some(class) = ticket.class() else { return };
        self.classes[class].count(ticket.kin(), Number(self.turns));
        if late {
            // One turn for all who came later, else a crowd of them would hold up the higher classes at one go.
            self.classes.iter_mut().for_each(|class| class.forgives(ticket.number));
        }
        self.classes[class + 1..].iter_mut().for_each(|lower| lower.is_overtaken(ticket.number));
    }

    fn next_number(&self) -> Option<Number> {
        let late = || self.classes.iter().filter_map(Class::late).min();
        let by_class = || self.classes.iter().find_map(Class::next);
        self.stops.first().or_else(|| self.aside.first()).copied().or_else(late).or_else(by_class)
    }
}

#[cfg(test)]
mod tests;
