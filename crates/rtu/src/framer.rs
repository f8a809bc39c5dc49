//! Finds frames in a stream of bytes: length first, silence as fallback.
//!
//! Whoever knows what a frame must look like need not wait for silence to know that it is whole. So a frame comes
//! out at its last byte; silence decides only what no length can: where an unknown function ends, and when a broken
//! start will not be completed. Noise before and after a frame is skipped and handed out, never swallowed.
//!
//! An answer whose length nobody knows ends with the longest run of bytes whose CRC is right, when nothing came for longer than
//! this line ever pauses inside an answer: a receiver hands over eight bytes at a time, an adapter what it collected.
//!
//! How bytes are cut by the operating system changes nothing: the same bytes at the same moments give the same
//! frames.

mod look;

use core::fmt;
use core::ops::Range;
use core::time::Duration;

use crate::expected::Expected;
use crate::frame::{Adu, Frame, FrameError, MAX_ADU};
use crate::{Instant, UnitAddress};

use look::Look;
pub(crate) use look::{EXCEPTION_ADU, lost_its_head};

/// Twice the longest frame: one that is being received, and whatever came before it.
const CAPACITY: usize = 2 * MAX_ADU;
/// Finds frames in a stream of bytes.
///
/// Three verbs: [`receive`](Self::receive) takes bytes, [`poll`](Self::poll) hands out frames and noise,
/// [`deadline`](Self::deadline) says when to poll again although no byte came.
///
/// ```
/// use drivebus_rtu::{Framer, Instant, SerialFormat};
///
/// let mut framer = Framer::new(SerialFormat::DEFAULT.t35());
/// let now = Instant::from_nanos(0);
/// framer.receive(now, &[0xFF, 0x01, 0x06, 0x20, 0x00, 0x00, 0x01, 0x43, 0xCA]); // one byte of noise first
/// assert_eq!(framer.poll(now).and_then(Result::err).map(|skipped| skipped.bytes.len()), Some(1));
/// assert_eq!(framer.poll(now).and_then(Result::ok).map(|frame| frame.address()), Some(1));
/// assert_eq!(framer.poll(now), None);
/// ```
#[derive(Clone)]
pub struct Framer {
    bytes: [u8; CAPACITY],
    len: usize,
    /// Bytes at the front that the last poll handed out.
    taken: usize,
    /// Bytes at the front that silence had ended before newer ones came.
    ended: usize,
    silence: Duration,
    last: Option<Instant>,
    expect: Option<Awaited>,
    /// How long after its last byte the rest of an answer that has begun is waited for, and until when at least; `None`:
    /// for ever.
    patience: Option<(Duration, Instant)>,
    /// The request whose answer is looked for: an adapter may send it back to us.
    own: Adu,
    /// No more of the answer is waited for: what is there of one that only silence ends is all of it.
    is_late: bool,
    /// Bytes were given up for want of room, so that the front is no longer the start of a frame.
    overrun: bool,
}

/// What is hunted for, worked out once.
#[derive(Debug, Clone, Copy)]
struct Awaited {
    unit: u8,
    function: u8,
    /// Unless the unit refuses; `None` where only silence tells.
    len: Option<usize>,
    /// Whether its own bytes tell instead.
    tells: bool,
    /// Whether they do so right behind the function, of whatever answer.
    counted: bool,
}

/// One step of the framer, without borrowing from it.
#[derive(Debug, Clone)]
pub(crate) enum Step {
    Frame(Range<usize>),
    Skipped { range: Range<usize>, error: FrameError, expected: bool },
}

impl Framer {
    /// A framer for frames of both directions, as a unit or a listener needs it. Silence of `silence` ends a frame.
    pub const fn new(silence: Duration) -> Self {
        Self {
            bytes: [0; CAPACITY],
            len: 0,
            taken: 0,
            ended: 0,
            silence,
            last: None,
            expect: None,
            patience: None,
            own: Adu::new(),
            is_late: false,
            overrun: false,
        }
    }

    /// From now on hunts for the answer of `unit` to what `expected` was made from; what is held is dropped.
    ///
    /// Then silence no longer breaks that answer: a USB adapter may deliver it in lumps with pauses between. How long
    /// they may be, [`wait_for_the_rest`](Self::wait_for_the_rest) says.
    pub fn expect(&mut self, unit: UnitAddress, expected: Expected) {
        self.clear();
        self.expect = Some(Awaited {
            unit: unit.get(),
            function: expected.function(),
            len: expected.adu_len(),
            tells: expected.tells_its_length(),
            counted: expected.is_counted(),
        });
        self.patience = None;
        self.is_late = false;
        self.own.clear();
    }

    /// After [`expect`](Self::expect): the rest of an answer that has begun is waited for until `pause` after its last byte,
    /// and `least` at least; without this, for ever. Then what has come of it is handed out as skipped.
    ///
    /// A pause shorter than the silence counts as that silence.
    pub fn wait_for_the_rest(&mut self, pause: Duration, least: Instant) {
        self.patience = Some((pause.max(self.silence), least));
    }

    /// After [`expect`](Self::expect): the time for the answer is over.
    pub(crate) const fn is_late(&mut self) {
        self.is_late = true;
    }

    /// After [`expect`](Self::expect): `own`, the request, may come back before its answer.
    pub(crate) fn expect_own(&mut self, own: &Adu) {
        self.own = *own;
    }

    /// The request has come back, or will not any more.
    pub(crate) fn forget_own(&mut self) {
        self.own.clear();
    }

    /// From now on takes frames of any unit and both directions, what is held included.
    pub(crate) const fn listen(&mut self) {
        self.expect = None;
        self.patience = None;
    }

    /// From now on takes frames of any unit and both directions; what is held is dropped.
    pub fn expect_anything(&mut self) {
        self.clear();
        self.expect = None;
    }

    /// Takes bytes that arrived at `now`, as many as there is room for, and returns how many.
    ///
    /// After polling until `None` there is room for at least one byte, so a loop of both takes everything.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.forget_taken();
        if self.len > 0 && self.is_quiet(now) {
            self.ended = self.len;
        }
        let count = bytes.len().min(CAPACITY - self.len);
        if count > 0 {
            self.bytes[self.len..self.len + count].copy_from_slice(&bytes[..count]);
            self.len += count;
            self.last = self.last.max(Some(now));
        }
        count
    }

    /// When to call [`poll`](Self::poll) next although no byte came; `None` while only bytes can change anything.
    ///
    /// Earlier is harmless. Later delays the frame, and risks joining it to the next one.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        match self.last {
            Some(_) if self.len == self.taken => None,
            Some(last) if self.awaits_its_end() => match self.run(self.pending(), 0) {
                Some(_) => Some(last + self.pause()),
                None => self.gives_up(),
            },
            Some(last) if self.lacks() == 0 => Some(last + self.silence),
            Some(_) => self.gives_up(),
            None => None,
        }
    }

    /// When the latest byte came.
    pub(crate) const fn last_byte(&self) -> Option<Instant> {
        self.last
    }

    /// When nothing more is expected to follow what came last, however it is delivered; `None` where that may take for ever.
    pub(crate) fn gives_up(&self) -> Option<Instant> {
        let (pause, least) = self.patience?;
        Some((self.last? + pause).max(least))
    }

    /// The next frame, or bytes that belong to none; `None` when there is nothing to say by `now`.
    ///
    /// # Errors
    ///
    /// [`Skipped`]: bytes that belong to no frame, and why.
    pub fn poll(&mut self, now: Instant) -> Option<Result<Frame<'_>, Skipped<'_>>> {
        Some(match self.step(now)? {
            Step::Frame(range) => Ok(self.frame(range)),
            Step::Skipped { range, error, .. } => Err(Skipped { bytes: &self.bytes[range], error }),
        })
    }

    /// Bytes that are held and not handed out yet.
    #[must_use]
    pub fn pending(&self) -> &[u8] {
        &self.bytes[self.taken..self.len]
    }

    /// Drops what is held and returns how many bytes that were.
    pub fn clear(&mut self) -> usize {
        let dropped = self.len - self.taken;
        self.len = 0;
        self.taken = 0;
        self.ended = 0;
        self.overrun = false;
        dropped
    }

    /// The frame that a step has found at `range`.
    pub(crate) fn frame(&self, range: Range<usize>) -> Frame<'_> {
        Frame::found(&self.bytes[range])
    }

    pub(crate) fn held(&self, range: Range<usize>) -> &[u8] {
        &self.bytes[range]
    }

    pub(crate) fn step(&mut self, now: Instant) -> Option<Step> {
        self.forget_taken();
        if self.len == 0 {
            return None;
        }
        let quiet = self.is_quiet(now);
        let is_over = quiet && self.gives_up().is_some_and(|moment| now >= moment);
        let mut error = None;
        let mut expected = false;
        let mut start = 0;
        let found = loop {
            if start == self.len {
                break None;
            }
            match self.look(start, now, (quiet, is_over)) {
                Look::Frame(len) => break Some(start..start + len),
                Look::Wait => break None,
                Look::Nothing(why) => {
                    expected |= why.is_some() && self.is_expected(start);
                    error = error.or(why);
                    start += 1;
                }
            }
        };
        let give_up = match &found {
            Some(frame) if frame.start == 0 => {
                self.take(frame.end);
                self.overrun = false;
                return Some(Step::Frame(frame.clone()));
            }
            // What came after an earlier silence may be a frame as a whole, of a function without a name.
            Some(frame) if self.expect.is_none() && (1..frame.start).contains(&self.ended) => self.ended,
            Some(frame) => {
                // What stands before the answer was not the answer, whatever it looked like.
                expected &= !self.is_expected(frame.start);
                frame.start
            }
            None if quiet => start,
            // What an earlier silence ended is decided, even while newer bytes are not.
            None if self.ended > 0 && start >= self.ended => self.ended,
            None if self.len == CAPACITY => start,
            None => 0,
        };
        if give_up == 0 {
            return None;
        }
        let range = 0..give_up;
        let error = error.or_else(|| Frame::parse(&self.bytes[range.clone()]).err());
        let error = error.unwrap_or(FrameError::TooShort { len: give_up });
        self.overrun = !quiet && found.is_none() && give_up > self.ended;
        self.take(give_up);
        Some(Step::Skipped { range, error, expected })
    }

    /// Hands out all that is held, frame or not.
    pub(crate) fn gives_up_rest(&mut self) -> Range<usize> {
        let range = self.taken..self.len;
        self.take(self.len);
        range
    }

    fn is_quiet(&self, now: Instant) -> bool {
        self.last.is_none_or(|last| now >= last + self.silence)
    }

    /// Whether nothing more will come of an answer that only silence ends, if it is whole.
    fn rests(&self, now: Instant) -> bool {
        self.is_late || self.last.is_none_or(|last| now >= last + self.pause())
    }

    /// For how long nothing comes after the end of an answer that only silence ends.
    fn pause(&self) -> Duration {
        self.patience.map_or(self.silence, |(pause, _)| pause)
    }

    fn take(&mut self, count: usize) {
        self.taken = count;
    }

    fn forget_taken(&mut self) {
        if self.taken > 0 {
            self.bytes.copy_within(self.taken..self.len, 0);
            self.len -= self.taken;
            self.ended = self.ended.saturating_sub(self.taken);
            self.taken = 0;
        }
    }
}

impl fmt::Debug for Framer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Framer")
            .field("pending", &self.pending())
            .field("silence", &self.silence)
            .field("expect", &self.expect)
            .finish_non_exhaustive()
    }
}

/// Bytes that belong to no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Skipped<'a> {
    /// The bytes.
    pub bytes: &'a [u8],
    /// Why they are no frame: the first thing in them that looked like one, or the whole of them.
    pub error: FrameError,
}

impl fmt::Display for Skipped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes skipped: {}", self.bytes.len(), self.error)
    }
}

impl core::error::Error for Skipped<'_> {}
