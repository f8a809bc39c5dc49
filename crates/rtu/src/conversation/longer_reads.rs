//! Reads put so that no open answer could pass for theirs: a few words more than were asked for, or two shorter ones.
//!
//! An answer carries no number, but it has a length. Where a late answer could be taken for the one to a read, the read
//! asks for the next registers too, and what was not asked for is cut off. Not every unit has a register there, and none
//! known here gives more than 16 words: what was refused is remembered, and is not asked for again.

use core::num::NonZeroU16;

use super::probes::MAX_WORDS;
use crate::{Instant, Master, Request, Table, UnitAddress};

/// Where a read begins.
type Place = (Table, u16);

/// What is known of longer reads, by unit and place: of so many places. With more, all are forgotten and learned again.
#[derive(Debug, Clone)]
pub(super) struct Longer<const N: usize> {
    limits: [Option<((UnitAddress, Place), Limit)>; N],
    /// How many of them are there.
    len: usize,
}

#[derive(Debug, Clone, Copy)]
struct Limit {
    /// So many words and more are not given.
    refused: u16,
    /// So many and more were met with silence the last time.
    silent: u16,
}

/// What answers to a read look like: function and bytes on the wire, 0 where their number is not known. Two bytes, as many are
/// kept of each unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape(NonZeroU16);

impl Shape {
    /// How many bits hold the bytes on the wire, 256 at most; above them is the function, 1 to 127.
    const LEN_BITS: u32 = 9;

    /// None of these has it: it has no function.
    pub(super) const NONE: Self = Self(NonZeroU16::MIN);

    /// By which function.
    pub(super) const fn function(self) -> u8 {
        (self.0.get() >> Self::LEN_BITS).to_be_bytes()[1]
    }
}

/// The shape of the answers to `request`.
pub(super) fn shape(request: &Request<'_>) -> Shape {
    let expected = request.expected();
    let len = expected.adu_len().and_then(|len| u16::try_from(len).ok()).unwrap_or(0);
    NonZeroU16::new(u16::from(expected.function()) << Shape::LEN_BITS | len).map_or(Shape::NONE, Shape)
}

impl<const N: usize> Longer<N> {
    pub(super) fn new() -> Self {
        Self { limits: [None; N], len: 0 }
    }

    /// How many words to ask for, as many as `request` does or more, so that the answer of `unit` can be no other's; `None`
    /// where nothing helps.
    pub(super) fn form(&self, master: &Master, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<u16> {
        let find = |tells_apart: &dyn Fn(&Request<'_>) -> bool| {
            self.lengths(unit, request).find(|(_, read)| tells_apart(read)).map(|(words, _)| words)
        };
        // More words than anything open has, so that not even an answer that is cut short could pass; else another number.
        find(&|read| master.tells_apart(now, unit, read))
            .or_else(|| find(&|read| has_another_length(master, now, unit, read)))
    }

    /// Whether the answer of `unit` to `read` as it is can be no other's.
    pub(super) fn is_apart(&self, master: &Master, now: Instant, unit: UnitAddress, read: &Request<'_>) -> bool {
        let tells_apart =
            |read: &Request<'_>| master.tells_apart(now, unit, read) || has_another_length(master, now, unit, read);
        // The first of its lengths is its own, where that was not refused.
        self.lengths(unit, read).next().is_some_and(|(_, read)| tells_apart(&read))
    }

    /// How many words the two parts of `request` have, the first one and the last, so that the answers of `unit` can be no others';
    /// none where there are no such.
    pub(super) fn parts(
        &self,
        master: &Master,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
    ) -> Option<(u16, u16)> {
        let count = match *request {
            Request::Read { table, count, .. } if !table.is_bits() => count,
            _ => return None,
        };
        (2..count).rev().map(|first| (first, count + 1 - first)).find(|&(first, last)| {
            let is_apart = |part: Option<Request<'_>>| part.is_some_and(|part| self.is_apart(master, now, unit, &part));
            first != last && is_apart(first_part(request, first)) && is_apart(last_part(request, last))
        })
    }

    /// The reads of so many words as `request` asks for, and of more, that `unit` was not heard to refuse.
    pub(super) fn lengths<'r>(
        &self,
        unit: UnitAddress,
        request: &Request<'r>,
    ) -> impl Iterator<Item = (u16, Request<'r>)> + use<'r, N> {
        let asked = match *request {
            Request::Read { table, address, count, .. } => Some((table, address, count)),
            _ => None,
        };
        let limit = asked.and_then(|(table, address, _)| self.get(unit, (table, address)));
        let refused = limit.map_or(u16::MAX, |limit| limit.refused);
        asked.into_iter().flat_map(move |(table, address, count)| {
            let given = (count..=count.max(MAX_WORDS)).take_while(move |&words| words < refused);
            given.filter_map(move |words| Some((words, Request::read_of(table, address, words).ok()?)))
        })
    }

    /// `unit` refused to give `count` words from `place`.
    pub(super) fn refused(&mut self, unit: UnitAddress, place: Place, count: u16) {
        self.limit(unit, place, |limit| limit.refused = limit.refused.min(count));
    }

    /// `unit` was silent on `count` words from `place`: the second time in a row it counts as a refusal.
    pub(super) fn silent(&mut self, unit: UnitAddress, place: Place, count: u16) {
        self.limit(unit, place, |limit| {
            if limit.silent <= count {
                limit.refused = limit.refused.min(count);
            }
            limit.silent = limit.silent.min(count);
        });
    }

    /// `unit` gave them.
    pub(super) fn given(&mut self, unit: UnitAddress, place: Place) {
        if let Some(at) = self.at(unit, place)
            && let Some((_, limit)) = &mut self.limits[at]
        {
            limit.silent = u16::MAX;
        }
    }

    fn get(&self, unit: UnitAddress, place: Place) -> Option<Limit> {
        self.limits[self.at(unit, place)?].map(|(_, limit)| limit)
    }

    fn at(&self, unit: UnitAddress, place: Place) -> Option<usize> {
        let is_it = |limit: &Option<((UnitAddress, Place), Limit)>| limit.is_some_and(|(of, _)| of == (unit, place));
        self.limits[..self.len].iter().position(is_it)
    }

    /// Changes what is known of `place`.
    fn limit(&mut self, unit: UnitAddress, place: Place, change: impl FnOnce(&mut Limit)) {
        let at = self.at(unit, place).unwrap_or_else(|| {
            if self.len == N {
                self.len = 0;
            }
            self.len += 1;
            self.len - 1
        });
        if let Some(kept) = self.limits.get_mut(at) {
            let known = kept.filter(|(of, _)| *of == (unit, place)).map(|(_, limit)| limit);
            let mut limit = known.unwrap_or(Limit { refused: u16::MAX, silent: u16::MAX });
            change(&mut limit);
            *kept = Some(((unit, place), limit));
        }
    }
}

/// The last `last` words of `request`; none if it has no more.
pub(super) fn last_part<'r>(request: &Request<'_>, last: u16) -> Option<Request<'r>> {
    let &Request::Read { table, address, count, .. } = request else { return None };
    let before = count.checked_sub(last).filter(|&before| before > 0)?;
    Request::read_of(table, address.checked_add(before)?, last).ok()
}

/// The first `first` words of `request`; none if it has no more.
pub(super) fn first_part<'r>(request: &Request<'_>, first: u16) -> Option<Request<'r>> {
    let &Request::Read { table, address, count, .. } = request else { return None };
    Request::read_of(table, address, first).ok().filter(|_| first < count)
}

/// Whether `read` asks for another number of words than everything open has, of a unit that answers in order.
fn has_another_length(master: &Master, now: Instant, unit: UnitAddress, read: &Request<'_>) -> bool {
    !master.in_quarantine(now, unit) && !master.attribution(now, unit, read).may_be_mistaken()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Adu, Answer, Duration, Event, SerialFormat};

    const REMEMBERED: usize = 1024;
    const UNIT: UnitAddress = UnitAddress::MIN;

    /// A master that gave up reads of these lengths.
    fn owed(counts: &[u16]) -> Master {
        let mut master = Master::new(&SerialFormat::DEFAULT);
        for &count in counts {
            master.still_owed(Instant::ZERO, UNIT, &Request::read(7, count).unwrap(), Duration::ZERO);
        }
        master
    }

    #[test]
    fn the_shortest_length_that_nothing_owed_has_even_cut_short() {
        let form = |owed_counts: &[u16], count| {
            Longer::<REMEMBERED>::new().form(
                &owed(owed_counts),
                Instant::ZERO,
                UNIT,
                &Request::read(100, count).unwrap(),
            )
        };
        assert_eq!(form(&[1], 1), Some(2));
        assert_eq!(form(&[1, 2, 4], 1), Some(5), "four words cut short could be three");
        assert_eq!(form(&[15, 16], 15), None, "no unit known here gives 17");
        assert_eq!(form(&[16], 16), None);
        assert_eq!(form(&[1], 2), Some(2), "it can be told apart as it is");
        assert_eq!(form(&[1], 20), Some(20));
        let write = Request::write(100, 1);
        assert_eq!(Longer::<REMEMBERED>::new().form(&owed(&[1]), Instant::ZERO, UNIT, &write), None);
        let last = Request::read(0xFFFF, 1).unwrap();
        assert_eq!(
            Longer::<REMEMBERED>::new().form(&owed(&[1]), Instant::ZERO, UNIT, &last),
            None,
            "no register comes after it"
        );
    }

    /// Out of quarantine another length will do where no greater one is given.
    #[test]
    fn a_length_that_nothing_owed_has() {
        let (mut longer, mut master) = (Longer::<REMEMBERED>::new(), owed(&[1, 4]));
        let echo = Request::echo(7);
        master.begin(Instant::ZERO, UNIT.into(), &echo, Duration::from_millis(100)).unwrap();
        let sent = master.deadline().unwrap();
        assert!(matches!(master.poll(sent), Some(Event::Transmit(_))));
        master.sent(sent);
        let frame = Adu::answer(UNIT, &Answer::confirming(&echo).unwrap());
        master.receive(sent, frame.as_bytes());
        assert!(matches!(master.poll(sent), Some(Event::Answer(_))), "the unit has caught up");
        let read = Request::read(100, 1).unwrap();
        assert_eq!(longer.form(&master, sent, UNIT, &read), Some(5));
        longer.refused(UNIT, (Table::Holding, 100), 4);
        assert_eq!(longer.form(&master, sent, UNIT, &read), Some(2));
        longer.refused(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, sent, UNIT, &read), None);
    }

    #[test]
    fn what_was_refused_is_not_asked_for_again() {
        let (mut longer, master, read) = (Longer::<REMEMBERED>::new(), owed(&[1]), Request::read(100, 1).unwrap());
        longer.refused(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &read), None, "nor are more, from there");
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &Request::read(101, 1).unwrap()), Some(2));
    }

    #[test]
    fn silence_counts_when_it_comes_twice_in_a_row() {
        let (mut longer, master, read) = (Longer::<REMEMBERED>::new(), owed(&[1]), Request::read(100, 1).unwrap());
        longer.silent(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &read), Some(2));
        longer.given(UNIT, (Table::Holding, 100));
        longer.silent(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &read), Some(2));
        longer.silent(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &read), None);
    }

    #[test]
    fn so_many_places_are_remembered_and_with_one_more_all_are_learned_again() {
        let (mut longer, master) = (Longer::<REMEMBERED>::new(), owed(&[1]));
        let is_refused = |longer: &Longer<REMEMBERED>, address| {
            longer.form(&master, Instant::ZERO, UNIT, &Request::read(address, 1).unwrap()).is_none()
        };
        let places = u16::try_from(REMEMBERED).unwrap();
        (0..places).for_each(|address| longer.refused(UNIT, (Table::Holding, address), 2));
        assert!((0..places).all(|address| is_refused(&longer, address)));
        longer.refused(UNIT, (Table::Holding, 0), 2);
        assert!((0..places).all(|address| is_refused(&longer, address)), "what is known already needs no new place");
        longer.refused(UNIT, (Table::Holding, places), 2);
        assert!(!(0..places).any(|address| is_refused(&longer, address)));
        assert!(is_refused(&longer, places));
    }
}
