//! The way back after a request was left open: which word to echo, and what to try with units that do not echo.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::atomic::{AtomicU16, Ordering};

use drivebus_rtu::{Instant, Master, Request, Table, UnitAddress};

use crate::by_unit::ByUnit;
use crate::error::CallError;

/// How often one attempt echoes a unit that is known to return echoes.
const ECHOES: u32 = 2;

/// How many echoes in a row a unit that never returned one must be silent on before it is asked a read of another length
/// instead: units that know no echo are ordinary.
const SILENT_BEFORE_READ: u32 = 1;

/// After how many it is taken for one that knows no echo, and is not echoed first any more.
const SILENT_FOR_GOOD: u32 = 5;

/// How many echoes in a row a unit must refuse as busy, or damaged, until it is taken for one that knows none.
const BUSY_FOR_GOOD: u32 = 3;

/// How many reads of another length one doubt is worth. Each that stays open is one more answer to wait for, and only time
/// helps with a unit that answers none of them.
const OTHER_READS: u32 = 2;

/// Most words that a read asks for only to tell its answer from others: what every drive known here allows.
pub(crate) const MAX_WORDS: u16 = 16;

/// Words for probes and echoes.
#[derive(Debug)]
pub(crate) struct FreshWords(AtomicU16);

impl FreshWords {
    /// An odd step reaches every word before one comes again, so that 65 535 echoes may still be open.
    const STEP: u16 = 0x9E35;

    pub(crate) fn new() -> Self {
        let words = Self(AtomicU16::new(0));
        // Where the words begin is random: another program on this line must not use the same ones.
        words.begin_by(RandomState::new().build_hasher().finish());
        words
    }

    /// Begins where `chance` says. Nothing was asked yet.
    pub(crate) fn begin_by(&self, chance: u64) {
        let [a, b, ..] = chance.to_le_bytes();
        self.0.store(u16::from_le_bytes([a, b]), Ordering::Relaxed);
    }

    /// Whether `word` is the one that was given out last, so that only the echo that it was meant for carries it.
    pub(crate) fn is_latest(&self, word: u16) -> bool {
        self.0.load(Ordering::Relaxed) == word.wrapping_add(Self::STEP)
    }

    /// A word that no open echo carries.
    pub(crate) fn next(&self) -> u16 {
        self.0.fetch_add(Self::STEP, Ordering::Relaxed)
    }
}

/// A request whose answer ends a quarantine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Probe {
    /// A fresh word, to be sent back.
    Echo,
    /// So many words from an address: a length that no open answer has.
    OtherRead {
        /// The first.
        address: u16,
        /// How many.
        count: u16,
    },
}

/// What was tried for one attempt of a call, and what came of it.
#[derive(Debug, Default)]
pub(crate) struct Tried {
    /// Looks at the adapter.
    pub(crate) looks: u32,
    echoes: u32,
    other_read: bool,
    /// How the latest probe failed.
    pub(crate) failure: Option<Box<CallError>>,
}

impl Tried {
    /// Whether an echo went out, or was to.
    pub(crate) fn has_echoed(&self) -> bool {
        self.echoes > 0
    }

    /// `probe` goes out.
    pub(crate) fn note(&mut self, probe: Probe) {
        match probe {
            Probe::Echo => self.echoes += 1,
            Probe::OtherRead { .. } => self.other_read = true,
        }
    }
}

/// What a unit made of an echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Echo {
    Returned,
    Refused,
}

/// What is known of the units that were asked.
#[derive(Debug, Default)]
pub(crate) struct Resync(ByUnit<Known>);

#[derive(Debug, Default)]
struct Known {
    /// It has answered something.
    alive: bool,
    /// What it made of the latest echo that it answered, unless it was silent on [`SILENT_FOR_GOOD`] since.
    echo: Option<Echo>,
    /// Echoes in a row that it was silent on.
    silent_echoes: u32,
    /// Echoes in a row that it could not take, as it said.
    busy_echoes: u32,
    /// A holding register that it answered a read of.
    readable: Option<u16>,
    /// The latest probe was an echo.
    echo_was_last: bool,
    /// Reads of another length since it was last sure.
    other_reads: u32,
}

impl Known {
    fn knows_no_echo(&self) -> bool {
        match self.echo {
            Some(echo) => echo == Echo::Refused,
            None => self.silent_echoes >= SILENT_BEFORE_READ,
        }
    }
}

impl Resync {
    /// `unit` could not take `request`, as it said: it is busy, or got it damaged. That tells nothing of what it knows.
    pub(crate) fn was_busy(&mut self, unit: UnitAddress, request: &Request<'_>) {
        let known = self.0.of(unit);
        known.alive = true;
        if matches!(request, Request::Echo { .. }) {
            known.busy_echoes += 1;
            if known.busy_echoes >= BUSY_FOR_GOOD {
                known.echo = Some(Echo::Refused);
            }
        }
    }

    /// `unit` answered `request`, or refused it.
    pub(crate) fn answered(&mut self, unit: UnitAddress, request: &Request<'_>, refused: bool) {
        let known = self.0.of(unit);
        known.alive = true;
        match request {
            Request::Echo { .. } => {
                known.echo = Some(if refused { Echo::Refused } else { Echo::Returned });
                known.silent_echoes = 0;
                known.busy_echoes = 0;
            }
            Request::Read { table: Table::Holding, address, .. } if !refused => known.readable = Some(*address),
            _ => {}
        }
    }

    /// What to send to `unit`, which is in quarantine and is to be asked `request`; `None` when everything was tried.
    /// Not `in_time`, nothing is tried twice.
    pub(crate) fn probe(
        &mut self,
        master: &Master,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
        tried: &Tried,
        in_time: bool,
    ) -> Option<Probe> {
        let known = self.0.of(unit);
        let again = match known.echo {
            Some(Echo::Returned) => in_time && tried.echoes < ECHOES,
            // What it says of one echo it says of each.
            Some(Echo::Refused) => false,
            None => known.silent_echoes < SILENT_BEFORE_READ,
        };
        let echo = (tried.echoes == 0 || again).then_some(Probe::Echo);
        let address = match *request {
            Request::Read { table: Table::Holding, address, .. } => known.readable.or(Some(address)),
            _ => known.readable,
        };
        let knows_no_echo = known.knows_no_echo();
        let other_read = || {
            let is_worth_it = knows_no_echo && !tried.other_read && known.other_reads < OTHER_READS;
            let address = address.filter(|_| is_worth_it)?;
            (1..=MAX_WORDS)
                .filter_map(|count| Some((count, Request::read(address, count).ok()?)))
                .find(|(_, read)| master.tells_apart(now, unit, read))
                .map(|(count, _)| Probe::OtherRead { address, count })
        };
        let probe = if known.alive {
            if knows_no_echo && known.echo.is_none() { other_read().or(echo) } else { echo.or_else(other_read) }
        } else if tried.has_echoed() || tried.other_read {
            None // silence is all that is known: one probe an attempt, so that it costs no more than an attempt
        } else if known.echo_was_last {
            other_read().or(echo)
        } else {
            echo
        };
        match probe {
            Some(Probe::Echo) => known.echo_was_last = true,
            Some(Probe::OtherRead { .. }) => {
                known.echo_was_last = false;
                known.other_reads += 1;
            }
            None => {} // the latest probe is still the one before
        }
        probe
    }

    /// Whether `unit` refuses echoes, or is silent on them.
    pub(crate) fn knows_no_echo(&self, unit: UnitAddress) -> bool {
        self.0.get(unit).is_some_and(Known::knows_no_echo)
    }

    /// Whether `unit` has refused the latest echo that it answered.
    pub(crate) fn refuses_echoes(&self, unit: UnitAddress) -> bool {
        self.0.get(unit).is_some_and(|known| known.echo == Some(Echo::Refused))
    }

    /// `unit` owes nothing.
    pub(crate) fn is_sure(&mut self, unit: UnitAddress) {
        self.0.of(unit).other_reads = 0;
    }

    /// `unit` was silent on an echo.
    pub(crate) fn silent_on_echo(&mut self, unit: UnitAddress) {
        let known = self.0.of(unit);
        known.silent_echoes = known.silent_echoes.saturating_add(1);
        // Another unit may have its address now.
        if known.silent_echoes >= SILENT_FOR_GOOD {
            known.echo = None;
        }
    }
}

#[cfg(test)]
mod tests;
