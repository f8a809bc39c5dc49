//! The open line, what is known of it and of its units, and the figures about both.

mod arrival_pauses;
pub(crate) mod delays;
pub(crate) mod exchange;
pub(crate) mod meanings;
pub(crate) mod opener;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::{Counts, Exchange, Instant, Known, Opened, OwnEcho, Request, SerialFormat, Tally, UnitAddress};

use crate::ask::Ask;
use crate::error::Failure;
use crate::health::link::Links;
use crate::health::stats::Stats;
use crate::line::Opener;
use crate::line::{Line, LineClock};
use crate::owner::arrival_pauses::Lumps;
use crate::owner::delays::Delays;
use crate::owner::exchange::Talk;
use crate::owner::meanings::UnitMeanings;
use crate::owner::opener::LineOpener;
use crate::trace::{Trace, Watched};
use crate::turns::queue::Stops;

/// As many as there are addresses, the reserved ones among them.
const UNITS: usize = 256;

/// The line, and all that is known about it.
pub(crate) struct Owner {
    line: Option<Box<dyn Line>>,
    /// The clock of the line that was open last.
    clock: Option<LineClock>,
    opener: LineOpener,
    /// What is known of it, its adapter and its units.
    pub(crate) known: Box<Known<UNITS>>,
    /// What its units say by their exceptions.
    pub(crate) meanings: Arc<UnitMeanings>,
    links: Arc<Mutex<Links>>,
    /// Units that were heard when they were asked last, by their number.
    heard: [bool; 256],
    delays: Delays,
    lumps: Lumps,
    format: SerialFormat,
    /// After each frame.
    silence: Duration,
    stats: Arc<Mutex<Stats>>,
    /// Whether nothing was asked since the line was opened.
    is_new: bool,
    /// Where somebody watches the line, or has.
    trace: Option<Trace>,
}

impl std::fmt::Debug for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Owner").field("line", &self.line).field("echo", &self.known.echo()).finish_non_exhaustive()
    }
}

impl Owner {
    /// With no line yet. `chance` tells two masters on one line apart.
    pub(crate) fn new(
        opener: Opener,
        format: SerialFormat,
        echo: OwnEcho,
        chance: u64,
        stats: Arc<Mutex<Stats>>,
    ) -> Self {
        Self {
            line: None,
            clock: None,
            opener: LineOpener::new(opener),
            known: Box::new(Known::new(format, echo, chance)),
            meanings: Arc::default(),
            links: Arc::default(),
            heard: [false; 256],
            delays: Delays::default(),
            lumps: Lumps::of_no_line(),
            format,
            silence: format.t35(),
            stats,
            is_new: true,
            trace: None,
        }
    }

    /// Opens the line for the first time.
    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        let line = self.opener.open(give_up)?;
        self.take_line(line);
        Ok(())
    }

    pub(crate) fn close(&mut self) {
        self.line = None;
        self.known.closed();
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

    /// The line, if it is open.
    pub(crate) fn line(&mut self) -> Option<&mut (dyn Line + 'static)> {
        self.line.as_deref_mut()
    }

    /// Counts what came while nothing was asked.
    pub(crate) fn stray(&mut self, now: Instant, bytes: &[u8]) {
        self.known.stray(now, bytes);
        self.count_strays();
    }

    /// Keeps the count of what came while nothing was asked.
    fn count_strays(&mut self) {
        let tally = self.known.take_strays();
        if tally != Tally::default() {
            let is_noisy = tally.noise > 0 && !self.is_new;
            self.stats().count(None, |counters| {
                counters.add(tally);
                counters.noise_events += u64::from(is_noisy);
            });
        }
    }

    /// Makes ready for a request: opens the line again if it was lost, or ended while nobody asked, unless `give_up` says so
    /// first.
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(crate) fn prepare(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        if self.line.as_deref_mut().is_some_and(|line| line.make_ready().is_err()) {
            self.close();
        }
        if self.line.is_none() {
            let line = self.opener.open(give_up)?;
            self.take_line(line);
        }
        // Nothing is in flight, unless a caller's own code panicked while it was: then that is given up.
        self.known.abort(self.now());
        let connection = self.stats().reconnects;
        self.known.is_connection(connection);
        Ok(())
    }

    fn take_line(&mut self, line: Box<dyn Line>) {
        let opened =
            Opened::new().may_echo(line.may_echo()).may_have_others(line.may_have_others()).gapless(line.gapless());
        self.known.opened(line.now(), &opened);
        self.clock = line.clock();
        self.lumps = Lumps::of(line.as_ref());
        self.is_new = true;
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

    /// Where stops wait that go before `ask` even when it is on its way: its unit was silent the last time.
    fn yields<'a>(&self, ask: &Ask<'a>) -> Option<&'a dyn Stops> {
        let is_heard = |unit: UnitAddress| self.heard[usize::from(unit.get())];
        ask.yields.filter(|_| ask.unit().is_some_and(|unit| !is_heard(unit)))
    }

    /// How long to listen, by what answers have taught, in the next exchange of `talk`.
    fn prepare_next(&mut self, talk: &mut Talk<'_, '_>) {
        let Some(unit) = talk.ask.unit() else { return };
        self.known.be_patient(self.lumps.patience(self.delays.longest(unit)));
        if talk.ask.learns {
            talk.call.expect_within(self.delays.patience(unit));
        }
    }

    /// Counts what happened on behalf of a call.
    fn count(&mut self, ask: &Ask<'_>, counts: Counts) {
        if counts == Counts::default() {
            return;
        }
        self.stats().count(ask.unit(), |counters| {
            counters.retries += u64::from(counts.retries);
            counters.verified += u64::from(counts.verified);
            counters.resyncs += u64::from(counts.resyncs);
        });
    }

    /// Takes what came by other means than bytes of the line: answers to earlier requests, and into `strange` what answers
    /// none.
    fn take_late(&mut self, strange: &mut Vec<u8>) {
        strange.clear();
        let Some(line) = self.line.as_deref_mut() else { return };
        while let Some(late) = line.take_late() {
            self.known.saw_late(line.now(), &late);
        }
        while let Some(frame) = line.take_strange() {
            strange.extend_from_slice(&frame);
        }
    }

    /// Keeps what one request of `talk` came to: its answer, or `failure`.
    fn keep(&mut self, talk: &Talk<'_, '_>, exchange: &Exchange<'_>, failure: Option<&Failure>) {
        let ask = talk.ask;
        let unit = ask.unit();
        let delay = exchange.sent.filter(|_| failure.is_none()).map(|sent| self.delay(exchange, sent));
        if let (Some(unit), Some(delay), Request::Read { .. }) = (unit, delay, exchange.request) {
            self.delays.answered(unit, delay);
        } else if let (Some(unit), true, Some(Failure::NoAnswer { .. })) = (unit, ask.learns, failure) {
            self.delays.silent(unit);
        }
        if failure.is_none() && unit.is_some() {
            self.opener.answered();
        }
        if let Some(unit) = unit {
            let heard = self.links.lock().unwrap_or_else(PoisonError::into_inner).note(unit, failure);
            if let Some(heard) = heard {
                self.heard[usize::from(unit.get())] = heard;
            }
        }
        let tally = exchange.tally;
        let has_seen_more = tally != Tally::default();
        // What a server says to whoever connects is no noise of its line.
        let greets = std::mem::take(&mut self.is_new);
        let is_noisy = tally.noise > 0 && !greets;
        let is_strange = !talk.strange.is_empty();
        let is_other = exchange.bytes > 0 || is_strange;
        let took = exchange.sent.map(|sent| exchange.ended.saturating_duration_since(sent));
        let occupied = took.map_or(Duration::ZERO, |took| took.saturating_add(self.silence));
        self.stats().count(unit, |counters| {
            counters.requests += u64::from(exchange.sent.is_some());
            counters.occupied = counters.occupied.saturating_add(occupied);
            counters.noise_events += u64::from(is_noisy);
            if has_seen_more {
                counters.add(tally);
            }
            match (failure, took) {
                (None, Some(took)) => counters.answered(took, delay.unwrap_or_default()),
                (Some(Failure::NoAnswer { .. }), _) => {
                    counters.timeouts += 1;
                    counters.other_answers += u64::from(is_other);
                    counters.other_functions += u64::from(tally.misfit > 0);
                    counters.other_transactions += u64::from(is_strange);
                }
                (Some(Failure::Unreached), _) => counters.timeouts += 1,
                (Some(Failure::Corrupt(_)), _) => counters.crc_errors += 1,
                (Some(Failure::Wrong(_)), _) => counters.bad_answers += 1,
                (Some(Failure::Refused { .. }), _) => counters.refusals += 1,
                _ => {}
            }
        });
    }

    /// How long the unit took: from the last character of the request to the first of the answer.
    fn delay(&self, exchange: &Exchange<'_>, sent: Instant) -> Duration {
        let chars = |bytes: usize| self.format.chars(u32::try_from(bytes).unwrap_or(u32::MAX));
        let answer = exchange.request.expected().adu_len().map_or(Duration::ZERO, chars);
        let on_the_wire = chars(exchange.request.adu_len()) + answer;
        exchange.ended.saturating_duration_since(sent).saturating_sub(on_the_wire)
    }
}
