//! What goes over the wire, frame by frame, for whoever watches it.
//!
//! A line that nobody watches is used as it is. One that somebody watches is used through [`Watched`], which looks at what
//! it carries and changes nothing of it.

mod ear;

use std::fmt;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use drivebus_rtu::{Frame, Instant, function};

use crate::line::{Line, LineClock, PortError};

pub(crate) use ear::Ear;
pub use ear::Overheard;

/// After how long a silence the bytes that came are shown although they are no frame. An adapter hands over what it collects
/// within 16 ms.
const QUIET: Duration = Duration::from_millis(20);

/// Which way a frame went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From this master to the units.
    Sent,
    /// From a unit, another master, an adapter that echoes, or the noise of the line.
    Heard,
}

/// A frame that went over the wire, or bytes that are not a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Traced {
    /// When it was handed to the line, or its first bytes were handed over by it. On the line's clock.
    pub at: Instant,
    /// The time since the end of what went before, of an answer that another program had, since its request was sent;
    /// `None` where nothing went before.
    pub gap: Option<Duration>,
    /// Which way it went.
    pub direction: Direction,
    /// All of it, the CRC included.
    pub bytes: Vec<u8>,
    /// Whether another program of this computer has the port: what was asked of it and what came of that, without what it
    /// repeated or asked on its own.
    pub elsewhere: bool,
}

impl fmt::Display for Traced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.at.saturating_duration_since(Instant::ZERO).as_secs_f64();
        let gap = self.gap.map_or_else(String::new, |gap| format!("+{:.3} ms", gap.as_secs_f64() * 1e3));
        let arrow = match self.direction {
            Direction::Sent => "->",
            Direction::Heard => "<-",
        };
        write!(f, "{at:.6} {gap:>13} {arrow}")?;
        self.bytes.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

/// Who watches: called for each frame, in the thread that uses the line and while it does.
pub type Watch = Arc<dyn Fn(Traced) + Send + Sync>;

/// Who watches a bus now, and who overhears it; all who use its line share it.
#[derive(Clone, Default)]
pub(crate) struct Trace(Arc<Watchers>);

#[derive(Default)]
struct Watchers {
    watch: Mutex<Option<Watch>>,
    ears: Mutex<Vec<Weak<Ear>>>,
    /// The latest moment that the line told, in nanoseconds of its clock.
    latest: AtomicU64,
}

impl fmt::Debug for Trace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Trace").field("watched", &self.watch().is_some()).finish()
    }
}

impl Trace {
    pub(crate) fn set(&self, watch: Option<Watch>) {
        *self.0.watch.lock().unwrap_or_else(PoisonError::into_inner) = watch;
    }

    pub(crate) fn watch(&self) -> Option<Watch> {
        self.0.watch.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The line has come to `moment`.
    pub(crate) fn has_come_to(&self, moment: Instant) {
        self.0.latest.fetch_max(moment.as_nanos(), Ordering::Relaxed);
    }

    /// The latest moment that it is known to have come to: for who watches, while nobody can ask the line.
    pub(crate) fn latest(&self) -> Instant {
        Instant::from_nanos(self.0.latest.load(Ordering::Relaxed))
    }

    /// An ear that has all that goes over the line for as long as it is kept.
    pub(crate) fn ear(&self) -> Arc<Ear> {
        let ear = Arc::new(Ear::default());
        self.0.ears.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::downgrade(&ear));
        ear
    }

    fn tell_ears(&self, at: Instant, direction: Direction, bytes: &[u8]) {
        let mut ears = self.0.ears.lock().unwrap_or_else(PoisonError::into_inner);
        ears.retain(|ear| match ear.upgrade() {
            Some(ear) => {
                ear.put(Overheard { at, direction, bytes: bytes.to_vec() });
                true
            }
            None => false,
        });
    }
}

/// A line whose frames are shown.
#[derive(Debug)]
pub(crate) struct Watched {
    line: Box<dyn Line>,
    trace: Trace,
    /// The end of what was shown last.
    last: Option<Instant>,
    /// What came and was not shown yet, and when its first and its latest bytes came.
    gathered: Vec<u8>,
    begun: Instant,
    latest: Instant,
}

impl Watched {
    pub(crate) fn new(line: Box<dyn Line>, trace: Trace) -> Self {
        Self { line, trace, last: None, gathered: Vec::new(), begun: Instant::ZERO, latest: Instant::ZERO }
    }

    fn show(&mut self, at: Instant, end: Instant, direction: Direction, bytes: &[u8]) {
        let gap = self.last.map(|last| at.saturating_duration_since(last));
        self.last = Some(end);
        if let Some(watch) = self.trace.watch() {
            self.trace.has_come_to(self.line.now());
            watch(Traced { at, gap, direction, bytes: bytes.to_vec(), elsewhere: false });
        }
    }

    fn heard(&mut self, now: Instant, bytes: &[u8]) {
        if self.is_quiet(now) {
            self.show_gathered();
        }
        if self.gathered.is_empty() {
            self.begun = now;
        }
        self.gathered.extend_from_slice(bytes);
        self.latest = now;
        if answer_len(&self.gathered) == Some(self.gathered.len()) && Frame::parse(&self.gathered).is_ok() {
            self.show_gathered();
        }
    }

    /// `frame` came by other means than bytes of the line.
    fn came_beside(&mut self, frame: &[u8]) {
        let now = self.line.now();
        self.trace.tell_ears(now, Direction::Heard, frame);
        self.show(now, now, Direction::Heard, frame);
    }

    fn is_quiet(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.latest) >= QUIET.max(self.line.latency())
    }

    fn show_gathered(&mut self) {
        let gathered = std::mem::take(&mut self.gathered);
        let (begun, latest) = (self.begun, self.latest);
        for piece in Pieces(&gathered) {
            self.show(begun, latest, Direction::Heard, piece);
        }
    }
}

impl Line for Watched {
    fn now(&self) -> Instant {
        self.line.now()
    }

    fn make_ready(&mut self) -> Result<(), PortError> {
        self.line.make_ready()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        self.show_gathered();
        let at = self.line.now();
        let end = self.line.send(bytes)?;
        self.trace.tell_ears(end, Direction::Sent, bytes);
        self.show(at, end, Direction::Sent, bytes);
        Ok(end)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let count = self.line.receive(buffer, until)?;
        let now = self.line.now();
        if count > 0 {
            self.trace.tell_ears(now, Direction::Heard, &buffer[..count]);
            self.heard(now, &buffer[..count]);
        } else if self.is_quiet(now) {
            self.show_gathered();
        }
        Ok(count)
    }

    fn sleep(&mut self, until: Instant) {
        self.line.sleep(until);
    }

    fn char_time(&self) -> Option<Duration> {
        self.line.char_time()
    }

    fn name(&self) -> String {
        self.line.name()
    }

    fn gapless(&self) -> bool {
        self.line.gapless()
    }

    fn take_late(&mut self) -> Option<Vec<u8>> {
        self.line.take_late().inspect(|late| self.came_beside(late))
    }

    fn take_strange(&mut self) -> Option<Vec<u8>> {
        self.line.take_strange().inspect(|strange| self.came_beside(strange))
    }

    fn is_virtual(&self) -> bool {
        self.line.is_virtual()
    }

    fn clock(&self) -> Option<LineClock> {
        self.line.clock()
    }

    fn may_have_others(&self) -> bool {
        self.line.may_have_others()
    }

    fn chance(&self) -> Option<u64> {
        self.line.chance()
    }

    fn may_echo(&self) -> bool {
        self.line.may_echo()
    }

    fn latency(&self) -> Duration {
        self.line.latency()
    }

    fn connected_to(&self) -> Option<SocketAddr> {
        self.line.connected_to()
    }

    fn set_again(&mut self) -> Option<String> {
        self.line.set_again()
    }

    fn notes(&self) -> Vec<String> {
        self.line.notes()
    }
}

impl Drop for Watched {
    /// What came last is shown, too.
    fn drop(&mut self) {
        self.show_gathered();
    }
}

/// The frames in what came, and what lies between them.
struct Pieces<'a>(&'a [u8]);

impl<'a> Iterator for Pieces<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let bytes = self.0;
        if bytes.is_empty() {
            return None;
        }
        let found = (0..bytes.len()).find_map(|start| frame_len(&bytes[start..]).map(|len| (start, len)));
        let len = match found {
            Some((0, len)) => len,
            Some((start, _)) => start,
            None => bytes.len(),
        };
        let (piece, rest) = bytes.split_at(len);
        self.0 = rest;
        Some(piece)
    }
}

/// How long the frame is with which `bytes` begin, if they do.
fn frame_len(bytes: &[u8]) -> Option<usize> {
    let is_frame = |len: &usize| bytes.get(..*len).is_some_and(|frame| Frame::parse(frame).is_ok());
    let many = bytes.get(6).filter(|_| bytes[1] == function::WRITE_MULTIPLE).map(|count| 9 + usize::from(*count));
    [answer_len(bytes), many, Some(8), Some(bytes.len())].into_iter().flatten().find(is_frame)
}

/// How long the answer is that begins so, as its own bytes tell.
fn answer_len(bytes: &[u8]) -> Option<usize> {
    let code = *bytes.get(1)?;
    match code {
        _ if code & function::EXCEPTION_BIT != 0 => Some(5),
        0x01..=0x04 => bytes.get(2).map(|count| 5 + usize::from(*count)),
        _ => Some(8),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    const REQUEST: [u8; 8] = [0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36];
    const ANSWER: [u8; 7] = [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45];

    /// A line that brings pieces at their moments, in milliseconds.
    #[derive(Debug, Default)]
    struct Script {
        now: Instant,
        pieces: VecDeque<(u64, Vec<u8>)>,
    }

    impl Line for Script {
        fn now(&self) -> Instant {
            self.now
        }

        fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
            Ok(self.now + Duration::from_millis(5))
        }

        fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
            let at = |moment| Instant::ZERO + Duration::from_millis(moment);
            let is_due = self.pieces.front().is_some_and(|(moment, _)| at(*moment) <= until);
            let Some((_, bytes)) = is_due.then(|| self.pieces.pop_front()).flatten() else {
                self.now = self.now.max(until);
                return Ok(0);
            };
            buffer[..bytes.len()].copy_from_slice(&bytes);
            Ok(bytes.len())
        }

        fn sleep(&mut self, until: Instant) {
            self.now = self.now.max(until);
        }

        fn name(&self) -> String {
            "script".to_owned()
        }
    }

    /// What is shown of one request and of `pieces` behind it, received until 100 ms: direction and bytes.
    fn shown(pieces: &[(u64, &[u8])]) -> Vec<(Direction, Vec<u8>)> {
        let (trace, seen) = (Trace::default(), Arc::new(Mutex::new(Vec::new())));
        let keep = Arc::clone(&seen);
        trace.set(Some(Arc::new(move |traced: Traced| keep.lock().unwrap().push((traced.direction, traced.bytes)))));
        let pieces = pieces.iter().map(|(moment, bytes)| (*moment, bytes.to_vec())).collect();
        let mut line = Watched::new(Box::new(Script { pieces, ..Script::default() }), trace);
        line.send(&REQUEST).unwrap();
        let mut buffer = [0; 256];
        for moment in 0..100 {
            let until = Instant::ZERO + Duration::from_millis(moment);
            while line.receive(&mut buffer, until).unwrap() > 0 {}
        }
        drop(line);
        let seen = seen.lock().unwrap().clone();
        assert_eq!(seen[0], (Direction::Sent, REQUEST.to_vec()));
        seen[1..].to_vec()
    }

    fn heard(pieces: &[&[u8]]) -> Vec<(Direction, Vec<u8>)> {
        pieces.iter().map(|bytes| (Direction::Heard, bytes.to_vec())).collect()
    }

    #[test]
    fn a_frame_is_shown_whole_however_it_comes() {
        assert_eq!(shown(&[(6, &ANSWER)]), heard(&[&ANSWER]));
        assert_eq!(shown(&[(6, &ANSWER[..2]), (7, &ANSWER[2..6]), (20, &ANSWER[6..])]), heard(&[&ANSWER]));
    }

    #[test]
    fn what_lies_beside_a_frame_is_shown_by_itself() {
        let (mut noisy, mut echoed) = (vec![0x00, 0xFF], REQUEST.to_vec());
        noisy.extend(ANSWER);
        echoed.extend(ANSWER);
        assert_eq!(shown(&[(6, &noisy)]), heard(&[&[0x00, 0xFF], &ANSWER]));
        assert_eq!(shown(&[(6, &echoed)]), heard(&[&REQUEST, &ANSWER]));
    }

    #[test]
    fn what_is_not_a_frame_is_shown_after_a_silence() {
        let damaged = [0x01, 0x03, 0x02, 0x00, 0x07, 0xF8, 0x45];
        assert_eq!(shown(&[(6, &damaged[..6])]), heard(&[&damaged[..6]]));
        assert_eq!(shown(&[(6, &damaged), (50, &ANSWER)]), heard(&[&damaged, &ANSWER]));
    }

    #[test]
    fn a_frame_reads_as_time_gap_direction_and_bytes() {
        let at = Instant::ZERO + Duration::from_micros(1_500_250);
        let gap = Some(Duration::from_micros(3_912));
        let traced = Traced { at, gap, direction: Direction::Heard, bytes: vec![0x01, 0x83], elsewhere: false };
        assert_eq!(traced.to_string(), "1.500250     +3.912 ms <- 01 83");
    }
}
