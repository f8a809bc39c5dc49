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
    fn may_have_come(&self, unit: u8, stream: &Stream) -> bool {
        let mut frames = stream.frames.iter().filter(|(from, _)| *from >= self.place);
        frames.any(|(_, frame)| frame[0] == unit && self.asked.judge(&frame[1..frame.len() - 2]) == Verdict::Right)
    }
}

/// All that came on the line, and each frame of a unit that any part of it makes.
#[derive(Default)]
pub(crate) struct Stream {
    pub(crate) len: usize,
    frames: Vec<(usize, Vec<u8>)>,
    /// What may become one: where it begins, what came of it, and the CRC of that.
    begun: Vec<(usize, Vec<u8>, u16)>,
}

impl Stream {
    /// `bytes` came, of units up to number `units`.
    pub(crate) fn push(&mut self, bytes: &[u8], units: u8) {
        for &byte in bytes {
            if (1..=units).contains(&byte) {
                self.begun.push((self.len, Vec::new(), oracle::EMPTY_CRC));
            }
            self.len += 1;
            for (from, frame, crc) in &mut self.begun {
                frame.push(byte);
                *crc = oracle::crc_after(*crc, byte);
                if *crc == 0 && frame.len() >= 4 {
                    self.frames.push((*from, frame.clone()));
                }
            }
            self.begun.retain(|(_, frame, _)| frame.len() < 256);
        }
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
    pub(crate) fn may_be_free(&mut self, now: Instant, unit: u8, stream: &Stream) -> bool {
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
    pub(crate) fn owes_read_like(&self, now: Instant, pdu: &[u8], unit: u8, stream: &Stream) -> bool {
        self.reads_like(pdu).any(|open| !open.is_past(now, self.echoed) && !open.may_have_come(unit, stream))
    }

    fn reads_like(&self, pdu: &[u8]) -> impl Iterator<Item = &Open> {
        // Or looks the same when it is cut short.
        self.open.iter().filter(move |open| open.asked.pdu[0] == 3 && open.asked.pdu[3..5] >= pdu[3..5])
    }
}
