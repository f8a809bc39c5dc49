//! Hears a line that others use: finds the frames of both directions, and says of each who said it.
//!
//! Nothing on the wire says whether a frame is a request or an answer, and adapters hand bytes over in lumps, so that
//! silence is hardly seen. What can be seen without doubt is taken first: lengths, CRCs, and what can follow what. Time
//! decides last. Where two stories fit what was heard, the sniffer waits for the next frame; where they still do, it says
//! that it does not know.

mod asked;
mod role;
mod roles;
mod stories;

use core::fmt;
use core::ops::Range;
use core::time::Duration;

use crate::frame::{Frame, FrameError, MAX_ADU, MIN_ADU};
use crate::functions::{FrameLength, frame_len};
use crate::{Instant, SerialFormat, UnitAddress};

pub(crate) use asked::{can_ask, may_be_answer};
pub use role::Role;
use stories::{Behind, Next};

/// Four of the longest frames: what an adapter hands over at once, and what is looked at before and behind it.
const CAPACITY: usize = 4 * MAX_ADU;
/// Nothing more comes of a frame after a silence of so long: serial servers hand over what they collect within 62 ms.
const LUMP: Duration = Duration::from_millis(100);

/// Hears what others say on a line.
///
/// Three verbs: [`receive`](Self::receive) takes bytes, [`poll`](Self::poll) hands out what was heard in the order of the
/// wire, [`deadline`](Self::deadline) says when to poll again although no byte came. Each byte comes out once, in a frame
/// or as noise.
///
/// ```
/// use drivebus_rtu::{Instant, Role, SerialFormat, Sniffer};
///
/// let mut sniffer = Sniffer::new(&SerialFormat::DEFAULT);
/// let now = Instant::from_nanos(0);
/// sniffer.receive(now, &[0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
/// sniffer.receive(now, &[0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45]);
/// assert_eq!(sniffer.poll(now).map(|heard| (heard.role, heard.bytes.len())), Some((Role::Request, 8)));
/// assert_eq!(sniffer.poll(now).map(|heard| (heard.role, heard.bytes.len())), Some((Role::Answer, 7)));
/// assert_eq!(sniffer.poll(now), None);
/// ```
#[derive(Clone)]
pub struct Sniffer {
    bytes: [u8; CAPACITY],
    /// When each of them was handed over.
    came: [Instant; CAPACITY],
    len: usize,
    /// Bytes at the front that the last poll handed out.
    taken: usize,
    /// Whether a frame may begin at the front: nothing, a frame or a silence stands before it.
    fresh: bool,
    format: SerialFormat,
    /// After so long a silence nothing more comes of a frame.
    silence: Duration,
    /// When what was handed out last had ended.
    last: Option<Instant>,
    /// When it was polled last without anything to tell, and until when a frame waits for what follows it.
    polled: Option<Instant>,
    held: Option<Instant>,
    talk: roles::Talk,
}

/// What was heard: a frame, or bytes that are not one.
///
/// Moments are those at which bytes were handed over; the time that the characters of a frame take is counted back from its
/// last one. Behind an adapter that collects bytes they tell no more than that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Heard<'a> {
    /// All of it; of a frame, with address and CRC.
    pub bytes: &'a [u8],
    /// Who said it.
    pub role: Role,
    /// When its first character began.
    pub began: Instant,
    /// When its last character had come.
    pub ended: Instant,
    /// The time since the end of what was heard before; `None` of what is heard first.
    pub gap: Option<Duration>,
    /// The longest time between two of its characters that was not theirs.
    pub pause: Duration,
    /// How long its first character was kept back at least, by whatever hands over several at once. What is shorter than
    /// this, the moments do not tell.
    pub kept: Duration,
    /// Of an answer, the time since the end of its request.
    pub turnaround: Option<Duration>,
}

impl<'a> Heard<'a> {
    /// The frame; `None` for noise.
    pub fn frame(&self) -> Option<Frame<'a>> {
        match self.role {
            Role::Noise(_) => None,
            _ => Some(Frame::found(self.bytes)),
        }
    }
}

/// What stands at one place.
enum Look {
    Frame(usize),
    Wait,
    Nothing(Option<FrameError>),
}

/// What comes next on the wire.
enum Piece {
    Frame(Range<usize>),
    Noise(Range<usize>, FrameError),
}

impl Sniffer {
    /// An ear on a line of `format`.
    pub const fn new(format: &SerialFormat) -> Self {
        let silence = if format.t35().as_nanos() > LUMP.as_nanos() { format.t35() } else { LUMP };
        Self {
            bytes: [0; CAPACITY],
            came: [Instant::ZERO; CAPACITY],
            len: 0,
            taken: 0,
            fresh: true,
            format: *format,
            silence,
            last: None,
            polled: None,
            held: None,
            talk: roles::Talk::new(format.t35()),
        }
    }

    /// Takes bytes that were handed over at `now`, as many as there is room for, and returns how many.
    ///
    /// After polling until `None` there is room for at least one byte, so a loop of both takes everything.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.forget_taken();
        let now = self.latest().map_or(now, |latest| latest.max(now));
        let count = bytes.len().min(CAPACITY - self.len);
        let end = self.len + count;
        self.bytes[self.len..end].copy_from_slice(&bytes[..count]);
        self.came[self.len..end].fill(now);
        self.len = end;
        count
    }

    /// When to call [`poll`](Self::poll) next although no byte came; `None` while only bytes can change anything.
    ///
    /// Earlier is harmless. Later delays what is told, and changes nothing of it.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let latest = self.latest().filter(|_| self.len > self.taken)?;
        let moments = [Some(latest + self.silence), self.held];
        moments.into_iter().flatten().filter(|moment| Some(*moment) > self.polled).min()
    }

    /// What was heard next; `None` while that cannot be told by `now`.
    pub fn poll(&mut self, now: Instant) -> Option<Heard<'_>> {
        self.forget_taken();
        let Some((range, role)) = self.told(now) else {
            self.polled = self.polled.max(Some(now));
            return None;
        };
        let (began, ended) = self.span(&range);
        let turnaround = self.talk.heard(&self.bytes[range.clone()], role, began, ended);
        self.fresh = !matches!(role, Role::Noise(_)) || self.is_silence_behind(range.end, now);
        Some(self.hand_out(range, role, turnaround))
    }

    /// The next piece and who said it, as far as that can be told by `now`.
    fn told(&mut self, now: Instant) -> Option<(Range<usize>, Role)> {
        self.held = None;
        let range = match self.piece(0, self.fresh, now)? {
            Piece::Noise(range, error) => return Some((range, Role::Noise(error))),
            Piece::Frame(range) => range,
        };
        let (began, ended) = self.span(&range);
        match self.talk.role(&self.bytes[range.clone()], began, ended, &self.behind(range.end, now)) {
            Ok(role) => Some((range, role)),
            // Where there is no room for what follows, it is decided without it.
            Err(_) if self.len == CAPACITY => Some((range, Role::Doubtful)),
            Err(until) => {
                self.held = Some(until);
                None
            }
        }
    }

    /// Bytes that are held and not handed out yet.
    #[must_use]
    pub fn pending(&self) -> &[u8] {
        &self.bytes[self.taken..self.len]
    }

    fn hand_out(&mut self, range: Range<usize>, role: Role, turnaround: Option<Duration>) -> Heard<'_> {
        let (began, ended) = self.span(&range);
        let gap = self.last.map(|last| began.saturating_duration_since(last));
        self.last = Some(ended);
        let came = &self.came[range.clone()];
        let pause = came.windows(2).map(|pair| pair[1].saturating_duration_since(pair[0])).max().unwrap_or_default();
        self.taken = range.end;
        let pause = pause.saturating_sub(self.format.char_time());
        let characters = u32::try_from(came.len() - 1).unwrap_or(u32::MAX);
        let spread = came[came.len() - 1].saturating_duration_since(came[0]);
        let kept = pause.max(self.format.chars(characters).saturating_sub(spread));
        if !matches!(role, Role::Noise(_)) {
            self.talk.kept_back(kept);
        }
        Heard { bytes: &self.bytes[range], role, began, ended, gap, pause, kept, turnaround }
    }

    /// When the first character of `range` began and when the last one had come.
    fn span(&self, range: &Range<usize>) -> (Instant, Instant) {
        let ended = self.came[range.end - 1];
        let characters = u32::try_from(range.len()).unwrap_or(u32::MAX);
        let back = ended.saturating_duration_since(Instant::ZERO).saturating_sub(self.format.chars(characters));
        (self.came[range.start].min(Instant::ZERO + back), ended)
    }

    /// What follows at `start`, as far as it can be told.
    fn behind(&self, start: usize, now: Instant) -> Behind<'_> {
        let mut next = [Next::Unknown; 3];
        let mut start = start;
        for place in &mut next {
            let Some(piece) = self.piece(start, true, now) else { break };
            let (Piece::Frame(range) | Piece::Noise(range, _)) = &piece;
            let (bytes, (began, _)) = (&self.bytes[range.clone()], self.span(range));
            start = range.end;
            *place = match piece {
                Piece::Frame(_) => Next::Frame { bytes, began },
                Piece::Noise(..) => Next::Noise { bytes, began },
            };
        }
        Behind { next, now }
    }

    /// The frame or noise at `start`, where a frame may begin if `fresh`; `None` while it cannot be told.
    fn piece(&self, start: usize, fresh: bool, now: Instant) -> Option<Piece> {
        let mut error = None;
        let mut at = start;
        while at < self.len {
            let may_begin = if at == start { fresh } else { self.is_silence_before(at) };
            match self.look(at, may_begin, now) {
                Look::Frame(len) if at == start => return Some(Piece::Frame(at..at + len)),
                Look::Wait if at - start < MAX_ADU => return None,
                // So much noise is told although more of it may follow: there must be room for what does.
                Look::Frame(_) | Look::Wait => break,
                Look::Nothing(why) => error = error.or(why),
            }
            at += 1;
            // What a silence has ended is handed out by itself.
            if self.is_silence_before(at) {
                break;
            }
        }
        let is_told = at > start && (at < self.len || self.is_over(now) || self.len - start > MAX_ADU);
        is_told.then(|| {
            let bytes = &self.bytes[start..at];
            let error = error.or_else(|| Frame::parse(bytes).err());
            Piece::Noise(start..at, error.unwrap_or(FrameError::TooShort { len: bytes.len() }))
        })
    }

    /// What stands at `start`. `fresh`: a frame may begin there, whatever its function.
    fn look(&self, start: usize, fresh: bool, now: Instant) -> Look {
        let here = &self.bytes[start..self.len];
        if here[0] > UnitAddress::MAX.get() {
            return Look::Nothing(None);
        }
        let is_over = self.is_over(now) || self.is_silent_within(start);
        // What is asked for comes first: the bytes of a longer answer may look like a request.
        let expected = self.talk.expects(here);
        let (mut error, mut wait) = (None, false);
        for length in [expected, FrameLength::of_request(here), FrameLength::of_answer(here)] {
            match length {
                FrameLength::Is(len) => match here.get(..len).map(Frame::parse) {
                    Some(Ok(_)) => return Look::Frame(len),
                    Some(Err(why)) => error = error.or(Some(why)),
                    None if !is_over && length == expected => return Look::Wait,
                    None => wait = true,
                },
                FrameLength::Later => wait = true,
                FrameLength::Unknown if fresh => match self.by_search(start, is_over) {
                    Look::Frame(len) => return Look::Frame(len),
                    Look::Wait => wait = true,
                    Look::Nothing(why) => error = error.or(why),
                },
                FrameLength::Unknown | FrameLength::Never | FrameLength::TooLong => {}
            }
        }
        if wait && !is_over { Look::Wait } else { Look::Nothing(error) }
    }

    /// A frame at `start` whose length nothing tells: the shortest that ends where a silence, its answer or another frame
    /// begins.
    fn by_search(&self, start: usize, is_over: bool) -> Look {
        let here = &self.bytes[start..self.len];
        let most = here.len().min(MAX_ADU);
        for len in MIN_ADU..=most {
            if Frame::parse(&here[..len]).is_err() {
                continue;
            }
            let end = start + len;
            let is_answered = self.bytes[end..self.len].starts_with(&here[..2]);
            if (end == self.len && is_over) || self.is_silence_before(end) || is_answered || self.begins_a_frame(end) {
                return Look::Frame(len);
            }
        }
        if is_over || here.len() > MAX_ADU { Look::Nothing(None) } else { Look::Wait }
    }

    /// Whether a whole frame of a function that tells its length stands at `start`.
    fn begins_a_frame(&self, start: usize) -> bool {
        frame_len(&self.bytes[start..self.len]).is_some()
    }

    fn latest(&self) -> Option<Instant> {
        self.len.checked_sub(1).map(|last| self.came[last]).max(self.last)
    }

    /// Whether nothing more comes of what has begun.
    fn is_over(&self, now: Instant) -> bool {
        self.latest().is_none_or(|latest| now >= latest + self.silence)
    }

    /// Whether a silence ended what stands before `at`.
    fn is_silence_before(&self, at: usize) -> bool {
        at > 0 && at < self.len && self.came[at].saturating_duration_since(self.came[at - 1]) >= self.silence
    }

    fn is_silent_within(&self, start: usize) -> bool {
        (start + 1..self.len).any(|at| self.is_silence_before(at))
    }

    fn is_silence_behind(&self, end: usize, now: Instant) -> bool {
        if end == self.len { self.is_over(now) } else { self.is_silence_before(end) }
    }

    fn forget_taken(&mut self) {
        if self.taken > 0 {
            self.bytes.copy_within(self.taken..self.len, 0);
            self.came.copy_within(self.taken..self.len, 0);
            self.len -= self.taken;
            self.taken = 0;
        }
    }
}

impl fmt::Debug for Sniffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sniffer").field("pending", &self.pending()).field("talk", &self.talk).finish_non_exhaustive()
    }
}
