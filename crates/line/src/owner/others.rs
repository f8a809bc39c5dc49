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

use std::collections::BTreeSet;
use std::hash::{BuildHasher, Hasher, RandomState};

use drivebus_rtu::{Attribution, Destination, FIRST_CONTACT, Instant, Request, Table, UnitAddress};

use crate::ask::Ask;
use crate::by_unit::ByUnit;
use crate::error::{CallError, Failure};
use crate::owner::resync::{MAX_WORDS, Probe};
use crate::owner::{Next, Owner};

/// Of so many lengths, the shortest that are free, one is chosen by chance: two that do the same must not do it in step.
const CHOICE: usize = 8;

/// What answers to it look like: function and bytes on the wire.
type Look = (u8, Option<usize>);

fn look(request: &Request<'_>) -> Look {
    let expected = request.expected();
    (expected.function(), expected.adu_len())
}

/// What is remembered for telling apart.
#[derive(Debug, Default)]
pub(crate) struct Others {
    may_be: bool,
    units: ByUnit<Known>,
    /// What was found to be asked by nobody else, while somebody was there.
    proven: BTreeSet<(UnitAddress, Look)>,
}

#[derive(Debug, Default)]
struct Known {
    /// What it was asked last, and until when an answer to that may still come which was not taken.
    last: Option<(Look, Instant)>,
    /// A read of it was proven since the line was opened.
    met: bool,
}

impl Others {
    /// Another line: whether others may be on it.
    pub(crate) fn of_line(may_be: bool) -> Self {
        Self { may_be, ..Self::default() }
    }

    /// Whether there may be any.
    pub(crate) const fn may_be(&self) -> bool {
        self.may_be
    }

    /// At `now` `ask` of `unit` is over; whether it was refused.
    #[cold]
    pub(crate) fn asked(&mut self, now: Instant, unit: UnitAddress, ask: &Ask<'_>, refused: bool) {
        let known = self.units.of(unit);
        known.last = Some((look(ask.request), now + ask.timeout));
        known.met |= refused && matches!(ask.request, Request::Read { .. });
    }

    /// Whether the answer to what `unit` was asked before could come for that to `look`.
    fn may_be_behind(&self, now: Instant, unit: UnitAddress, look: Look) -> bool {
        let last = self.units.get(unit).and_then(|known| known.last);
        last.is_some_and(|(last, until)| last == look && now < until)
    }

    /// Whether `unit` was read since the line was opened.
    fn has_met(&self, unit: UnitAddress) -> bool {
        self.units.get(unit).is_some_and(|known| known.met)
    }
}

impl Owner {
    /// Whether another master may ask on this line.
    pub(crate) const fn may_have_others(&self) -> bool {
        self.others.may_be()
    }

    /// Takes down what came in since the last request, where it may be others'.
    #[inline]
    pub(crate) fn overhear(&mut self) -> Result<(), Failure> {
        if self.others.may_be() { self.take_down() } else { Ok(()) }
    }

    #[cold]
    fn take_down(&mut self) -> Result<(), Failure> {
        let mut buffer = [0; 256];
        while let Some(line) = self.line.as_deref_mut() {
            let now = line.now();
            let count = match line.receive(&mut buffer, now) {
                Ok(count) => count,
                Err(error) => {
                    self.close();
                    return Err(Failure::Port(error));
                }
            };
            if count == 0 {
                self.master.overhear(now);
                break;
            }
            self.stray(now, &buffer[..count]);
        }
        Ok(())
    }

    /// What comes before `ask` where others may ask `unit`, or how it is put; `None`: as everywhere. `apart`: the caller
    /// takes a longer read for its own.
    #[cold]
    pub(crate) fn next_among_others(
        &self,
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
        let is_watched = self.master.has_others(now, unit) || !self.others.has_met(unit);
        let is_behind = self.others.may_be_behind(now, unit, look(ask.request));
        if theirs.is_none() && !(is_watched && apart) {
            let parts = is_behind && !in_quarantine;
            if !apart || !is_behind {
                return parts.then(|| self.parts(now, unit, ask.request)).flatten();
            }
        }
        let mut free: Vec<(u16, Look)> = Vec::new();
        for (words, read) in self.longer.lengths(unit, ask.request) {
            let is_new = free.iter().all(|(_, known)| *known != look(&read));
            if is_new && self.is_told(now, unit, &read, in_quarantine) {
                free.push((words, look(&read)));
            }
        }
        if free.is_empty() {
            return match theirs {
                _ if in_quarantine => None,
                // What is heard in first contact may be late.
                Some(until) if until <= now + FIRST_CONTACT => Some(Next::Wait(until)),
                Some(_) => Some(Next::OthersAsk),
                None => None,
            };
        }
        free.retain(|(_, look)| !self.others.may_be_behind(now, unit, *look));
        let is_known = |look: &Look| !self.master.has_others(now, unit) || self.others.proven.contains(&(unit, *look));
        match free.iter().find(|(_, look)| is_known(look)).or_else(|| by_chance(&free)) {
            Some(&(words, _)) => Some(Next::AskApart(words)),
            None if in_quarantine => None,
            None => self.parts(now, unit, ask.request),
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
    fn parts(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<Next> {
        let Request::Read { address, table: Table::Holding, .. } = *request else { return None };
        let count = self.other_length(now, unit, request)?;
        Some(Next::Probe(unit, Probe::OtherRead { address, count }))
    }

    /// So many words from where `request` reads, as that looks like neither its answer nor anybody's: fewer than it asks for,
    /// or more, unless `unit` was heard to refuse them.
    fn other_length(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<u16> {
        let Request::Read { table, address, count, .. } = *request else { return None };
        let is_free = |read: &Request<'_>| look(read) != look(request) && self.is_told(now, unit, read, false);
        let fewer = (1..count).filter_map(|words| Some((words, Request::read_of(table, address, words).ok()?)));
        let mut free: Vec<_> = fewer.filter(|(_, read)| is_free(read)).map(|(words, _)| words).take(CHOICE).collect();
        if free.is_empty() {
            let more = self.longer.lengths(unit, request).filter(|(_, read)| is_free(read));
            free.extend(more.map(|(words, _)| words).take(CHOICE));
        }
        if self.master.has_others(now, unit) { by_chance(&free).copied() } else { free.first().copied() }
    }

    /// How many words to read from `address` of `destination` where only what the adapter makes of it matters: `count`, or
    /// as many as no other asks for.
    pub(crate) fn free_length(&self, destination: Destination, address: u16, count: u16) -> u16 {
        let (Destination::Unit(unit), true) = (destination, self.others.may_be()) else { return count };
        let now = self.now();
        let is_free = |words: &u16| {
            let read = Request::read(address, *words);
            read.is_ok_and(|read| !matches!(self.master.attribution(now, unit, &read), Attribution::Others(_)))
        };
        (count..=MAX_WORDS).find(is_free).unwrap_or(count)
    }

    /// Whether nobody knows yet whether somebody else asks `unit` for what `request` does: where somebody is there, and of a
    /// unit that was not read before.
    pub(crate) fn is_unproven(&mut self, unit: UnitAddress, request: &Request<'_>) -> bool {
        if !self.others.may_be() {
            return false;
        }
        if !self.master.has_others(self.now(), unit) {
            self.others.proven.retain(|(known, _)| *known != unit);
            return !self.others.has_met(unit);
        }
        !self.others.proven.contains(&(unit, look(request)))
    }

    /// `ask` of `unit` was answered: asks for another number of words, and tells whether nothing came between that may have
    /// been the answer, too.
    ///
    /// # Errors
    ///
    /// That was not answered.
    pub(crate) fn prove(
        &mut self,
        unit: UnitAddress,
        ask: &Ask<'_>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<bool, Box<CallError>> {
        let Request::Read { table, address, count, .. } = *ask.request else { return Ok(true) };
        let other = self.other_length(self.now(), unit, ask.request);
        if let Some(read) = other.and_then(|words| Request::read_of(table, address, words).ok()) {
            self.stats().count(Some(unit), |counters| counters.resyncs += 1);
            match self.exchange(&Ask { request: &read, ..*ask }, give_up, &mut |_| ()) {
                Ok(_) => {}
                Err(error) if matches!(error.failure, Failure::Refused { .. }) => {
                    self.longer.refused(
                        unit,
                        (table, address),
                        other.filter(|&words| words > count).unwrap_or(u16::MAX),
                    );
                }
                Err(error) => return Err(error),
            }
        }
        self.overhear().map_err(|failure| ask.failed(failure, None, self.now(), &[]))?;
        let is_ours = !matches!(self.master.attribution(self.now(), unit, ask.request), Attribution::Others(_));
        if is_ours {
            self.others.units.of(unit).met = true;
            if self.master.has_others(self.now(), unit) {
                self.others.proven.insert((unit, look(ask.request)));
            }
        }
        Ok(is_ours)
    }
}

/// One of the first few.
fn by_chance<T>(free: &[T]) -> Option<&T> {
    let [number, ..] = RandomState::new().build_hasher().finish().to_le_bytes();
    free.get(usize::from(number) % free.len().clamp(1, CHOICE))
}
