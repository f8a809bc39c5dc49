//! The rule of the order as it reads: everybody who waits is looked at for each turn. What [`Order`](super::Order) keeps
//! sorted is compared with it.

use std::cmp::Ordering;

use super::{Claim, Number, OVERTAKEN_AT_MOST, Priority, Ticket, UNITS};

const CLASSES: usize = 4;

/// Those who wait, in no order.
#[derive(Debug)]
pub(super) struct Linear<T> {
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

/// Where the last turn of its unit in its class is kept.
fn place(ticket: Ticket) -> usize {
    ticket.claim.priority as usize * UNITS + ticket.claim.unit.map_or(0, |unit| usize::from(unit.get()))
}

impl<T> Default for Linear<T> {
    fn default() -> Self {
        let last_turn = vec![0; CLASSES * UNITS];
        Self { turns: 0, waiting: Vec::new(), last_turn, last_turn_of: vec![[0; CLASSES]] }
    }
}

impl<T> Linear<T> {
    /// There is a program of this number.
    pub(super) fn knows(&mut self, claim: Claim) {
        let programs = usize::from(claim.program.0) + 1;
        if self.last_turn_of.len() < programs {
            self.last_turn_of.resize(programs, [0; CLASSES]);
        }
    }

    /// `ticket` waits.
    pub(super) fn wait(&mut self, ticket: Ticket, whose: T) {
        self.waiting.push(Waiting { ticket, overtaken: 0, aside: false, whose });
    }

    /// `ticket`, which has the turn, waits until the stops have passed.
    pub(super) fn step_aside(&mut self, ticket: Ticket, whose: T) {
        self.waiting.push(Waiting { ticket, overtaken: 0, aside: true, whose });
    }

    /// `ticket` waits no longer; `None` if it does not wait.
    pub(super) fn leave(&mut self, ticket: Ticket) -> Option<T> {
        let index = self.waiting.iter().position(|other| other.ticket == ticket)?;
        Some(self.waiting.swap_remove(index).whose)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// How many wait.
    pub(super) fn len(&self) -> usize {
        self.waiting.len()
    }

    pub(super) fn has_stop(&self) -> bool {
        self.waiting.iter().any(|waiting| waiting.ticket.is_stop())
    }

    /// The place of who is next.
    pub(super) fn next_ticket(&self) -> Option<Ticket> {
        self.next_index().map(|index| self.waiting[index].ticket)
    }

    /// All who wait and of whom `who` says so wait no longer.
    pub(super) fn dismiss(&mut self, who: impl Fn(&T) -> bool) -> Vec<T> {
        let (gone, kept) = std::mem::take(&mut self.waiting).into_iter().partition(|waiting| who(&waiting.whose));
        self.waiting = kept;
        gone.into_iter().map(|waiting| waiting.whose).collect()
    }

    /// `ticket` has the turn now, if it is next.
    pub(super) fn take(&mut self, ticket: Ticket) -> Option<T> {
        let index = self.next_index().filter(|&index| self.waiting[index].ticket == ticket)?;
        let taken = self.waiting.swap_remove(index);
        // The turn of one who stepped aside was counted when it began.
        if !taken.aside {
            self.count(ticket, taken.is_late());
        }
        Some(taken.whose)
    }

    /// `ticket` has the turn without waiting: nobody waits.
    pub(super) fn begin(&mut self, ticket: Ticket) {
        self.count(ticket, false);
    }

    fn count(&mut self, ticket: Ticket, late: bool) {
        self.turns += 1;
        self.last_turn[place(ticket)] = self.turns;
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
    fn rank(&self, waiting: &Waiting<T>) -> (u8, u64, u64, Number) {
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
        (class, of_program, self.last_turn[place(waiting.ticket)], number)
    }
}

impl<T> Waiting<T> {
    fn is_late(&self) -> bool {
        self.overtaken >= OVERTAKEN_AT_MOST
    }
}
