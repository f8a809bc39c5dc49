//! What is known of a line: what it was asked and owes, what its adapter does, what its units are like.

use core::time::Duration;

use super::echo::OwnEcho;
use super::first_contact::Put;
use super::fresh_words::FreshWords;
use super::longer_reads::Longer;
use super::probes::{Probe, Tried};
use super::units::Units;
use crate::huanyang::Huanyang;
use crate::{Attribution, Destination, Instant, Master, Patience, Request, SerialFormat, Table, Tally, UnitAddress};

/// One request on its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ask<'r> {
    pub(super) destination: Destination,
    pub(super) request: Request<'r>,
    pub(super) timeout: Duration,
    /// Whether it goes out at once, even to a unit that may still answer something else.
    pub(super) in_doubt: bool,
}

/// What to do next for a request.
#[derive(Debug, Clone, Copy)]
pub(super) enum Next {
    /// Send it.
    Ask(Attribution),
    /// Send it, but the answer may be that to another master's.
    AskUntold,
    /// Send it as a read of so many words, which nothing that the unit owes could pass for.
    AskApart(u16),
    /// Send it as two reads of so many words, which have one in common: nothing that the unit owes could pass for either.
    AskInTwo(u16, u16),
    /// See whether the adapter echoes.
    LookForEcho,
    /// Make sure that the unit owes nothing else.
    Probe(Probe),
    /// Let this moment come; others may use the line.
    Wait(Instant),
    /// The same: until then an open answer could be taken for its own.
    Overtaken(Instant),
    /// See until this moment whether what the unit owes comes; others may use the line.
    Watch(Instant),
    /// The unit may still answer something else, and everything was tried.
    GiveUp,
    /// Another master asks the same, in every length that the unit gives.
    OthersAsk,
}

/// What may come is looked for so often at the most.
const LOOKS_APART: Duration = Duration::from_millis(5);

/// What a line is like that was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Opened {
    /// Whether an adapter might send our own bytes back to us.
    pub may_echo: bool,
    /// Whether another master may ask on it, so that its answers come here, too.
    pub may_have_others: bool,
    /// Whether frames are told apart by something else than silence, and by whose connection they come: it carries nobody
    /// else's answers.
    pub gapless: bool,
}

impl Opened {
    /// A serial line of our own: its adapter may echo.
    pub const fn new() -> Self {
        Self { may_echo: true, may_have_others: false, gapless: false }
    }

    /// Sets [`may_echo`](Self#structfield.may_echo).
    #[must_use]
    pub const fn may_echo(self, may_echo: bool) -> Self {
        Self { may_echo, ..self }
    }

    /// Sets [`may_have_others`](Self#structfield.may_have_others).
    #[must_use]
    pub const fn may_have_others(self, may_have_others: bool) -> Self {
        Self { may_have_others, ..self }
    }

    /// Sets [`gapless`](Self#structfield.gapless).
    #[must_use]
    pub const fn gapless(self, gapless: bool) -> Self {
        Self { gapless, ..self }
    }
}

/// What is known of a line, without a heap: of `UNITS` units, and of `PLACES` places where longer reads were refused.
///
/// With fewer units than are asked a call to one more ends with [`Unanswered::NoRoom`](crate::Unanswered::NoRoom); with
/// fewer places more is asked that was refused before. 247 and 1024 is what a computer keeps. How many bytes that takes is told
/// under "RAM" in the crate's description.
#[derive(Debug, Clone)]
pub struct Known<const UNITS: usize = 247, const PLACES: usize = 1024> {
    pub(super) master: Master,
    format: SerialFormat,
    /// What the user knows about the adapter.
    pub(super) given_echo: OwnEcho,
    /// What is known by now about the one that is plugged in.
    pub(super) echo: OwnEcho,
    pub(super) units: Units<UNITS>,
    /// Which reads can be asked in a longer form.
    pub(super) longer: Longer<PLACES>,
    /// Whether another master may ask on the line.
    pub(super) others: bool,
    is_open: bool,
    /// How often it was opened.
    openings: u32,
    /// Which connection it is, as the caller counts them.
    connection: u64,
    /// How many requests were begun.
    pub(super) begun: u32,
    pub(super) chance: u64,
    /// What came while nothing was asked.
    strays: Tally,
}

impl<const UNITS: usize, const PLACES: usize> Known<UNITS, PLACES> {
    /// Of a line of `format` that is not open yet. `chance` tells two masters on one line apart: any number that another
    /// has not.
    pub fn new(format: SerialFormat, echo: OwnEcho, chance: u64) -> Self {
        Self {
            master: Master::new(&format),
            format,
            given_echo: echo,
            echo,
            units: Units::new(),
            longer: Longer::new(),
            others: false,
            is_open: false,
            openings: 0,
            connection: 0,
            begun: 0,
            // Of zero nothing but zero comes.
            chance: chance | 1,
            strays: Tally::EMPTY,
        }
    }

    /// The line was opened at `now`, for the first time or again.
    pub fn opened(&mut self, now: Instant, line: &Opened) {
        if line.gapless && self.openings == 0 {
            self.master = Master::with_silence(Duration::ZERO);
        }
        self.echo = match self.given_echo {
            OwnEcho::Unknown if !line.may_echo => OwnEcho::Absent,
            given => given,
        };
        self.master.strip_echo(self.echo == OwnEcho::Present);
        self.master.never_echoes(self.echo == OwnEcho::Absent);
        // A connection of our own whose frames are told apart carries nobody else's answers.
        if !line.gapless {
            self.master.opened(now);
        }
        self.others = line.may_have_others;
        self.master.expect_others(self.others);
        for unit in self.units.iter_mut() {
            (unit.met, unit.watched) = Default::default();
        }
        self.openings = self.openings.wrapping_add(1);
        self.is_open = true;
    }

    /// The line was closed, or lost.
    pub fn closed(&mut self) {
        self.is_open = false;
    }

    /// Which connection the line is now, as the caller counts them:
    /// see [`Question::connection`](crate::Question#structfield.connection).
    pub fn is_connection(&mut self, number: u64) {
        self.connection = number;
    }

    /// What is known about the adapter that is plugged in.
    pub const fn echo(&self) -> OwnEcho {
        self.echo
    }

    /// What units may still answer.
    pub const fn master(&self) -> &Master {
        &self.master
    }

    /// How long is listened on for an answer of which something has come: see [`Master::be_patient`].
    pub const fn be_patient(&mut self, patience: Option<Patience>) {
        self.master.be_patient(patience);
    }

    /// A request that was left in flight is given up: whoever asked it is gone.
    pub fn abort(&mut self, now: Instant) {
        self.master.abort(now);
    }

    /// Says that `frame` came by `now` and is known to answer an earlier request: see [`Master::saw_late`].
    pub fn saw_late(&mut self, now: Instant, frame: &[u8]) {
        self.master.saw_late(now, frame);
    }

    /// Takes down what came by `now` while nothing was asked.
    pub fn stray(&mut self, now: Instant, mut bytes: &[u8]) {
        self.master.overhear(now);
        loop {
            bytes = &bytes[self.master.receive(now, bytes)..];
            let _ = self.master.poll(now); // nothing is in flight: it only counts
            if bytes.is_empty() {
                break;
            }
        }
        let seen = self.master.take_tally();
        self.strays.add(&seen);
    }

    /// Takes down what came by `now` while nothing was asked, and that no more of it comes.
    pub(super) fn take_down(&mut self, now: Instant) {
        self.master.take_down(now);
        let seen = self.master.take_tally();
        self.strays.add(&seen);
    }

    /// What came while nothing was asked, since the last call.
    pub const fn take_strays(&mut self) -> Tally {
        core::mem::replace(&mut self.strays, Tally::EMPTY)
    }

    pub(super) const fn is_open(&self) -> bool {
        self.is_open
    }

    pub(super) const fn connection(&self) -> u64 {
        self.connection
    }

    /// What `unit` was asked so far: who finds it unchanged knows that nobody else has asked it since.
    pub(super) fn asked(&self, unit: UnitAddress) -> (u32, u32) {
        (self.units.get(unit).map_or(0, |unit| unit.asked), self.openings)
    }

    /// How long the characters of the right answer take, where its length is known.
    pub(super) fn answer_time(&self, request: &Request<'_>) -> Duration {
        self.format.chars(request.expected().adu_len().map_or(0, |len| u32::try_from(len).unwrap_or(0)))
    }

    /// What comes before `ask`, so that what is taken for its answer can only be its answer.
    ///
    /// Nothing is sent where nothing is in doubt. A read that can be put so that its answer is told `apart` needs nothing
    /// before it, if the caller takes that. Before a request whose answer may look like it, a write or the echo
    /// sent here included, one word is read if it is not known yet whether the adapter echoes. Then a unit that may still
    /// answer something else is probed.
    pub(super) fn next(
        &mut self,
        now: Instant,
        ask: &Ask<'_>,
        words: &FreshWords,
        tried: &Tried,
        (in_time, waits): (bool, bool),
        apart: bool,
    ) -> Next {
        let Destination::Unit(unit) = ask.destination else {
            return Next::Ask(Attribution::Certain);
        };
        if ask.in_doubt {
            return Next::Ask(Attribution::Certain);
        }
        let in_quarantine = self.master.in_quarantine(now, unit);
        let attribution = self.master.attribution(now, unit, &ask.request);
        if self.others
            && let Some(next) = self.next_among_others(now, unit, ask, attribution, in_quarantine, apart)
        {
            return next;
        }
        // A unit that returns echoes proves more by one: that it has caught up.
        let may_be_mistaken = if in_quarantine { self.knows_no_echo(unit) } else { attribution.may_be_mistaken() };
        if apart
            && may_be_mistaken
            && let Some(count) = self.longer.form(&self.master, now, unit, &ask.request)
        {
            return Next::AskApart(count);
        }
        if waits
            && (in_quarantine || attribution.may_be_mistaken())
            && let Some(until) = self.watches(now, unit, ask, apart)
        {
            return Next::Watch(until);
        }
        if apart
            && may_be_mistaken
            && !self.others
            && let Some((first, last)) = self.longer.parts(&self.master, now, unit, &ask.request)
        {
            return Next::AskInTwo(first, last);
        }
        if self.echo == OwnEcho::Unknown && (ask.request.expected().may_repeat_request() || in_quarantine) {
            return Next::LookForEcho;
        }
        let in_doubt = match ask.request {
            // A word of the caller's own choosing may be one that it has sent before. A unit that refuses echoes returns none.
            Request::Echo { data, .. } => {
                let refuses = self.units.get(unit).is_some_and(|unit| unit.probing.refuses_echoes());
                self.master.may_owe_an_echo(now, unit) && !refuses && !words.is_latest(data)
            }
            _ => in_quarantine,
        };
        if in_doubt {
            // Its answer says itself what it answers.
            if let Request::Huanyang(_) = ask.request
                && self.master.tells_apart(now, unit, &ask.request)
            {
                return Next::Ask(Attribution::Certain);
            }
            let probing = &mut self.units.of(unit).probing;
            if let Some(probe) = probing.probe(&self.master, now, unit, &ask.request, tried, in_time) {
                return Next::Probe(probe);
            }
            // Of a unit that knows nothing of Modbus only time tells then.
            let over = match ask.request {
                Request::Huanyang(_) if in_time => self.master.doubt_ends(now, unit),
                _ => self.master.first_contact_ends(now, unit),
            };
            return over.map_or(Next::GiveUp, Next::Wait);
        }
        self.units.of(unit).probing.is_sure();
        match attribution {
            Attribution::Wait(until) => Next::Overtaken(until),
            Attribution::Others(_) => Next::OthersAsk,
            // Its words change: they are sure when there is nothing left to outvote.
            Attribution::Repeat { .. } if tried.disagreed => {
                Next::Overtaken(self.master.rivals_end(now, unit, &ask.request).unwrap_or(now))
            }
            sure @ (Attribution::Certain | Attribution::Repeat { .. }) => Next::Ask(sure),
        }
    }

    /// Until when it is worth to wait, before the same is asked again, whether the unit answers late what it was asked: where no
    /// longer read would be told apart from that.
    pub(super) fn watches_before_asking_again(
        &self,
        now: Instant,
        unit: UnitAddress,
        ask: &Ask<'_>,
    ) -> Option<Instant> {
        if self.longer.form(&self.master, now, unit, &ask.request).is_some() {
            return None;
        }
        self.watches(now, unit, ask, false)
    }

    /// When to look again whether what `unit` owes has come, where it is worth to wait for that before `ask`: less long where a
    /// longer read would be told `apart` from it.
    fn watches(&self, now: Instant, unit: UnitAddress, ask: &Ask<'_>, apart: bool) -> Option<Instant> {
        let otherwise = apart && self.longer.form(&self.master, now, unit, &ask.request).is_some();
        let until = self.master.worth_watching(now, unit, &ask.request, ask.timeout, otherwise)?;
        Some(until.min(now + self.answer_time(&ask.request).max(LOOKS_APART)))
    }

    pub(super) fn knows_no_echo(&self, unit: UnitAddress) -> bool {
        self.units.get(unit).is_some_and(|unit| unit.probing.knows_no_echo())
    }

    /// How to put `ask`, a stop's, to a unit that may still answer another program and returns no echo; `None` where that is
    /// not so, and where only time tells.
    pub(super) fn at_first_contact(&self, now: Instant, ask: &Ask<'_>) -> Option<Put> {
        let Destination::Unit(unit) = ask.destination else { return None };
        // Where another master's answers come as well, their order proves nothing.
        let may_be_mistaken = !ask.in_doubt && !self.others && self.master.first_contact_ends(now, unit).is_some();
        if !may_be_mistaken || !self.knows_no_echo(unit) {
            return None;
        }
        let met = self.units.get(unit).map(|unit| unit.met).unwrap_or_default();
        met.put(&self.master, &self.longer, now, unit, &ask.request)
    }

    /// `unit` gave at `now` what could only be the answer.
    pub(super) fn is_sure(&mut self, now: Instant, unit: UnitAddress) {
        self.units.of(unit).met.is_sure(&mut self.master, now, unit);
    }

    /// What `unit` gave for `ask` by `now` may have been another program's.
    pub(super) fn leaves_unproven(&mut self, now: Instant, unit: UnitAddress, ask: &Ask<'_>) {
        self.units.of(unit).met.is_unproven(&mut self.master, now, unit, &ask.request, ask.timeout);
    }

    /// The read that shows whether the adapter echoes; what is answered does not matter. Before a read whose answer is to be
    /// told `apart`, one word more than that asks for.
    pub(super) fn look(&self, now: Instant, ask: &Ask<'_>, apart: bool) -> Option<Request<'static>> {
        if let Request::Huanyang(_) = ask.request {
            // Nothing of Modbus goes to such a unit, and of this its answer is longer.
            return Some(Request::Huanyang(Huanyang::ReadStatus { number: 1 }));
        }
        let (address, count) = match ask.request {
            Request::Read { table: Table::Holding, address, count, .. }
                if apart && count < super::probes::MAX_WORDS =>
            {
                (address, count + 1)
            }
            Request::Read { table: Table::Holding, address, .. } => (address, 1),
            _ => (0, 1),
        };
        let count = self.free_length(now, ask.destination, address, count);
        Request::read(address, count).or_else(|_| Request::read(address, 1)).ok()
    }
}
