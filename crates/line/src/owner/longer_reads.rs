//! Reads in a longer form: a few words more than were asked for, so that no open answer could pass for theirs.
//!
//! An answer carries no number, but it has a length. Where a late answer could be taken for the one to a read, the read
//! asks for the next registers too, and what was not asked for is cut off. Not every unit has a register there, and none
//! known here gives more than 16 words: what was refused is remembered, and is not asked for again.

use std::collections::BTreeMap;

use drivebus_rtu::{Instant, Master, Request, Table, UnitAddress};

use crate::owner::resync::MAX_WORDS;

/// Places that are remembered. With more, all are forgotten and learned again.
const REMEMBERED: usize = 1024;

/// Where a read begins.
type Place = (Table, u16);

/// What is known of longer reads, by unit and place.
#[derive(Debug, Default)]
pub(crate) struct Longer(BTreeMap<(UnitAddress, Place), Limit>);

#[derive(Debug, Clone, Copy)]
struct Limit {
    /// So many words and more are not given.
    refused: u16,
    /// So many and more were met with silence the last time.
    silent: u16,
}

impl Longer {
    /// How many words to ask for, as many as `request` does or more, so that the answer of `unit` can be no other's; `None`
    /// where nothing helps.
    pub(crate) fn form(&self, master: &Master, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<u16> {
        let Request::Read { table, address, count, .. } = *request else { return None };
        let find = |tells_apart: &dyn Fn(&Request<'_>) -> bool| {
            self.given_from(unit, (table, address), count)
                .find(|&words| Request::read_of(table, address, words).is_ok_and(|read| tells_apart(&read)))
        };
        // More words than anything open has, so that not even an answer that is cut short could pass; else another number.
        find(&|read| master.tells_apart(now, unit, read)).or_else(|| {
            let is_sure = |read: &Request<'_>| !master.attribution(now, unit, read).may_be_mistaken();
            find(&is_sure).filter(|_| !master.in_quarantine(now, unit))
        })
    }

    /// How many words `unit` may give from `place`, `count` of them or more, in the order of their number.
    pub(crate) fn given_from(&self, unit: UnitAddress, place: Place, count: u16) -> impl Iterator<Item = u16> + use<> {
        let refused = self.0.get(&(unit, place)).map_or(u16::MAX, |limit| limit.refused);
        (count..=count.max(MAX_WORDS)).take_while(move |&words| words < refused)
    }

    /// `unit` refused to give `count` words from `place`.
    pub(crate) fn refused(&mut self, unit: UnitAddress, place: Place, count: u16) {
        let limit = self.limit(unit, place);
        limit.refused = limit.refused.min(count);
    }

    /// `unit` was silent on `count` words from `place`: the second time in a row it counts as a refusal.
    pub(crate) fn silent(&mut self, unit: UnitAddress, place: Place, count: u16) {
        let limit = self.limit(unit, place);
        if limit.silent <= count {
            limit.refused = limit.refused.min(count);
        }
        limit.silent = limit.silent.min(count);
    }

    /// `unit` gave them.
    pub(crate) fn given(&mut self, unit: UnitAddress, place: Place) {
        if let Some(limit) = self.0.get_mut(&(unit, place)) {
            limit.silent = u16::MAX;
        }
    }

    fn limit(&mut self, unit: UnitAddress, place: Place) -> &mut Limit {
        if self.0.len() >= REMEMBERED && !self.0.contains_key(&(unit, place)) {
            self.0.clear();
        }
        self.0.entry((unit, place)).or_insert(Limit { refused: u16::MAX, silent: u16::MAX })
    }
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::{Adu, Answer, Duration, Event, SerialFormat};

    use super::*;

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
            Longer::default().form(&owed(owed_counts), Instant::ZERO, UNIT, &Request::read(100, count).unwrap())
        };
        assert_eq!(form(&[1], 1), Some(2));
        assert_eq!(form(&[1, 2, 4], 1), Some(5), "four words cut short could be three");
        assert_eq!(form(&[15, 16], 15), None, "no unit known here gives 17");
        assert_eq!(form(&[16], 16), None);
        assert_eq!(form(&[1], 2), Some(2), "it can be told apart as it is");
        assert_eq!(form(&[1], 20), Some(20));
        let write = Request::write(100, 1);
        assert_eq!(Longer::default().form(&owed(&[1]), Instant::ZERO, UNIT, &write), None);
        let last = Request::read(0xFFFF, 1).unwrap();
        assert_eq!(Longer::default().form(&owed(&[1]), Instant::ZERO, UNIT, &last), None, "no register comes after it");
    }

    /// Out of quarantine another length will do where no greater one is given.
    #[test]
    fn a_length_that_nothing_owed_has() {
        let (mut longer, mut master) = (Longer::default(), owed(&[1, 4]));
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
        let (mut longer, master, read) = (Longer::default(), owed(&[1]), Request::read(100, 1).unwrap());
        longer.refused(UNIT, (Table::Holding, 100), 2);
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &read), None, "nor are more, from there");
        assert_eq!(longer.form(&master, Instant::ZERO, UNIT, &Request::read(101, 1).unwrap()), Some(2));
    }

    #[test]
    fn silence_counts_when_it_comes_twice_in_a_row() {
        let (mut longer, master, read) = (Longer::default(), owed(&[1]), Request::read(100, 1).unwrap());
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
        let (mut longer, master) = (Longer::default(), owed(&[1]));
        let is_refused = |longer: &Longer, address| {
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
