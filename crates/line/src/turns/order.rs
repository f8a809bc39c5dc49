//! Who is next among those who wait for the line: the rule alone, without threads and without a clock.

use std::cmp::Ordering;

use drivebus_rtu::UnitAddress;

/// How many turns of a higher class, asked for later, somebody who waits lets go before it. Stops do not count.
///
/// Chosen so that the higher class keeps 32 of 33 turns however much waits below it, and so that who waits at a line
/// of 9600 bit/s, where a turn takes some 30 ms, waits about a second for each who came before it.
pub(crate) const OVERTAKEN_AT_MOST: u32 = 32;

/// Broadcasts are a unit of their own, with the address they have on the wire; 247 is the highest.
const UNITS: usize = 248;
const CLASSES: usize = 4;

/// Who goes first among those who wait for the line.
///
/// Stops go in the order they came. Within each other class the programs that share the line take turns, of each its units
/// do, and the calls for one unit go in the order they came. Who waits while calls of a higher class that came later go first 32 times goes before them then, and
/// of several such the one that came first.
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
    /// Lower came earlier.
    number: u64,
    claim: Claim,
}

/// Those who wait, and when each program and each unit had its last turn. `T` is what the caller keeps about each.
#[derive(Debug)]
pub(crate) struct Order<T> {
    arrivals: u64,
    turns: u64,
    waiting: Vec<Waiting<T>>,
    /// The number of the last turn, for each unit of each class: a stop or a write takes nothing from the unit's reads.
    last_turn: Vec<u64>,
    /// The same for each program of each class.
    last_turn_of: Vec<[u64; CLASSES]>,
}

#[derive(Debug)]
struct Waiting<T> {
    ticket: Ticket,
    /// How often it was overtaken by later arrivals of a higher class.
    overtaken: u32,
    /// It had the turn already, and lets stops pass.
    aside: bool,
    whose: T,
}

impl Ticket {
    pub(crate) fn is_stop(&self) -> bool {
        self.claim.priority == Priority::Stop
    }

    /// Where the last turn of its unit in its class is kept.
    fn place(&self) -> usize {
        self.claim.priority as usize * UNITS + self.claim.unit.map_or(0, |unit| usize::from(unit.get()))
    }
}

impl<T> Default for Order<T> {
    fn default() -> Self {
        let last_turn = vec![0; CLASSES * UNITS];
        Self { arrivals: 0, turns: 0, waiting: Vec::new(), last_turn, last_turn_of: vec![[0; CLASSES]] }
    }
}

impl<T> Order<T> {
    /// A ticket for somebody who comes now.
    pub(crate) fn ticket(&mut self, claim: Claim) -> Ticket {
        self.arrivals += 1;
        let programs = usize::from(claim.program.0) + 1;
        if self.last_turn_of.len() < programs {
            self.last_turn_of.resize(programs, [0; CLASSES]);
        }
        Ticket { number: self.arrivals, claim }
    }

    /// `ticket` waits.
    pub(crate) fn wait(&mut self, ticket: Ticket, whose: T) {
        self.waiting.push(Waiting { ticket, overtaken: 0, aside: false, whose });
    }

    /// `ticket`, which has the turn, waits until the stops have passed.
    pub(crate) fn step_aside(&mut self, ticket: Ticket, whose: T) {
        self.waiting.push(Waiting { ticket, overtaken: 0, aside: true, whose });
    }

    /// `ticket` waits no longer; `None` if it does not wait.
    pub(crate) fn leave(&mut self, ticket: Ticket) -> Option<T> {
        let index = self.waiting.iter().position(|other| other.ticket == ticket)?;
        Some(self.waiting.swap_remove(index).whose)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// How many wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }

    /// What is kept about those who wait, in no order.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = &T> {
        self.waiting.iter().map(|waiting| &waiting.whose)
    }

    pub(crate) fn has_stop(&self) -> bool {
        self.waiting.iter().any(|waiting| waiting.ticket.is_stop())
    }

    /// Who is next.
    pub(crate) fn next(&self) -> Option<&T> {
        self.next_index().map(|index| &self.waiting[index].whose)
    }

    /// The place of who is next.
    pub(crate) fn next_ticket(&self) -> Option<Ticket> {
        self.next_index().map(|index| self.waiting[index].ticket)
    }

    /// All who wait and of whom `who` says so wait no longer.
    pub(crate) fn dismiss(&mut self, who: impl Fn(&T) -> bool) -> Vec<T> {
        let (gone, kept) = std::mem::take(&mut self.waiting).into_iter().partition(|waiting| who(&waiting.whose));
        self.waiting = kept;
        gone.into_iter().map(|waiting| waiting.whose).collect()
    }

    /// `ticket` has the turn now, if it is next.
    pub(crate) fn take(&mut self, ticket: Ticket) -> Option<T> {
        let index = self.next_index().filter(|&index| self.waiting[index].ticket == ticket)?;
        let taken = self.waiting.swap_remove(index);
        // The turn of one who stepped aside was counted when it began.
        if !taken.aside {
            self.count(ticket, taken.is_late());
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
        self.last_turn[ticket.place()] = self.turns;
        self.last_turn_of[usize::from(ticket.claim.program.0)][ticket.claim.priority as usize] = self.turns;
        for other in &mut self.waiting {
            match other.ticket.number.cmp(&ticket.number) {
                // One turn for all who came later, else a crowd of them would hold up the higher classes at one go.
                Ordering::Greater if late => other.overtaken = 0,
                Ordering::Less if ticket.claim.priority < other.ticket.claim.priority && !ticket.is_stop() => {
                    other.overtaken += 1;
                }
                _ => {}
            }
        }
    }

    fn next_index(&self) -> Option<usize> {
        (0..self.waiting.len()).min_by_key(|&index| self.rank(&self.waiting[index]))
    }

    /// The lowest is next: stops, who let them pass, who was overtaken too often, and then class by class. Within a class
    /// by the last turn of the program and then of the unit, so that one with many tickets takes no more turns than one with
    /// few.
    fn rank(&self, waiting: &Waiting<T>) -> (u8, u64, u64, u64) {
        let Ticket { number, claim } = waiting.ticket;
        let class = match claim.priority {
            Priority::Stop => return (0, 0, 0, number),
            _ if waiting.aside => return (1, 0, 0, number),
            _ if waiting.is_late() => return (2, 0, 0, number),
            Priority::Write => 3,
            Priority::Read => 4,
            Priority::Poll => 5,
        };
        let of_program = self.last_turn_of[usize::from(claim.program.0)][claim.priority as usize];
        (class, of_program, self.last_turn[waiting.ticket.place()], number)
    }
}

impl<T> Waiting<T> {
    fn is_late(&self) -> bool {
        self.overtaken >= OVERTAKEN_AT_MOST
    }
}

#[cfg(test)]
mod tests;
