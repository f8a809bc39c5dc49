//! Reads on a line where another master may ask the same unit, and its answers come here, too: how they are put so that what
//! is taken for an answer can be no other's.
//!
//! | what is known | what is done |
//! | --- | --- |
//! | nothing yet | the first answer is believed when the answer to another read came behind it, and none of its length between |
//! | nobody was heard | no two reads that follow each other closely have one length, so that an answer that comes one too late shows |
//! | somebody asks this unit | the first answer of each length is believed so, too |
//! | somebody asks for this length | another length |
//! | somebody asks for all lengths that the unit gives | the call ends: nothing tells the answers apart |
//!
//! An answer of another's that is taken for the own one leaves the own one to come. Behind it nothing is silent: the next
//! request is out by then, and all that follow are answered by what the one before asked. That is what shows here.

use super::known::{Ask, Known, Next};
use super::longer_reads::{Shape, shape};
use super::probes::{MAX_WORDS, Probe};
use super::watched::Watched;
use crate::{Attribution, Destination, FIRST_CONTACT, Instant, Request, Table, UnitAddress};

/// Of so many lengths, the shortest that are free, one is chosen by chance: two that do the same must not do it in step.
const CHOICE: usize = 8;

/// Lengths that are looked at: all that a read may be asked for in.
const LENGTHS: usize = MAX_WORDS as usize;

/// A few lengths, shortest first.
struct Lengths {
    of: [(u16, Shape); LENGTHS],
    len: usize,
}

impl Lengths {
    const NONE: Self = Self { of: [(0, Shape::NONE); LENGTHS], len: 0 };

    fn push(&mut self, words: u16, shape: Shape) {
        if let Some(free) = self.of.get_mut(self.len) {
            *free = (words, shape);
            self.len += 1;
        }
    }

    fn all(&self) -> &[(u16, Shape)] {
        &self.of[..self.len]
    }

    fn has(&self, shape: Shape) -> bool {
        self.all().iter().any(|(_, known)| *known == shape)
    }
}

impl<const U: usize, const P: usize> Known<U, P> {
    /// Whether another master may ask on this line.
    pub const fn may_have_others(&self) -> bool {
        self.others
    }

    fn watched(&self, unit: UnitAddress) -> Watched {
        self.units.get(unit).map(|known| known.watched).unwrap_or_default()
    }

    /// What comes before `ask` where others may ask `unit`, or how it is put; `None`: as everywhere. `apart`: the caller
    /// takes a longer read for its own.
    #[cold]
    pub(super) fn next_among_others(
        &mut self,
        now: Instant,
        unit: UnitAddress,
        ask: &Ask<'_>,
        attribution: Attribution,
        in_quarantine: bool,
        apart: bool,
    ) -> Option<Next> {
        let theirs = match attribution {
            Attribution::Others(until) => Some(until),
            _ => None,
        };
        if !matches!(ask.request, Request::Read { .. }) {
            return theirs.filter(|_| !in_quarantine).map(|_| Next::AskUntold);
        }
        let (watched, has_others) = (self.watched(unit), self.master.has_others(now, unit));
        let is_watched = has_others || !watched.has_met();
        let is_behind = watched.may_be_behind(now, shape(&ask.request));
        if theirs.is_none() {
            if !apart {
                let parts = is_behind && !in_quarantine;
                return parts.then(|| self.parts(now, unit, &ask.request)).flatten();
            }
            if !is_watched && !is_behind {
                return None;
            }
        }
        let mut free = Lengths::NONE;
        for (words, read) in self.longer.lengths(unit, &ask.request) {
            if !free.has(shape(&read)) && self.is_told(now, unit, &read, in_quarantine) {
                free.push(words, shape(&read));
            }
        }
        if free.all().is_empty() {
            return match theirs {
                _ if in_quarantine => None,
                // What is heard in first contact may be late.
                Some(until) if until <= now + FIRST_CONTACT => Some(Next::Wait(until)),
                Some(_) => Some(Next::OthersAsk),
                None => None,
            };
        }
        let mut ahead = Lengths::NONE;
        for &(words, shape) in free.all() {
            if !watched.may_be_behind(now, shape) {
                ahead.push(words, shape);
            }
        }
        let is_known = |shape: Shape| !has_others || watched.is_proven(shape);
        let known = ahead.all().iter().find(|(_, shape)| is_known(*shape)).copied();
        match known.or_else(|| self.by_chance(ahead.all())) {
            Some((words, _)) => Some(Next::AskApart(words)),
            None if in_quarantine => None,
            None => self.parts(now, unit, &ask.request),
        }
    }

    /// Whether nothing that may come could pass for the answer to `read`.
    fn is_told(&self, now: Instant, unit: UnitAddress, read: &Request<'_>, in_quarantine: bool) -> bool {
        if in_quarantine {
            self.master.tells_apart(now, unit, read)
        } else {
            !self.master.attribution(now, unit, read).may_be_mistaken()
        }
    }

    /// A read whose answer cannot be taken for that to `request`, nor for one of others.
    fn parts(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<Next> {
        let Request::Read { address, table: Table::Holding, .. } = *request else { return None };
        let count = self.other_length(now, unit, request)?;
        Some(Next::Probe(Probe::OtherRead { address, count }))
    }

    /// So many words from where `request` reads, as that looks like neither its answer nor anybody's: fewer than it asks for,
    /// or more, unless `unit` was heard to refuse them.
    pub(super) fn other_length(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<u16> {
        let Request::Read { table, address, count, .. } = *request else { return None };
        let is_free = |read: &Request<'_>| shape(read) != shape(request) && self.is_told(now, unit, read, false);
        let mut free = Lengths::NONE;
        let fewer = (1..count).filter_map(|words| Some((words, Request::read_of(table, address, words).ok()?)));
        for (words, read) in fewer.filter(|(_, read)| is_free(read)).take(CHOICE) {
            free.push(words, shape(&read));
        }
        if free.all().is_empty() {
            for (words, read) in self.longer.lengths(unit, request).filter(|(_, read)| is_free(read)).take(CHOICE) {
                free.push(words, shape(&read));
            }
        }
        let one =
            if self.master.has_others(now, unit) { self.by_chance(free.all()) } else { free.all().first().copied() };
        one.map(|(words, _)| words)
    }

    /// One of the first few.
    fn by_chance(&mut self, free: &[(u16, Shape)]) -> Option<(u16, Shape)> {
        // Xorshift, 64 bits: G. Marsaglia, Xorshift RNGs, Journal of Statistical Software 8 (14), 2003.
        self.chance ^= self.chance << 13;
        self.chance ^= self.chance >> 7;
        self.chance ^= self.chance << 17;
        let [number, ..] = self.chance.to_be_bytes();
        free.get(usize::from(number) % free.len().clamp(1, CHOICE)).copied()
    }

    /// How many words to read from `address` of `destination` where only what the adapter makes of it matters: `count`, or
    /// as many as no other asks for.
    pub(super) fn free_length(&self, now: Instant, destination: Destination, address: u16, count: u16) -> u16 {
        let (Destination::Unit(unit), true) = (destination, self.others) else { return count };
        let is_free = |words: &u16| {
            let read = Request::read(address, *words);
            read.is_ok_and(|read| !matches!(self.master.attribution(now, unit, &read), Attribution::Others(_)))
        };
        (count..=MAX_WORDS).find(is_free).unwrap_or(count)
    }

    /// Whether nobody knows yet whether somebody else asks `unit` for what `request` does: where somebody is there, and of a
    /// unit that was not read before.
    pub(super) fn is_unproven(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> bool {
        if !self.others {
            return false;
        }
        let has_others = self.master.has_others(now, unit);
        let watched = &mut self.units.of(unit).watched;
        if !has_others {
            watched.forgets_what_was_proven();
            return !watched.has_met();
        }
        !watched.is_proven(shape(request))
    }

    /// Whether nothing came behind the answer of `unit` to `request` that may have been it, too: then nobody else asks so.
    pub(super) fn proves(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> bool {
        let is_ours = !matches!(self.master.attribution(now, unit, request), Attribution::Others(_));
        if is_ours {
            let has_others = self.master.has_others(now, unit);
            let watched = &mut self.units.of(unit).watched;
            watched.meets();
            if has_others {
                watched.proves(shape(request));
            }
        }
        is_ours
    }
}
