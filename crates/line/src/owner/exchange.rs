//! One request and what becomes of it, on an open line.
//!
//! Drives the state machine of `drivebus-rtu` with a real line: bytes, the clock, and the wish to give up.

use std::time::Duration;

use drivebus_rtu::{Adu, Answer, AnswerError, Destination, Event, ExceptionCode, Instant, Master};

use crate::ask::{Ask, Done};
use crate::error::{CallError, Failure};
use crate::line::Line;
use crate::owner::arrival_pauses::{Arrivals, Ended, Lumps};
use crate::system::clock::LOOK_UP;
use crate::turns::queue::Stops;

/// How long before an answer can be whole it is waited for again, in characters and on top of them: the first bytes may
/// have been handed over so much after they came. A receiver hands over what fills its FIFO, a machine wakes up late.
const EARLY: (u32, Duration) = (2, Duration::from_micros(150));

/// How long a unit that was silent the last time is waited for while a stop waits for the line. A unit answers within
/// some ten milliseconds; what it says later than this may meet the stop on the wire.
const STOP_WAITS: Duration = Duration::from_millis(100);

/// Sends one request over `line` and gives its answer to `take`. `usual`: how long the unit takes at most until it begins to
/// answer, where that is known; `lumps`: how answers come over this line.
pub(crate) fn exchange(
    line: &mut dyn Line,
    master: &mut Master,
    ask: &Ask<'_>,
    (usual, lumps): (Option<Duration>, &mut Lumps),
    give_up: &mut dyn FnMut() -> bool,
    take: &mut dyn FnMut(Answer<'_>),
) -> Result<Done, Box<CallError>> {
    master.be_patient(lumps.patience(usual));
    let mut arrivals = Arrivals::new();
    let result = follow(line, master, ask, &mut arrivals, give_up, take);
    let ended = match &result {
        Ok(_) => Ended::Whole,
        Err(error) if matches!(error.failure, Failure::Corrupt(_)) => Ended::Damaged { bytes: error.raw.len() },
        Err(_) => Ended::Otherwise,
    };
    lumps.learn(&arrivals, ask.request.expected().adu_len(), ended);
    result
}

/// Sends the request, and waits for what becomes of it.
fn follow(
    line: &mut dyn Line,
    master: &mut Master,
    ask: &Ask<'_>,
    arrivals: &mut Arrivals,
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
    // The end of the request.
    let mut out = None;
    // What is queued already is no answer, and the line was not silent while it came. Who waits for the silence finds it at
    // once; where it was silent for long enough, it is looked for without waiting.
    let mut until = master.deadline().map_or(now, |silent| silent.min(now + LOOK_UP));
    // The end of the time-out, when the request is out; whether nobody was looking since the last bytes came.
    let (mut limit, mut slept) = (now, false);
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
        if came > 0 {
            arrivals.came(now, came, || !slept && master.lacks() > 0);
        }
        slept = false;
        loop {
            // Whatever there is no room for now, there is after polling.
            rest = &rest[master.receive(now, rest)..];
            match master.poll(now) {
                Some(Event::Transmit(frame)) => {
                    sent = Some(now);
                    match line.send(frame) {
                        Ok(end) => {
                            out = Some(end);
                            master.sent(end);
                            limit = end + ask.timeout;
                        }
                        Err(error) => {
                            master.abort(now);
                            return Err(ask.failed(Failure::Port(error), sent, line.now(), &[]));
                        }
                    }
                }
                Some(event) => {
                    return conclude(ask, event, sent, now, take).map_err(|error| unless_given_up(error, give_up));
                }
                None if rest.is_empty() => break,
                None => {}
            }
        }
        if now.saturating_duration_since(looked_up) >= LOOK_UP {
            looked_up = now;
            let quiet = out.map_or(Duration::ZERO, |out| now.saturating_duration_since(arrivals.last().max(out)));
            if let Some(failure) = ends_early(ask, quiet, give_up) {
                master.abort(now);
                return Err(ask.failed(failure, sent, now, &[]));
            }
        }
        let wake = now + LOOK_UP;
        until = master.deadline().map_or(wake, |deadline| deadline.min(wake));
        if let Some(nearly) = pace.as_mut().and_then(|pace| pace.nearly_whole(now, came, master.lacks())) {
            line.sleep(nearly.min(limit).min(wake));
            slept = true;
            // What has come by then is taken without waiting for more.
            until = now;
        }
    }
}

/// Why the wait ends before its time, if it does: its caller gave up, or a stop waits and it was `quiet` for so long.
#[cold]
fn ends_early(ask: &Ask<'_>, quiet: Duration, give_up: &mut dyn FnMut() -> bool) -> Option<Failure> {
    if give_up() {
        return Some(Failure::Interrupted);
    }
    let gives_way = quiet >= STOP_WAITS && ask.yields.is_some_and(Stops::has_stop);
    gives_way.then_some(Failure::NoAnswer { timeout: quiet, attempts: 1 })
}

/// Asks `give_up` where no answer came: time-outs may be shorter than the time between two looks, and retries many.
fn unless_given_up(mut error: Box<CallError>, give_up: &mut dyn FnMut() -> bool) -> Box<CallError> {
    if !matches!(error.failure, Failure::Refused { .. }) && give_up() {
        error.failure = Failure::Interrupted;
    }
    error
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
        (Event::Wrong { error: AnswerError::Others, frame }, _) => (Failure::OthersAsk, frame),
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

#[cfg(test)]
mod tests {
    use std::thread;

    use drivebus_rtu::{Request, SerialFormat, UnitAddress};

    use super::*;
    use crate::line::PortError;
    use crate::turns::order::Priority;
    use crate::turns::queue::Waiter;

    /// A queue in which no work is left.
    type Queue = crate::turns::queue::Queue<()>;

    /// A line on which nobody answers, or somebody says a byte now and then. Time passes only while it is waited on.
    #[derive(Debug, Default)]
    struct Silent {
        now: Instant,
        noise: Option<Duration>,
        sent: bool,
    }

    impl Line for Silent {
        fn now(&self) -> Instant {
            self.now
        }

        fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
            self.sent = true;
            Ok(self.now)
        }

        fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
            let before = self.now;
            self.now = self.now.max(until);
            match self.noise {
                Some(each) if self.sent && before + each <= until => {
                    (self.now, buffer[0]) = (before + each, 0x55);
                    Ok(1)
                }
                _ => Ok(0),
            }
        }

        fn sleep(&mut self, until: Instant) {
            self.now = self.now.max(until);
        }

        fn name(&self) -> String {
            "silent".to_owned()
        }
    }

    fn read(line: &mut Silent, timeout: u64, yields: Option<&Queue>, give_up: &mut dyn FnMut() -> bool) -> Failure {
        let request = Request::read(0x2100, 1).unwrap();
        let ask = Ask {
            destination: UnitAddress::new(9).unwrap().into(),
            request: &request,
            timeout: Duration::from_millis(timeout),
            learns: false,
            gap: Duration::ZERO,
            in_doubt: true,
            yields: yields.map(|queue| queue as &dyn Stops),
            meanings: None,
        };
        let mut master = Master::new(&SerialFormat::DEFAULT);
        let known = (None, &mut Lumps::of(line));
        exchange(line, &mut master, &ask, known, give_up, &mut |_| ()).unwrap_err().failure
    }

    fn queue_with(priority: Priority) -> Queue {
        let queue = Queue::default();
        let mut state = queue.lock();
        let ticket = state.order.ticket((priority, None).into());
        state.order.wait(ticket, Waiter::Thread(thread::current()));
        drop(state);
        queue
    }

    fn waited(failure: &Failure) -> Duration {
        match failure {
            Failure::NoAnswer { timeout, .. } => *timeout,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_stop_that_waits_waits_no_longer_for_a_silent_unit_than_that_might_take() {
        let cut_short = waited(&read(&mut Silent::default(), 2_000, Some(&queue_with(Priority::Stop)), &mut || false));
        assert!((STOP_WAITS..STOP_WAITS + LOOK_UP).contains(&cut_short), "{cut_short:?}");
    }

    #[test]
    fn nothing_else_cuts_a_wait_short() {
        for yields in [None, Some(&queue_with(Priority::Write)), Some(&Queue::default())] {
            let failure = read(&mut Silent::default(), 2_000, yields, &mut || false);
            assert_eq!(waited(&failure), Duration::from_secs(2));
        }
    }

    #[test]
    fn what_still_comes_is_waited_for() {
        let mut line = Silent { noise: Some(Duration::from_millis(40)), ..Silent::default() };
        read(&mut line, 2_000, Some(&queue_with(Priority::Stop)), &mut || false);
        assert!(line.now >= Instant::ZERO + Duration::from_secs(2), "{:?}", line.now);
    }

    #[test]
    fn who_gives_up_is_heard_after_the_shortest_time_out() {
        let mut asked = 0;
        let mut give_up = || {
            asked += 1;
            true
        };
        assert_eq!(read(&mut Silent::default(), 5, None, &mut give_up), Failure::Interrupted);
        assert_eq!(asked, 1);
    }
}
