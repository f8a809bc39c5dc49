//! What units hear of a master: characters until silence ends them.

use drivebus_rtu::{Frame, Instant, SerialFormat};

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

    /// That of the character number `place`, from 0, of those that come without a gap from `begin` on.
    pub(crate) fn of_char(format: &SerialFormat, begin: Instant, place: usize) -> Self {
        let upto = |count: usize| begin + format.chars(u32::try_from(count).unwrap_or(u32::MAX));
        Self { begin: upto(place), end: upto(place + 1) }
    }
}

/// Characters that came in one piece.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// The number of the first one.
    from: usize,
    begin: Instant,
}

/// What the master has sent since the last silence.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    bytes: Vec<u8>,
    pieces: Vec<Piece>,
    /// The end of the last character.
    end: Option<Instant>,
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

    /// The first bit.
    pub(crate) fn begin(&self) -> Option<Instant> {
        self.pieces.first().map(|piece| piece.begin)
    }

    /// The end of the last character.
    pub(crate) fn end(&self) -> Option<Instant> {
        self.end
    }

    pub(crate) fn ignore(&mut self) {
        self.ignored = true;
    }

    /// `bytes` come without a gap from `begin` on.
    pub(crate) fn push(&mut self, bytes: &[u8], begin: Instant, format: &SerialFormat) {
        let room = LONGEST - self.bytes.len();
        self.ignored |= bytes.len() > room;
        let kept = &bytes[..bytes.len().min(room)];
        if let Some(last) = kept.len().checked_sub(1) {
            self.end = Some(Span::of_char(format, begin, last).end);
            self.pieces.push(Piece { from: self.bytes.len(), begin });
            self.bytes.extend_from_slice(kept);
        }
    }

    /// When each character came.
    fn spans(&self, format: &SerialFormat) -> impl Iterator<Item = Span> {
        let untils = self.pieces.iter().skip(1).map(|next| next.from).chain([self.bytes.len()]);
        let pieces = self.pieces.iter().zip(untils);
        pieces.flat_map(move |(piece, until)| {
            (0..until - piece.from).map(move |place| Span::of_char(format, piece.begin, place))
        })
    }

    /// The characters that were not over at `now` never come.
    pub(crate) fn cut(&mut self, now: Instant, format: &SerialFormat) {
        let whole: Vec<Span> = self.spans(format).take_while(|span| span.end <= now).collect();
        self.end = whole.last().map(|last| last.end);
        self.bytes.truncate(whole.len());
        self.pieces.retain(|piece| piece.from < whole.len());
    }

    /// The frame is over: what came is now in `frame`. False where nobody listens: what was spoilt is no frame any more,
    /// also where its CRC is right by chance.
    ///
    /// `spoil` says what becomes of a byte in its span; `None`: nothing becomes of any.
    pub(crate) fn take(
        &mut self,
        frame: &mut Vec<u8>,
        format: &SerialFormat,
        spoil: Option<impl FnMut(u8, Span) -> u8>,
    ) -> bool {
        let mut spoilt = false;
        if let Some(mut spoil) = spoil {
            for (&byte, span) in self.bytes.iter().zip(self.spans(format)) {
                spoilt |= spoil(byte, span) != byte;
            }
        }
        std::mem::swap(frame, &mut self.bytes);
        self.bytes.clear();
        self.pieces.clear();
        self.end = None;
        !std::mem::take(&mut self.ignored) && !spoilt
    }
}
