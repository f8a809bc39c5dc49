//! One request and what becomes of it, on an open line.
//!
//! Drives the state machine of `drivebus-rtu` with a real line: bytes, the clock, and the wish to give up.

use std::time::Duration;

use drivebus_rtu::{Adu, Answer, Destination, Event, ExceptionCode, Instant, Master, Request};

use crate::Line;
use crate::error::{CallError, Failure};
use crate::queue::LOOK_UP;

/// How long before an answer can be whole it is waited for again, in characters and on top of them: the first bytes may
/// have been handed over so much after they came. A receiver hands over what fills its FIFO, a machine wakes up late.
const EARLY: (u32, Duration) = (2, Duration::from_micros(150));

/// One request on its way.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ask<'a> {
    pub(crate) destination: Destination,
    pub(crate) request: &'a Request<'a>,
    /// How long to wait after the request: for the answer, or for the units to act on a broadcast.
    pub(crate) timeout: Duration,
    /// Whether a read waits no longer than its unit's answers have taught.
    pub(crate) learns: bool,
    /// The least silence before it, if that is more than every request keeps.
    pub(crate) gap: Duration,
    /// Whether it goes out at once, even to a unit that may still answer something else.
    pub(crate) in_doubt: bool,
}

/// When an exchange happened, on the line's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Done {
    /// The first bit of the request.
    pub sent: Instant,
    /// The last byte of the answer.
    pub ended: Instant,
}

impl Ask<'_> {
    /// The whole request frame.
    pub(crate) fn frame(&self) -> Vec<u8> {
        Adu::request(self.destination, self.request).as_bytes().to_vec()
    }

    /// The error of this request; `sent` and `ended` are moments of the line's clock, `raw` is what came.
    pub(crate) fn failed(&self, failure: Failure, sent: Option<Instant>, ended: Instant, raw: &[u8]) -> Box<CallError> {
        let (destination, request, raw) = (self.destination, self.frame(), raw.to_vec());
        Box::new(CallError { failure, destination, request, raw, sent, ended })
    }
}

/// Sends one request over `line` and gives its answer to `take`.
pub(crate) fn exchange(
    line: &mut dyn Line,
    master: &mut Master,
    ask: &Ask<'_>,
    give_up: &mut dyn FnMut() -> bool,
    take: &mut dyn FnMut(Answer<'_>),
) -> Result<Done, Box<CallError>> {
    let mut sent = None;
    let mut now = line.now();
    let mut looked_up = now;
    master.keep_gap(ask.gap);
    let begin = if ask.in_doubt { Master::begin_in_doubt } else { Master::begin };
    begin(master, now, ask.destination, ask.request, ask.timeout)
        .map_err(|error| ask.failed(Failure::NotBegun(error), sent, now, &[]))?;

    let mut pace = line.char_time().map(Pace::new);
    let mut buffer = [0; 256];
    // What is queued already is no answer, and the line was not silent while it came: read without waiting.
    let mut until = now;
    loop {
        let received = line.receive(&mut buffer, until);
        now = line.now();
        let mut rest = match received {
            Ok(count) => &buffer[..count],
            Err(error) => {
                master.abort(now);
                return Err(ask.failed(Failure::Port(error), sent, now, &[]));
            }
        };
        let came = rest.len();
        loop {
            // Whatever there is no room for now, there is after polling.
            rest = &rest[master.receive(now, rest)..];
            match master.poll(now) {
                Some(Event::Transmit(frame)) => {
                    sent = Some(now);
                    match line.send(frame) {
                        Ok(end) => master.sent(end),
                        Err(error) => {
                            master.abort(now);
                            return Err(ask.failed(Failure::Port(error), sent, line.now(), &[]));
                        }
                    }
                }
                Some(event) => return conclude(ask, event, sent, now, take),
                None if rest.is_empty() => break,
                None => {}
            }
        }
        if now.saturating_duration_since(looked_up) >= LOOK_UP {
            looked_up = now;
            if give_up() {
                master.abort(now);
                return Err(ask.failed(Failure::Interrupted, sent, now, &[]));
            }
        }
        let wake = now + LOOK_UP;
        until = master.deadline().map_or(wake, |deadline| deadline.min(wake));
        if let Some(nearly) = pace.as_mut().and_then(|pace| pace.nearly_whole(now, came, master.lacks())) {
            line.sleep(nearly.min(until));
            // What has come by then is taken without waiting for more.
            until = now;
        }
    }
}

/// Bytes that come one by one, so that nobody need wake up for each.
#[derive(Debug)]
struct Pace {
    char_time: Duration,
    /// How many have come.
    count: u32,
    /// When the first of them began, at the latest.
    begun: Instant,
}

impl Pace {
    const fn new(char_time: Duration) -> Self {
        Self { char_time, count: 0, begun: Instant::from_nanos(u64::MAX) }
    }

    /// Takes down that at `now` there were `came` bytes more. If more than a few are still lacking: the moment from which on
    /// the last of them are worth waking up for.
    fn nearly_whole(&mut self, now: Instant, came: usize, lacks: usize) -> Option<Instant> {
        let (came, lacks) = (u32::try_from(came).unwrap_or(u32::MAX), u32::try_from(lacks).unwrap_or(u32::MAX));
        if came == 0 {
            return None; // nothing new: they come in lumps, and the next is waited for
        }
        self.count = self.count.saturating_add(came);
        let begun = now.saturating_duration_since(Instant::ZERO + self.char_time * self.count);
        self.begun = self.begun.min(Instant::ZERO + begun);
        let (chars, time) = EARLY;
        let all = self.char_time * self.count.saturating_add(lacks).saturating_sub(chars);
        (lacks > chars).then(|| self.begun + all.saturating_sub(time))
    }
}

/// What `event`, which ends the request, means to its caller.
fn conclude(
    ask: &Ask<'_>,
    event: Event<'_>,
    sent: Option<Instant>,
    ended: Instant,
    take: &mut dyn FnMut(Answer<'_>),
) -> Result<Done, Box<CallError>> {
    let timeout = ask.timeout;
    let (failure, raw) = match (event, sent) {
        (Event::Answer(answer @ Answer::Exception { function, code, .. }), _) => {
            // An exception is known by its two bytes: the frame that came is the one that is made here.
            let came = match ask.destination {
                Destination::Unit(unit) => Some(Adu::answer(unit, &answer)),
                Destination::Broadcast => None,
            };
            let raw = came.as_ref().map_or(&[][..], Adu::as_bytes);
            let failure = match code {
                ExceptionCode::GATEWAY_TARGET_SILENT => Failure::Unreached,
                _ => Failure::Refused { function, code },
            };
            return Err(ask.failed(failure, sent, ended, raw));
        }
        (Event::Answer(answer), Some(sent)) => {
            take(answer);
            return Ok(Done { sent, ended });
        }
        (Event::BroadcastDone, Some(sent)) => return Ok(Done { sent, ended }),
        (Event::Wrong { error, frame }, _) => (Failure::Wrong(error), frame),
        (Event::Corrupt { error, bytes }, _) => (Failure::Corrupt(error), bytes),
        (Event::NoAnswer { bytes }, _) => (Failure::NoAnswer { timeout, attempts: 1 }, bytes),
        (Event::Busy, _) => (Failure::Busy { timeout }, &[][..]),
        // The master says neither of a request that it did not hand out.
        (Event::Transmit(_) | Event::Answer(_) | Event::BroadcastDone, _) => {
            (Failure::NoAnswer { timeout, attempts: 1 }, &[][..])
        }
    };
    Err(ask.failed(failure, sent, ended, raw))
}
