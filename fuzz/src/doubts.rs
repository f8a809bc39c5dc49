//! What the model of the fuzzed master knows of each unit: what it left open, and when that is over.

use drivebus_rtu::{Instant, PATIENCE};

/// So many echoes left open, and a unit that returned some counts as one that returns none.
const MUTE: usize = 5;

/// What the model knows of one unit.
#[derive(Debug, Default)]
pub(crate) struct Known {
    /// PDUs of requests that it left open, and when each was given up.
    pub(crate) open: Vec<(Vec<u8>, Instant)>,
    /// It has returned an echo, and did not leave [`MUTE`] open since.
    pub(crate) echoed: bool,
    /// Until when another program's question may be answered.
    pub(crate) strange_until: Option<Instant>,
}

impl Known {
    pub(crate) fn is_strange(&self, now: Instant) -> bool {
        self.strange_until.is_some_and(|until| now < until)
    }

    /// Whether nobody who knows all this would ask it as if nothing were open.
    pub(crate) fn is_doubtful(&self, now: Instant) -> bool {
        let owed = |(pdu, given_up): &(Vec<u8>, Instant)| pdu[0] != 8 && (self.echoed || now < *given_up + PATIENCE);
        self.is_strange(now) || self.open.iter().any(owed)
    }

    /// Whether what it left open keeps it in quarantine: for good where it is known to return echoes.
    pub(crate) fn holds(&self, now: Instant) -> bool {
        let recent = |(pdu, given_up): &(Vec<u8>, Instant)| pdu[0] != 8 && now < *given_up + PATIENCE;
        !self.open.is_empty() && (self.echoed || self.open.iter().any(recent))
    }

    /// It left `pdu` open, which was given up at `now`.
    pub(crate) fn leave_open(&mut self, pdu: Vec<u8>, now: Instant) {
        let is_echo = pdu[0] == 8;
        self.open.push((pdu, now));
        let echoes = self.open.iter().filter(|(pdu, _)| pdu[0] == 8);
        if is_echo && echoes.count() >= MUTE {
            self.echoed = false;
        }
    }

    pub(crate) fn settle(&mut self) {
        self.open.clear();
        self.strange_until = None;
    }

    /// Whether a read like `pdu` is open, so that its answer looks the same.
    pub(crate) fn has_read_like(&self, pdu: &[u8]) -> bool {
        self.open.iter().any(|(open, _)| open[0] == 3 && open[3..5] == pdu[3..5])
    }

    pub(crate) fn has_open_echo(&self, now: Instant) -> bool {
        self.open.iter().any(|(open, given_up)| open[0] == 8 && now < *given_up + PATIENCE)
    }
}
