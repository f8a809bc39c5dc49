//! Finds frames in a stream of bytes: length first, silence as fallback.
//!
//! Whoever knows what a frame must look like need not wait for silence to know that it is whole. So a frame comes
//! out at its last byte; silence decides only what no length can: where an unknown function ends, and when a broken
//! start will not be completed. Noise before and after a frame is skipped and handed out, never swallowed.
//!
//! How bytes are cut by the operating system changes nothing: the same bytes at the same moments give the same
//! frames.

use core::fmt;
use core::ops::Range;
use core::time::Duration;

use crate::answer::Expected;
use crate::frame::{Adu, Frame, FrameError, MAX_ADU, MIN_ADU};
use crate::request::function::{DIAGNOSTICS, EXCEPTION_BIT, READ_HOLDING, WRITE_MULTIPLE, WRITE_SINGLE};
use crate::{Instant, UnitAddress};

/// Twice the longest frame: one that is being received, and whatever came before it.
const CAPACITY: usize = 2 * MAX_ADU;
const HIGHEST_UNIT: u8 = UnitAddress::MAX.get();
/// Address, function code, exception code or byte count, CRC.
const EXCEPTION_ADU: usize = 5;
/// Address, function code, two words, CRC.
const SHORT_ADU: usize = 8;

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
    expect: Option<(UnitAddress, Expected)>,
    /// The request whose answer is looked for: an adapter may send it back to us.
    own: Adu,
    /// Bytes were given up for want of room, so that the front is no longer the start of a frame.
    overrun: bool,
}

/// What may stand at one place of the stream.
enum Look {
    Frame(usize),
    Wait,
    Nothing(Option<FrameError>),
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
            own: Adu::new(),
            overrun: false,
        }
    }

    /// From now on hunts for the answer of `unit` to what `expected` was made from; what is held is dropped.
    ///
    /// Then silence no longer breaks that answer: a USB adapter may deliver it in lumps with pauses between.
    pub fn expect(&mut self, unit: UnitAddress, expected: Expected) {
        self.clear();
        self.expect = Some((unit, expected));
        self.own = Adu::new();
    }

    /// After [`expect`](Self::expect): `own`, the request, may come back before its answer.
    pub(crate) fn expect_own(&mut self, own: &Adu) {
        self.own = *own;
    }

    /// The request has come back, or will not any more.
    pub(crate) fn forget_own(&mut self) {
        self.own = Adu::new();
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
            Some(last) if self.len > self.taken && self.lacks() == 0 => Some(last + self.silence),
            _ => None,
        }
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
        let mut error = None;
        let mut expected = false;
        let mut start = 0;
        let found = loop {
            if start == self.len {
                break None;
            }
            match self.look(start, quiet) {
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

    /// What stands at `start`. `quiet`: no more bytes will come.
    fn look(&self, start: usize, quiet: bool) -> Look {
        let expected = self.is_expected(start);
        // An expected answer may come in lumps; anything else ends where the line fell silent.
        let cut = start < self.ended && !expected;
        let end = if cut { self.ended } else { self.len };
        let closed = cut || quiet;
        let here = &self.bytes[start..end];
        let fresh = start == 0 && !self.overrun;

        if expected && let Some(look) = self.look_for_own(here) {
            return look;
        }
        let mut error = None;
        let mut incomplete = false;
        for len in self.lengths(here, expected, fresh).into_iter().flatten() {
            match here.get(..len).map(Frame::parse) {
                Some(Ok(_)) => return Look::Frame(len),
                Some(Err(why)) => error = error.or(Some(why)),
                None => incomplete = true,
            }
        }
        let by_silence = if expected { self.answer_len().is_none() } else { fresh };
        if closed && by_silence && (MIN_ADU..=MAX_ADU).contains(&here.len()) {
            match Frame::parse(here) {
                Ok(_) => return Look::Frame(here.len()),
                Err(why) => error = error.or(Some(why)),
            }
        }
        let patient = expected && self.is_beginning_of_answer(here);
        if patient || (incomplete && !closed) { Look::Wait } else { Look::Nothing(error) }
    }

    /// Whether `here` is our own request, sent back to us.
    ///
    /// Told by its bytes, not by its length: eight bytes of a longer answer have a right CRC by chance, once in 65 536.
    /// Like an answer it may come in lumps.
    fn look_for_own(&self, here: &[u8]) -> Option<Look> {
        let own = self.own.as_bytes();
        if own.is_empty() {
            None
        } else if here.starts_with(own) {
            Some(Look::Frame(own.len()))
        } else if own.starts_with(here) {
            Some(Look::Wait)
        } else {
            None
        }
    }

    /// Lengths that a frame beginning with `here` can have, shortest first. One that is longer than what is there
    /// means: wait.
    fn lengths(&self, here: &[u8], expected: bool, fresh: bool) -> [Option<usize>; 3] {
        let [first, second] = if expected { Self::answer_lengths(here) } else { self.known_lengths(here) };
        // The longest frame is whole only when nothing follows it.
        let more = Some(here.len() + 1).filter(|_| here.len() <= MAX_ADU);
        let asked = match *here {
            [_, function, ..] if expected && function & EXCEPTION_BIT == 0 => self.answer_len().or(more),
            // Only silence can tell where an unknown function ends, and a master that did not ask for it does not
            // care.
            [..=HIGHEST_UNIT, 1..EXCEPTION_BIT, ..] if fresh && self.expect.is_none() && first.is_none() => more,
            _ => None,
        };
        let mut lengths = [first, second, asked];
        lengths.sort_unstable();
        lengths
    }

    /// Length that the answer looked for has by its own account.
    fn answer_lengths(here: &[u8]) -> [Option<usize>; 2] {
        let len = match *here {
            [_, READ_HOLDING, bytes, ..] => EXCEPTION_ADU + usize::from(bytes),
            [_] | [_, READ_HOLDING] => here.len() + 1,
            [_, WRITE_SINGLE | DIAGNOSTICS | WRITE_MULTIPLE, ..] => SHORT_ADU,
            [_, function, ..] if function & EXCEPTION_BIT != 0 => EXCEPTION_ADU,
            _ => return [None, None],
        };
        [Some(len).filter(|&len| len <= MAX_ADU), None]
    }

    /// Lengths that a frame of either direction can have whose function is known.
    fn known_lengths(&self, here: &[u8]) -> [Option<usize>; 2] {
        let more = Some(here.len() + 1);
        let lowest = u8::from(self.expect.is_some());
        match *here {
            [address, ..] if !(lowest..=HIGHEST_UNIT).contains(&address) => [None, None],
            [_] | [_, READ_HOLDING] => [more, None],
            // A request has 8 bytes; an answer begins with its byte count.
            [_, READ_HOLDING, bytes @ 2..=250, ..] if bytes % 2 == 0 => {
                [Some(SHORT_ADU), Some(EXCEPTION_ADU + usize::from(bytes))]
            }
            // An answer has 8 bytes; a request has its byte count after address and count.
            [_, WRITE_MULTIPLE, _, _, _, _, bytes @ 2..=246, ..] if bytes % 2 == 0 => {
                [Some(SHORT_ADU), Some(SHORT_ADU + 1 + usize::from(bytes))]
            }
            [_, READ_HOLDING | WRITE_SINGLE | DIAGNOSTICS | WRITE_MULTIPLE, ..] => [Some(SHORT_ADU), None],
            [_, function, ..] if function > EXCEPTION_BIT => [Some(EXCEPTION_ADU), None],
            _ => [None, None],
        }
    }

    /// How long the answer looked for is; `None` where only silence tells, or none is looked for.
    fn answer_len(&self) -> Option<usize> {
        self.expect?.1.adu_len()
    }

    /// Whether `here`, which begins as the answer looked for, only lacks its end.
    fn is_beginning_of_answer(&self, here: &[u8]) -> bool {
        match *here {
            [_, function, ..] if function & EXCEPTION_BIT != 0 => here.len() < EXCEPTION_ADU,
            // Another number of words than asked for: no use waiting for the rest of it.
            [_, READ_HOLDING, bytes, ..] if self.answer_len() != Some(EXCEPTION_ADU + usize::from(bytes)) => false,
            _ => self.answer_len().is_some_and(|len| here.len() < len),
        }
    }

    /// Whether the answer that is waited for may begin at `start`.
    fn is_expected(&self, start: usize) -> bool {
        match (self.expect, &self.bytes[start..self.len]) {
            (Some((unit, _)), [address]) => *address == unit.get(),
            (Some((unit, expected)), [address, function, ..]) => {
                *address == unit.get() && function & !EXCEPTION_BIT == expected.function()
            }
            _ => false,
        }
    }

    /// How many bytes the answer looked for, or our own request before it, lacks at least; 0 where nothing of it is
    /// there, or where silence would tell more.
    pub(crate) fn lacks(&self) -> usize {
        let here = self.pending();
        if !self.is_expected(self.taken) {
            return 0;
        }
        let own = self.own.as_bytes();
        let own = own.starts_with(here).then_some(own.len());
        let answer = self.is_beginning_of_answer(here).then(|| match *here {
            // It may be a refusal.
            [_] => EXCEPTION_ADU,
            [_, function, ..] if function & EXCEPTION_BIT != 0 => EXCEPTION_ADU,
            _ => self.answer_len().unwrap_or_default(),
        });
        own.into_iter().chain(answer).min().map_or(0, |len| len.saturating_sub(here.len()))
    }

    fn is_quiet(&self, now: Instant) -> bool {
        self.last.is_none_or(|last| now >= last + self.silence)
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
