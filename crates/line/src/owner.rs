//! The open line, what is known of it, its adapter and its units, and what has to go out before a request.

mod arrival_pauses;
pub(crate) mod dead_units;
pub(crate) mod delays;
pub(crate) mod echo;
pub(crate) mod exchange;
pub(crate) mod first_contact;
mod longer_reads;
pub(crate) mod meanings;
pub(crate) mod opener;
mod others;
pub(crate) mod resync;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::{
    Answer, Attribution, Destination, Instant, Master, Meaning, Request, SerialFormat, Tally, UnitAddress,
};

use crate::ask::{Ask, Done};
use crate::error::{CallError, Failure};
use crate::health::link::Links;
use crate::health::stats::{Asked, Stats};
use crate::line::Opener;
use crate::line::{Line, LineClock};
use crate::options::AdapterEcho;
use crate::owner::arrival_pauses::Lumps;
use crate::owner::dead_units::DeadUnits;
use crate::owner::delays::Delays;
use crate::owner::exchange::exchange;
use crate::owner::first_contact::{Met, Put};
use crate::owner::longer_reads::Longer;
use crate::owner::meanings::UnitMeanings;
use crate::owner::opener::LineOpener;
use crate::owner::others::Others;
use crate::owner::resync::{FreshWords, Probe, Resync, Tried};
use crate::trace::{Trace, Watched};

/// What to do next for a request.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Next {
    /// Send it.
    Ask(Attribution),
    /// Send it, but the answer may be that to another master's.
    AskUntold,
    /// Send it as a read of so many words, which nothing that the unit owes could pass for.
    AskApart(u16),
    /// See whether the adapter echoes.
    LookForEcho,
    /// Make sure that the unit owes nothing else.
    Probe(UnitAddress, Probe),
    /// Let this moment come; others may use the line.
    Wait(Instant),
    /// The same: until then an open answer could be taken for its own.
    Overtaken(Instant),
    /// The unit may still answer something else, and everything was tried.
    GiveUp,
    /// Another master asks the same, in every length that the unit gives.
    OthersAsk,
}

/// The line, and all that is known about it.
pub(crate) struct Owner {
    line: Option<Box<dyn Line>>,
    /// The clock of the line that was open last.
    clock: Option<LineClock>,
    opener: LineOpener,
    pub(crate) master: Master,
    /// What the user knows about the adapter.
    pub(crate) given_echo: AdapterEcho,
    /// What is known by now about the one that is plugged in.
    pub(crate) echo: AdapterEcho,
    resync: Resync,
    /// Which reads can be asked in a longer form.
    pub(crate) longer: Longer,
    others: Others,
    /// What its units were asked and have answered since it was opened.
    pub(crate) met: Met,
    /// What its units say by their exceptions.
    pub(crate) meanings: Arc<UnitMeanings>,
    links: Arc<Mutex<Links>>,
    /// Units that were heard when they were asked last, by their number.
    heard: [bool; 256],
    delays: Delays,
    lumps: Lumps,
    format: SerialFormat,
    /// Units that do not answer.
    pub(crate) dead: DeadUnits,
    words: Arc<FreshWords>,
    stats: Arc<Mutex<Stats>>,
    /// Where somebody watches the line, or has.
    trace: Option<Trace>,
}

impl std::fmt::Debug for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Owner").field("line", &self.line).field("echo", &self.echo).finish_non_exhaustive()
    }
}

impl Owner {
    /// With no line yet.
    pub(crate) fn new(
        opener: Opener,
        format: SerialFormat,
        echo: AdapterEcho,
        words: Arc<FreshWords>,
        stats: Arc<Mutex<Stats>>,
    ) -> Self {
        Self {
            line: None,
            clock: None,
            opener: LineOpener::new(opener),
            master: Master::new(&format),
            given_echo: echo,
            echo,
            resync: Resync::default(),
            longer: Longer::default(),
            others: Others::default(),
            met: Met::default(),
            meanings: Arc::default(),
            links: Arc::default(),
            heard: [false; 256],
            delays: Delays::default(),
            lumps: Lumps::of_no_line(),
            format,
            dead: DeadUnits::default(),
            words,
            stats,
            trace: None,
        }
    }

    /// Opens the line for the first time.
    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        let line = self.opener.open(give_up)?;
        if line.gapless() {
            self.master = Master::with_silence(Duration::ZERO);
        }
        self.take_line(line);
        Ok(())
    }

    pub(crate) fn close(&mut self) {
        self.line = None;
    }

    /// How well each unit could be reached lately, to be read while somebody waits for the line.
    pub(crate) fn shared_links(&self) -> Arc<Mutex<Links>> {
        Arc::clone(&self.links)
    }

    /// A thread that panicked cannot have left the figures inconsistent enough to matter.
    pub(crate) fn stats(&self) -> MutexGuard<'_, Stats> {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Now, on the line's clock; its start while no line is open and nobody else knows.
    pub(crate) fn now(&self) -> Instant {
        match (&self.line, &self.clock) {
            (Some(line), _) => line.now(),
            (None, Some(clock)) => clock(),
            (None, None) => Instant::ZERO,
        }
    }

    /// What was asked of `unit` so far: who finds it unchanged knows that nobody else has asked it since.
    pub(crate) fn asked(&self, unit: UnitAddress) -> Asked {
        self.stats().asked(unit)
    }

    /// The line, if it is open.
    pub(crate) fn line(&mut self) -> Option<&mut (dyn Line + 'static)> {
        self.line.as_deref_mut()
    }

    /// Counts what came while nothing was asked.
    pub(crate) fn stray(&mut self, now: Instant, mut bytes: &[u8]) {
        self.master.overhear(now);
        loop {
            bytes = &bytes[self.master.receive(now, bytes)..];
            let _ = self.master.poll(now); // nothing is in flight: it only counts
            if bytes.is_empty() {
                break;
            }
        }
        let tally = self.master.take_tally();
        self.stats().count(None, |counters| counters.add(tally));
    }

    /// Makes ready for a request: opens the line again if it was lost, unless `give_up` says so first.
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(crate) fn prepare(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        if self.line.is_none() {
            let line = self.opener.open(give_up)?;
            self.take_line(line);
        }
        // Nothing is in flight, unless a caller's own code panicked while it was: then that is given up.
        self.master.abort(self.now());
        Ok(())
    }

    fn take_line(&mut self, line: Box<dyn Line>) {
        self.echo = match self.given_echo {
            AdapterEcho::Auto if !line.may_echo() => AdapterEcho::Absent,
            given => given,
        };
        self.master.strip_echo(self.echo == AdapterEcho::Present);
        // A connection of our own whose frames are told apart carries nobody else's answers.
        if !line.gapless() {
            self.master.opened(line.now());
        }
        self.others = Others::of_line(line.may_have_others());
        self.master.expect_others(self.others.may_be());
        self.met.forget();
        self.clock = line.clock();
        self.lumps = Lumps::of(line.as_ref());
        self.line = Some(match &self.trace {
            Some(trace) => Box::new(Watched::new(line, trace.clone())),
            None => line,
        });
    }

    /// From now on `trace` has what goes over the line, this one and those that are opened later.
    pub(crate) fn show_to(&mut self, trace: &Trace) {
        if self.trace.is_none() {
            self.trace = Some(trace.clone());
            self.line = self.line.take().map(|line| Box::new(Watched::new(line, trace.clone())) as Box<dyn Line>);
        }
    }

    /// What comes before `ask`, so that what is taken for its answer can only be its answer.
    ///
    /// Nothing is sent where nothing is in doubt. A read that can be put so that its answer is told `apart` needs nothing
    /// before it, if the caller takes that. Before a request whose answer may look like it, a write or the echo
    /// sent here included, one word is read if it is not known yet whether the adapter echoes. Then a unit that may still
    /// answer something else is probed.
    pub(crate) fn next(&mut self, ask: &Ask<'_>, tried: &Tried, in_time: bool, apart: bool) -> Next {
        let Destination::Unit(unit) = ask.destination else {
            return Next::Ask(Attribution::Certain);
        };
        if ask.in_doubt {
            return Next::Ask(Attribution::Certain);
        }
        let now = self.now();
        let in_quarantine = self.master.in_quarantine(now, unit);
        let attribution = self.master.attribution(now, unit, ask.request);
        if self.others.may_be()
            && let Some(next) = self.next_among_others(now, unit, ask, attribution, in_quarantine, apart)
        {
            return next;
        }
        // A unit that returns echoes proves more by one: that it has caught up.
        let may_be_mistaken =
            if in_quarantine { self.resync.knows_no_echo(unit) } else { attribution.may_be_mistaken() };
        if apart
            && may_be_mistaken
            && let Some(count) = self.longer.form(&self.master, now, unit, ask.request)
        {
            return Next::AskApart(count);
        }
        if self.echo == AdapterEcho::Auto && (ask.request.expected().may_repeat_request() || in_quarantine) {
            return Next::LookForEcho;
        }
        let in_doubt = match *ask.request {
            // A word of the caller's own choosing may be one that it has sent before. A unit that refuses echoes returns none.
            Request::Echo { data, .. } => {
                let may_come = self.master.may_owe_an_echo(now, unit) && !self.resync.refuses_echoes(unit);
                may_come && !self.words.is_latest(data)
            }
            _ => in_quarantine,
        };
        if in_doubt {
            if let Some(probe) = self.resync.probe(&self.master, now, unit, ask.request, tried, in_time) {
                return Next::Probe(unit, probe);
            }
            return self.master.first_contact_ends(now, unit).map_or(Next::GiveUp, Next::Wait);
        }
        self.resync.is_sure(unit);
        match attribution {
            Attribution::Wait(until) => Next::Overtaken(until),
            Attribution::Others(_) => Next::OthersAsk,
            sure => Next::Ask(sure),
        }
    }

    /// How to put `ask`, a stop's, to a unit that may still answer another program and returns no echo; `None` where that is
    /// not so, and where only time tells.
    pub(crate) fn at_first_contact(&self, ask: &Ask<'_>) -> Option<Put> {
        let Destination::Unit(unit) = ask.destination else { return None };
        let now = self.now();
        // Where another master's answers come as well, their order proves nothing.
        let may_be_mistaken =
            !ask.in_doubt && !self.others.may_be() && self.master.first_contact_ends(now, unit).is_some();
        if !may_be_mistaken || !self.resync.knows_no_echo(unit) {
            return None;
        }
        self.met.put(&self.master, &self.longer, now, unit, ask.request)
    }

    /// `unit` gave at `now` what could only be the answer.
    pub(crate) fn is_sure(&mut self, now: Instant, unit: UnitAddress) {
        self.met.is_sure(&mut self.master, now, unit);
    }

    /// What `unit` gave for `ask` by `now` may have been another program's.
    pub(crate) fn leaves_unproven(&mut self, now: Instant, unit: UnitAddress, ask: &Ask<'_>) {
        self.met.is_unproven(&mut self.master, now, unit, ask.request, ask.timeout);
    }

    /// Sends `probe` to `unit`; what it brought, `tried` and the master know.
    ///
    /// # Errors
    ///
    /// The port was lost, or the caller gave up: no other probe is worth trying.
    pub(crate) fn probe(
        &mut self,
        unit: UnitAddress,
        probe: Probe,
        ask: &Ask<'_>,
        tried: &mut Tried,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Box<CallError>> {
        let request = match probe {
            Probe::Echo => Request::echo(self.words.next()),
            Probe::OtherRead { address, count } => match Request::read(address, count) {
                Ok(request) => request,
                Err(_) => return Ok(()), // the count was checked when the probe was chosen
            },
        };
        tried.note(probe);
        self.stats().count(Some(unit), |counters| counters.resyncs += 1);
        match self.exchange(&Ask { request: &request, ..*ask }, give_up, &mut |_| ()) {
            Ok(_) => {}
            Err(mut error) => {
                error.sent = None;
                if !is_line_trouble(&error.failure) {
                    return Err(error);
                }
                if matches!(error.failure, Failure::Refused { .. }) {
                    self.met.answered(unit);
                }
                if probe == Probe::Echo && matches!(error.failure, Failure::NoAnswer { .. }) {
                    self.resync.silent_on_echo(unit);
                }
                tried.failure = Some(error);
            }
        }
        Ok(())
    }

    /// Sends one request and waits for what becomes of it.
    pub(crate) fn exchange(
        &mut self,
        ask: &Ask<'_>,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let unit = match ask.destination {
            Destination::Unit(unit) => Some(unit),
            Destination::Broadcast => None,
        };
        let is_met =
            ask.in_doubt && unit.is_some_and(|unit| self.master.first_contact_ends(self.now(), unit).is_some());
        if let (true, Some(unit)) = (is_met, unit) {
            self.met.asked(unit, ask.request);
        }
        let is_silent = unit.is_some_and(|unit| !self.heard[usize::from(unit.get())]);
        let ask = &Ask { timeout: self.patience(ask), yields: ask.yields.filter(|_| is_silent), ..*ask };
        let result = match self.line.as_deref_mut() {
            Some(line) => {
                let usual = unit.and_then(|unit| self.delays.longest(unit));
                let result = exchange(line, &mut self.master, ask, (usual, &mut self.lumps), give_up, take);
                while let Some(late) = line.take_late() {
                    self.master.saw_late(line.now(), &late);
                }
                result
            }
            None => Err(ask.failed(Failure::Closed, None, None, &[])),
        };
        let delay = result.as_ref().ok().map(|done| self.delay(ask, done));
        if let (Some(unit), Some(delay), Request::Read { .. }) = (unit, delay, ask.request) {
            self.delays.answered(unit, delay);
        } else if let (Some(unit), true, Err(error)) = (unit, ask.learns, &result)
            && matches!(error.failure, Failure::NoAnswer { .. })
        {
            self.delays.silent(unit);
        }
        if result.is_ok() && unit.is_some() {
            self.opener.answered();
        }
        let refused = matches!(&result, Err(error) if matches!(error.failure, Failure::Refused { .. }));
        if self.others.may_be()
            && let Some(unit) = unit
        {
            self.others.asked(self.now(), unit, ask, refused);
        }
        if let (true, Some(unit)) = (is_met, unit)
            && (result.is_ok() || refused)
        {
            self.met.answered(unit);
        }
        let tally = self.master.take_tally();
        self.learn(ask, &result, tally);
        if let Some(unit) = unit {
            let heard = self.links.lock().unwrap_or_else(PoisonError::into_inner).note(unit, &result);
            if let Some(heard) = heard {
                self.heard[usize::from(unit.get())] = heard;
            }
            match &result {
                Ok(_) => self.resync.answered(unit, ask.request, false),
                Err(error) => match self.meanings.of(unit, ask.meanings, &error.failure) {
                    Some(Meaning::AskAgain) => self.resync.was_busy(unit, ask.request),
                    Some(_) => self.resync.answered(unit, ask.request, true),
                    None => {}
                },
            }
        }
        let sent = match &result {
            Ok(_) => true,
            Err(error) => error.sent.is_some(),
        };
        let has_seen_more = tally != Tally::default();
        self.stats().count(unit, |counters| {
            counters.requests += u64::from(sent);
            if has_seen_more {
                counters.add(tally);
            }
            match &result {
                Ok(done) => {
                    counters.answered(done.ended.saturating_duration_since(done.sent), delay.unwrap_or_default());
                }
                Err(error) => match error.failure {
                    Failure::NoAnswer { .. } | Failure::Unreached => counters.timeouts += 1,
                    Failure::Corrupt(_) => counters.crc_errors += 1,
                    Failure::Wrong(_) => counters.bad_answers += 1,
                    Failure::Refused { .. } => counters.refusals += 1,
                    _ => {}
                },
            }
        });
        if let Err(error) = &result
            && matches!(error.failure, Failure::Port(_))
        {
            self.line = None;
        }
        result
    }

    /// The time-out that the unit's answers have taught, if that is to hold for `ask` and is shorter than its own.
    fn patience(&self, ask: &Ask<'_>) -> Duration {
        match (ask.destination, ask.request) {
            (Destination::Unit(unit), Request::Read { .. }) if ask.learns => {
                let learned = self.delays.patience(unit).map(|patience| patience + self.answer_time(ask));
                learned.map_or(ask.timeout, |learned| learned.min(ask.timeout))
            }
            _ => ask.timeout,
        }
    }

    /// How long the characters of the right answer take, where its length is known.
    fn answer_time(&self, ask: &Ask<'_>) -> Duration {
        self.format.chars(ask.request.expected().adu_len().map_or(0, |len| u32::try_from(len).unwrap_or(0)))
    }

    /// How long the unit took: from the last character of the request to the first of the answer.
    fn delay(&self, ask: &Ask<'_>, done: &Done) -> Duration {
        let request = ask.request.adu_len();
        let on_the_wire = self.format.chars(u32::try_from(request).unwrap_or(u32::MAX)) + self.answer_time(ask);
        done.ended.saturating_duration_since(done.sent).saturating_sub(on_the_wire)
    }
}

/// Whether `failure` is of a kind that another request over the same line may not have.
pub(crate) fn is_line_trouble(failure: &Failure) -> bool {
    use Failure::{Corrupt, NoAnswer, OthersAsk, Refused, Unreached, Wrong};
    matches!(failure, NoAnswer { .. } | Unreached | Corrupt(_) | Wrong(_) | Refused { .. } | OthersAsk)
}
