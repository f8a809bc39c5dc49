//! What units hear of a master: characters until silence ends them.

use drivebus_rtu::{Frame, Instant};

/// More than the longest frame; what a master babbles beyond it is of no use to anybody.
const LONGEST: usize = 512;

/// From the first bit to the last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    pub(crate) begin: Instant,
    pub(crate) end: Instant,
}

impl Span {
    pub(crate) fn overlaps(self, other: Self) -> bool {
        self.begin < other.end && other.begin < self.end
    }
}

/// What the master has sent since the last silence.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    bytes: Vec<u8>,
    /// One for each byte.
    spans: Vec<Span>,
    /// Units that insist on silence do not take this for a frame.
    ignored: bool,
}

impl Heard {
    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Whether it is a frame, and only the silence after it is missing.
    pub(crate) fn is_whole(&self) -> bool {
        Frame::parse(&self.bytes).is_ok()
    }

    /// The end of the last character.
    pub(crate) fn end(&self) -> Option<Instant> {
        self.spans.last().map(|last| last.end)
    }

    pub(crate) fn ignore(&mut self) {
        self.ignored = true;
    }

    pub(crate) fn push(&mut self, byte: u8, span: Span) {
        if self.bytes.len() == LONGEST {
            self.ignored = true;
            return;
        }
        self.bytes.push(byte);
        self.spans.push(span);
    }

    /// The characters that were not over at `now` never come.
    pub(crate) fn cut(&mut self, now: Instant) {
        let whole = self.spans.iter().take_while(|span| span.end <= now).count();
        self.bytes.truncate(whole);
        self.spans.truncate(whole);
    }

    /// The frame is over: what came, where `spoil` says what becomes of a byte in its span; `None` where nobody listens.
    ///
    /// What was spoilt is no frame any more, also where its CRC is right by chance.
    pub(crate) fn take(&mut self, mut spoil: impl FnMut(u8, Span) -> u8) -> Option<Vec<u8>> {
        let mut spoilt = false;
        let mut bytes = Vec::with_capacity(self.bytes.len());
        for (&byte, &span) in self.bytes.iter().zip(&self.spans) {
            let arrives = spoil(byte, span);
            spoilt |= arrives != byte;
            bytes.push(arrives);
        }
        let ignored = std::mem::take(&mut self.ignored);
        self.bytes.clear();
        self.spans.clear();
        (!ignored && !spoilt).then_some(bytes)
    }
}
