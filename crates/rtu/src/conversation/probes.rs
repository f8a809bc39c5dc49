//! The way back after a request was left open: which word to echo, and what to try with units that do not echo.

use super::outcome::Slip;
use crate::bytes::Bytes;
use crate::huanyang::Huanyang;
use crate::{Instant, Master, Request, Table, UnitAddress};

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

/// How many statuses each drive has that speaks Huanyang's protocol.
///
/// Source: LinuxCNC, `src/hal/user_comps/huanyang-vfd/hy_vfd.c`.
const STATUSES: u8 = 8;

/// Most words that a read asks for only to tell its answer from others: what every drive known here allows.
pub(super) const MAX_WORDS: u16 = 16;

/// A request whose answer ends a quarantine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Probe {
    /// A fresh word, to be sent back.
    Echo,
    /// So many words from an address: a length that no open answer has.
    OtherRead {
        /// The first.
        address: u16,
        /// How many.
        count: u16,
    },
    /// In Huanyang's protocol, whose answers repeat it: a status of a number that no open answer has.
    Status {
        /// Which one.
        number: u8,
    },
}

/// What was tried for one attempt of a call, and what came of it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tried {
    /// Looks at the adapter.
    pub(super) looks: u32,
    echoes: u32,
    other_read: bool,
    /// Whether it was asked until the answers agree, and they did not.
    pub(super) disagreed: bool,
    /// How the latest probe failed, and the bytes that came.
    pub(super) failure: Option<(Slip, Bytes)>,
}

impl Tried {
    /// Whether an echo went out, or was to.
    pub(super) fn has_echoed(&self) -> bool {
        self.echoes > 0
    }

    /// `probe` goes out.
    pub(super) fn note(&mut self, probe: Probe) {
        match probe {
            Probe::Echo => self.echoes += 1,
            Probe::OtherRead { .. } | Probe::Status { .. } => self.other_read = true,
        }
    }
}

/// What a unit made of an echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Echo {
    Returned,
    Refused,
}

/// What is known of one unit: what it makes of echoes, and what else it answers.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Probing {
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

impl Probing {
    /// It could not take `request`, as it said: it is busy, or got it damaged. That tells nothing of what it knows.
    pub(super) fn was_busy(&mut self, request: &Request<'_>) {
        let known = self;
        known.alive = true;
        if matches!(request, Request::Echo { .. }) {
            known.busy_echoes += 1;
            if known.busy_echoes >= BUSY_FOR_GOOD {
                known.echo = Some(Echo::Refused);
            }
        }
    }

    /// It answered `request`, or refused it.
    pub(super) fn answered(&mut self, request: &Request<'_>, refused: bool) {
        let known = self;
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
    pub(super) fn probe(
        &mut self,
        master: &Master,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
        tried: &Tried,
        in_time: bool,
    ) -> Option<Probe> {
        if let Request::Huanyang(_) = request {
            // It knows no echo, and nothing else of Modbus.
            let status = |number| Request::Huanyang(Huanyang::ReadStatus { number });
            let apart = |&number: &u8| master.tells_apart(now, unit, &status(number));
            let number = (0..STATUSES).find(apart).filter(|_| !tried.other_read)?;
            return Some(Probe::Status { number });
        }
        let known = self;
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
            Some(Probe::OtherRead { .. } | Probe::Status { .. }) => {
                known.echo_was_last = false;
                known.other_reads += 1;
            }
            None => {} // the latest probe is still the one before
        }
        probe
    }

    /// Whether it refuses echoes, or is silent on them.
    pub(super) fn knows_no_echo(&self) -> bool {
        match self.echo {
            Some(echo) => echo == Echo::Refused,
            None => self.silent_echoes >= SILENT_BEFORE_READ,
        }
    }

    /// Whether it has refused the latest echo that it answered.
    pub(super) fn refuses_echoes(&self) -> bool {
        self.echo == Some(Echo::Refused)
    }

    /// It owes nothing.
    pub(super) fn is_sure(&mut self) {
        self.other_reads = 0;
    }

    /// It was silent on an echo.
    pub(super) fn silent_on_echo(&mut self) {
        self.silent_echoes = self.silent_echoes.saturating_add(1);
        // Another unit may have its address now.
        if self.silent_echoes >= SILENT_FOR_GOOD {
            self.echo = None;
        }
    }
}

#[cfg(test)]
mod tests;
