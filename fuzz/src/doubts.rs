//! What the model of the fuzzed master knows of each unit: what it left open, and when that is over.

use drivebus_rtu::{Instant, PATIENCE};

use crate::oracle::{self, Asked, Verdict};

/// So many echoes left open, and a unit that returned some counts as one that returns none.
const MUTE: usize = 5;

/// A request that was left open.
#[derive(Debug, Clone)]
pub(crate) struct Open {
    pub(crate) asked: Asked,
    given_up: Instant,
    /// How many bytes had come on the line when it was sent.
    place: usize,
}

impl Open {
    pub(crate) fn is_echo(&self) -> bool {
        self.asked.pdu[0] == 8
    }

    /// Whether nobody waits for its answer any more: a unit that is known to return echoes is waited for until it does.
    fn is_past(&self, now: Instant, echoed: bool) -> bool {
        !echoed && now >= self.given_up + PATIENCE
    }

    /// Whether its answer may have come from `unit` since, by what came on the line.
    fn may_have_come(&self, unit: u8, stream: &[u8]) -> bool {
        let frames = (self.place..stream.len()).filter(|&from| stream[from] == unit);
        frames.into_iter().any(|from| {
            let whole = (from + 4..=stream.len().min(from + 256)).filter_map(|to| oracle::frame(&stream[from..to]));
            whole.into_iter().any(|(_, pdu)| self.asked.judge(pdu) == Verdict::Right)
        })
    }
}

/// What the model knows of one unit.
#[derive(Debug, Default)]
pub(crate) struct Known {
    /// Requests that it left open.
    pub(crate) open: Vec<Open>,
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
        let owed = |open: &Open| !open.is_echo() && !open.is_past(now, self.echoed);
        self.is_strange(now) || self.open.iter().any(owed)
    }

    /// Whether what it left open keeps it in quarantine: for good where it is known to return echoes.
    pub(crate) fn holds(&self, now: Instant) -> bool {
        let recent = |open: &Open| !open.is_echo() && now < open.given_up + PATIENCE;
        !self.open.is_empty() && (self.echoed || self.open.iter().any(recent))
    }

    /// It left `asked` open, which was sent when `place` bytes had come on the line, and given up at `now`.
    pub(crate) fn leave_open(&mut self, asked: Asked, now: Instant, place: usize) {
        self.open.push(Open { asked, given_up: now, place });
        let is_echo = self.open.last().is_some_and(Open::is_echo);
        if is_echo && self.open.iter().filter(|open| open.is_echo()).count() >= MUTE {
            self.echoed = false;
        }
    }

    /// The master takes number `unit` at `now` for one that owes nothing: true only where all that it owed may have come, or
    /// is waited for no longer. What may have come is open no more.
    pub(crate) fn may_be_free(&mut self, now: Instant, unit: u8, stream: &[u8]) -> bool {
        let echoed = self.echoed;
        let all = self
            .open
            .iter()
            .all(|open| open.is_echo() || open.is_past(now, echoed) || open.may_have_come(unit, stream));
        if all {
            self.open.retain(|open| open.is_echo() || open.is_past(now, echoed));
        }
        all
    }

    pub(crate) fn settle(&mut self) {
        self.open.clear();
        self.strange_until = None;
    }

    /// Whether a read like `pdu` is open, so that its answer looks the same.
    pub(crate) fn has_read_like(&self, pdu: &[u8]) -> bool {
        self.reads_like(pdu).next().is_some()
    }

    /// Whether the answer to a read like `pdu` cannot have come from number `unit` by `now`, and is still waited for.
    pub(crate) fn owes_read_like(&self, now: Instant, pdu: &[u8], unit: u8, stream: &[u8]) -> bool {
        self.reads_like(pdu).any(|open| !open.is_past(now, self.echoed) && !open.may_have_come(unit, stream))
    }

    fn reads_like(&self, pdu: &[u8]) -> impl Iterator<Item = &Open> {
        // Or looks the same when it is cut short.
        self.open.iter().filter(move |open| open.asked.pdu[0] == 3 && open.asked.pdu[3..5] >= pdu[3..5])
    }
}
