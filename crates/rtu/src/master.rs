//! One request at a time: keep silence, send, wait, judge.
//!
//! The rule of this file: **an answer is accepted only if it can only belong to the request in flight.** RTU has no
//! transaction number, so after a time-out the answer may still come and look like the answer to a later request, and on
//! a line that was just opened so may the answer to another program's. Such a unit is in *quarantine*: it is sent only
//! what no answer still to come could be mistaken for, an echo (08H/0000) of a fresh word or a read of another length.
//! How a quarantine ends, and under which assumption, stands in `doubt.rs`.

mod beside;
mod judge;
mod overheard;
mod remnant;
mod torn;

use core::time::Duration;

use crate::bytes::Bytes;
use crate::doubt::{Attribution, Doubts};
use crate::event::{BeginError, Event, Tally};
use crate::expected::Expected;
use crate::frame::{Adu, Frame};
use crate::framer::Framer;
use crate::others::Others;
use crate::request::Request;
use crate::{Destination, Instant, SerialFormat, UnitAddress};

use beside::Beside;
use torn::Torn;

/// The turnaround delay after a broadcast that the specification suggests: units need time to act.
///
/// Source: *Modbus over Serial Line* V1.02, §2.4.1 (100 ms to 200 ms).
pub const TURNAROUND: Duration = Duration::from_millis(100);

/// So many characters a receiver may collect before it hands them over: 8 and 14 are usual of the 16 that it has room for.
const COLLECTED: u32 = 16;

/// How long is listened on for an answer of which something has come, and not the right thing.
///
/// Who has the clock learns both from answers that became whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Patience {
    /// So long after the last byte: no pause inside an answer is longer, as adapters and gateways hand it over in lumps.
    pub pause: Duration,
    /// But so long after the request at least, which is when the unit has usually begun to answer: what came before may
    /// have been noise that looked like an answer.
    pub usual: Duration,
}

impl Patience {
    /// So long after the last byte, and so long after the request at least.
    pub const fn new(pause: Duration, usual: Duration) -> Self {
        Self { pause, usual }
    }
}

/// A master with at most one request in flight.
///
/// The caller's loop: [`begin`](Self::begin); then [`poll`](Self::poll) until it returns an outcome, waiting for
/// bytes or for [`deadline`](Self::deadline) whenever it returns `None`. [`Event::Transmit`] hands out the bytes to
/// send; [`sent`](Self::sent) says when the last of them will have left the wire.
#[derive(Debug, Clone)]
pub struct Master {
    silence: Duration,
    /// How long a character takes at the most.
    char_time: Duration,
    /// The least silence before the next request, if that is more.
    gap: Duration,
    patience: Option<Patience>,
    framer: Framer,
    state: State,
    request: Adu,
    /// The adapter is known to send every request back.
    strips_echo: bool,
    /// The adapter is known to send none back.
    never_echoes: bool,
    /// It has yet to send back the one in flight.
    echo_due: bool,
    /// What came beside the answer that is waited for.
    beside: Beside,
    /// What came in its place, to be told.
    instead: Bytes,
    /// When nothing more follows it, where that is known.
    ends_at: Option<Instant>,
    torn: Torn,
    /// When the line was last busy, as far as is known.
    busy: Option<Instant>,
    doubts: Doubts,
    others: Others,
    tally: Tally,
}

#[derive(Debug, Clone, Copy)]
enum State {
    Idle,
    /// Waiting for the silence before the request.
    Quiet {
        job: Job,
        give_up: Instant,
    },
    /// The caller sends.
    Sending {
        job: Job,
    },
    Waiting {
        unit: UnitAddress,
        expected: Expected,
        timeout: Duration,
        until: Instant,
    },
    /// After a broadcast: the units act.
    Turnaround {
        until: Instant,
    },
}

#[derive(Debug, Clone, Copy)]
struct Job {
    destination: Destination,
    expected: Expected,
    timeout: Duration,
}

impl Master {
    /// A master on a line of `format` that nobody else has asked anything on; otherwise call [`opened`](Self::opened).
    pub const fn new(format: &SerialFormat) -> Self {
        Self { char_time: format.chars(1), ..Self::with_silence(format.t35()) }
    }

    /// A master that keeps a silence of its own; zero where frames are delimited by other means.
    pub const fn with_silence(silence: Duration) -> Self {
        Self {
            silence,
            // Of a line whose format is not known nobody can tell what follows at once.
            char_time: Duration::MAX,
            gap: Duration::ZERO,
            patience: None,
            framer: Framer::new(silence),
            state: State::Idle,
            request: Adu::new(),
            strips_echo: false,
            never_echoes: false,
            echo_due: false,
            beside: Beside::NOTHING,
            instead: Bytes::NONE,
            ends_at: None,
            torn: Torn::NONE,
            busy: None,
            doubts: Doubts::NONE,
            others: Others::NONE,
            tally: Tally::EMPTY,
        }
    }

    /// Begins `request`. It goes out when the line was silent for 3.5 characters since the last byte seen or sent,
    /// and is given up when that takes longer than `timeout`.
    ///
    /// For one unit, `timeout` is the longest wait from the end of the request to the end of the answer; for a
    /// broadcast it is the turnaround delay ([`TURNAROUND`]).
    ///
    /// # Errors
    ///
    /// [`BeginError`]: nothing is sent.
    pub fn begin(
        &mut self,
        now: Instant,
        destination: Destination,
        request: &Request<'_>,
        timeout: Duration,
    ) -> Result<(), BeginError> {
        match destination {
            Destination::Unit(unit)
                if self.in_quarantine(now, unit) && !self.doubts.tells_apart(now, unit, request.expected()) =>
            {
                Err(BeginError::Quarantine { unit })
            }
            _ => self.begin_in_doubt(now, destination, request, timeout),
        }
    }

    /// As [`begin`](Self::begin), quarantine or not: for a stop, which has to go out whatever else is in doubt.
    ///
    /// In quarantine its answer may be a late one to the very same request, sent before; the quarantine goes on.
    ///
    /// # Errors
    ///
    /// [`BeginError`]: nothing is sent.
    pub fn begin_in_doubt(
        &mut self,
        now: Instant,
        destination: Destination,
        request: &Request<'_>,
        timeout: Duration,
    ) -> Result<(), BeginError> {
        if !matches!(self.state, State::Idle) {
            return Err(BeginError::OutOfTurn);
        }
        if destination == Destination::Broadcast && !request.is_write() {
            return Err(BeginError::BroadcastRead);
        }
        if self.others.may_be() {
            self.framer.listen();
        } else {
            self.framer.expect_anything();
        }
        self.request.set_request(destination, request);
        // Nothing is known of a line that was never watched: it may be busy now.
        self.busy.get_or_insert(now);
        let job = Job { destination, expected: request.expected(), timeout };
        self.state = State::Quiet { job, give_up: now + self.quiet_time() + timeout };
        Ok(())
    }

    /// From the next request on keeps the line silent for at least `gap` before each, where that is more than the
    /// silence between frames: some units need longer until they listen again.
    pub const fn keep_gap(&mut self, gap: Duration) {
        self.gap = gap;
    }

    /// From the next request on listens on while something may still follow what came, though it was not the answer.
    ///
    /// An answer that broke off is then [`Event::Corrupt`] when `patience` is over, and not when the time is. After one that
    /// was damaged, or could not be right, the right one is taken if it comes by then. Without patience, as at first, what
    /// is damaged ends its request at once, and what broke off only with the time.
    pub const fn be_patient(&mut self, patience: Option<Patience>) {
        self.patience = patience;
    }

    /// Says that the bytes of [`Event::Transmit`] are on their way and that the last will have left at `end`.
    ///
    /// Out of turn, changes nothing.
    pub fn sent(&mut self, end: Instant) {
        let State::Sending { job } = self.state else {
            return;
        };
        self.busy = self.busy.max(Some(end));
        let until = end + job.timeout;
        self.state = match job.destination {
            Destination::Unit(unit) => {
                if let Some(Patience { pause, usual }) = self.patience {
                    let collected = match job.expected.adu_len() {
                        None if self.char_time < Duration::MAX => self.char_time.saturating_mul(COLLECTED),
                        _ => Duration::ZERO,
                    };
                    let pause = pause.max(collected);
                    self.framer.wait_for_the_rest(pause, end + usual);
                }
                State::Waiting { unit, expected: job.expected, timeout: job.timeout, until }
            }
            Destination::Broadcast => State::Turnaround { until },
        };
    }

    /// Takes bytes that arrived at `now`, as many as there is room for, and returns how many.
    ///
    /// After polling until `None` there is room for at least one byte.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) -> usize {
        if !bytes.is_empty() {
            self.busy = self.busy.max(Some(now));
        }
        self.framer.receive(now, bytes)
    }

    /// When to call [`poll`](Self::poll) next although no byte came; `None` while only bytes can change anything.
    ///
    /// Earlier is harmless. Later delays what comes next.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => self.framer.deadline(),
            State::Sending { .. } => None,
            State::Quiet { give_up, .. } => Some(self.silent_at().min(give_up)),
            State::Waiting { until, .. } => {
                let until = self.listens_until(until);
                Some(self.framer.deadline().map_or(until, |silent| silent.min(until)))
            }
            State::Turnaround { until } => Some(until),
        }
    }

    /// How many bytes an answer that has begun lacks at least; 0 while none has, or only silence tells its end.
    ///
    /// Whoever knows how long a character takes need not look before they can have come.
    #[must_use]
    pub fn lacks(&self) -> usize {
        if matches!(self.state, State::Waiting { .. }) { self.framer.lacks() } else { 0 }
    }

    /// Whether an answer has begun that only silence ends.
    #[must_use]
    pub fn awaits_its_end(&self) -> bool {
        matches!(self.state, State::Waiting { .. }) && self.framer.awaits_its_end()
    }

    /// What has happened by `now`; `None` when there is nothing to say.
    pub fn poll(&mut self, now: Instant) -> Option<Event<'_>> {
        match self.state {
            State::Idle | State::Sending { .. } => {
                self.count_strays(now);
                None
            }
            State::Quiet { job, give_up } => {
                self.count_strays(now);
                if now >= self.silent_at() {
                    self.framer.expect_anything();
                    if let Destination::Unit(unit) = job.destination {
                        self.framer.expect(unit, job.expected);
                        if self.strips_echo || !job.expected.may_repeat_request() {
                            self.framer.expect_own(&self.request);
                        }
                    }
                    self.echo_due = self.strips_echo;
                    self.doubts.goes_out();
                    self.others.goes_out();
                    self.beside.clear();
                    self.instead.clear();
                    self.ends_at = None;
                    self.state = State::Sending { job };
                    Some(Event::Transmit(self.request.as_bytes()))
                } else if now >= give_up {
                    self.state = State::Idle;
                    Some(Event::Busy)
                } else {
                    None
                }
            }
            State::Turnaround { until } => {
                self.count_strays(now);
                (now >= until).then(|| {
                    self.state = State::Idle;
                    Event::BroadcastDone
                })
            }
            State::Waiting { unit, expected, timeout, until } => self.await_answer(now, unit, expected, timeout, until),
        }
    }

    /// The request that was begun last, as it goes on the wire.
    pub(crate) fn frame(&self) -> &[u8] {
        self.request.as_bytes()
    }

    /// Gives the request up at `now`. Returns whether the unit may have received it; then it is in quarantine.
    pub fn abort(&mut self, now: Instant) -> bool {
        let sent = match self.state {
            State::Idle | State::Quiet { .. } => false,
            State::Sending { job } => {
                if let Destination::Unit(unit) = job.destination {
                    self.doubts.left_open(now, unit, job.expected, job.timeout);
                }
                true
            }
            State::Waiting { unit, expected, timeout, .. } => {
                self.tally.add_noise(self.beside.noise(true));
                self.doubts.left_open(now, unit, expected, timeout);
                true
            }
            State::Turnaround { .. } => true,
        };
        self.state = State::Idle;
        sent
    }

    /// Says that the line was opened at `now`, for the first time or again: another program may have asked any unit,
    /// so all are in quarantine for [`FIRST_CONTACT`](crate::FIRST_CONTACT) or until they have returned an echo.
    ///
    /// A request in flight is given up, and what units owed before they still owe.
    pub fn opened(&mut self, now: Instant) {
        self.abort(now);
        self.framer.expect_anything();
        self.busy = self.busy.max(Some(now));
        self.doubts.opened(now);
        self.torn.forget();
    }

    /// Says that what was taken for the answer of `unit` to `request` may have been none, so that it is still owed. It was
    /// waited for for `timeout`.
    pub fn still_owed(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>, timeout: Duration) {
        self.doubts.left_open(now, unit, request.expected(), timeout);
    }

    /// Takes back what [`still_owed`](Self::still_owed) said of `request` and all like it: by `now` `unit` has shown that it
    /// owes none of them.
    pub fn owed_no_more(&mut self, now: Instant, unit: UnitAddress, request: &Request<'_>) {
        self.doubts.owes_no(now, unit, request.expected());
    }

    /// Says that `frame` came by `now`, and is known by other means than its bytes to answer a request before the one in flight.
    /// What it answers is owed no more. Bytes that are no frame change nothing.
    pub fn saw_late(&mut self, now: Instant, frame: &[u8]) {
        if let Ok(frame) = Frame::parse(frame) {
            self.doubts.seen(now, &frame, Duration::ZERO);
        }
    }

    /// Whether `unit` may still answer something else than what it is asked next, so that only an echo is sent to it, or
    /// a read whose answer cannot be mistaken.
    pub fn in_quarantine(&self, now: Instant, unit: UnitAddress) -> bool {
        self.doubts.contains(now, unit)
    }

    /// Whether an echo from before may still come back from `unit`. It could be mistaken for nothing but another echo of
    /// the same word.
    pub fn may_owe_an_echo(&self, now: Instant, unit: UnitAddress) -> bool {
        self.doubts.may_owe_an_echo(now, unit)
    }

    /// When whatever is doubted of `unit`, which returns no echo, is over by itself; `None` where nothing is.
    pub(crate) fn doubt_ends(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        self.doubts.ends(now, unit)
    }

    /// When the quarantine of first contact with `unit` ends by itself; `None` where it is over, or was none.
    pub fn first_contact_ends(&self, now: Instant, unit: UnitAddress) -> Option<Instant> {
        self.doubts.first_contact_ends(now, unit)
    }

    /// Whether the answer of `unit` to `request`, asked at `now`, could not be mistaken for any that it may still give:
    /// then it ends a quarantine.
    pub fn tells_apart(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> bool {
        let expected = request.expected();
        self.doubts.tells_apart(now, unit, expected) && self.others.ask(now, unit, expected).is_none()
    }

    /// How sure the answer to `request` can be that `unit` is asked at `now`. Certain while nothing that it owes could
    /// overtake.
    pub fn attribution(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Attribution {
        let expected = request.expected();
        if let Some(until) = self.others.ask(now, unit, expected) {
            return Attribution::Others(until);
        }
        self.doubts.attribution(now, unit, expected)
    }

    /// When nothing can come any more, as far as is known at `now`, that could pass for the answer of `unit` to `request`.
    pub(crate) fn rivals_end(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> Option<Instant> {
        self.doubts.rivals_end(now, unit, request.expected())
    }

    /// Until when it is worth to wait whether what `unit` owes is seen, before it is asked `request`, if not `otherwise`;
    /// `None` where nothing is soon to come.
    pub(crate) fn worth_watching(
        &self,
        now: Instant,
        unit: UnitAddress,
        request: &Request<'_>,
        timeout: Duration,
        otherwise: bool,
    ) -> Option<Instant> {
        self.doubts.worth_watching(now, unit, request.expected(), timeout, otherwise)
    }

    /// Whether an answer of `unit` that came damaged may come again, whole, and pass for that to `request`.
    pub(crate) fn may_come_whole(&self, now: Instant, unit: UnitAddress, request: &Request<'_>) -> bool {
        self.doubts.may_come_whole(now, unit, request.expected())
    }

    /// Whether the adapter sends every request back, so that it is to be taken off before the answer.
    pub const fn strip_echo(&mut self, strip: bool) {
        self.strips_echo = strip;
    }

    /// Whether the adapter is known to send no request back, so that one that comes back was said by the unit.
    pub(crate) const fn never_echoes(&mut self, never: bool) {
        self.never_echoes = never;
    }

    /// What came since the latest request went out and was not its answer: bytes that are no frame, and whole frames of others
    /// or of another function. Not what is known to be late, or another master's.
    #[must_use]
    pub fn instead(&self) -> &[u8] {
        self.instead.as_slice()
    }

    /// What was seen beside answers since the last call.
    pub const fn take_tally(&mut self) -> Tally {
        core::mem::replace(&mut self.tally, Tally::EMPTY)
    }

    fn silent_at(&self) -> Instant {
        self.busy.map_or(Instant::ZERO, |busy| busy + self.quiet_time())
    }

    fn quiet_time(&self) -> Duration {
        self.silence.max(self.gap)
    }
}
