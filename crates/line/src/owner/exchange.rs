//! Carries a conversation out on an open line: bytes, the clock, and the wish to give up.

use std::ops::Range;
use std::time::Duration;

use drivebus_rtu::{Answer, BeginError, Conversation, Cut, Exchange, Instant, Outcome, Step, Unanswered};

use crate::ask::{Ask, Done};
use crate::error::{CallError, Failure};
use crate::line::{Line, PortError, PortErrorKind};
use crate::owner::Owner;
use crate::owner::arrival_pauses::{Arrivals, Ended};
use crate::system::clock::LOOK_UP;
use crate::turns::queue::Stops;

/// How long before an answer can be whole it is waited for again, in characters and on top of them: the first bytes may
/// have been handed over so much after they came. A receiver hands over what fills its FIFO, a machine wakes up late.
const EARLY: (u32, Duration) = (2, Duration::from_micros(150));

/// How long a unit that was silent the last time is waited for while a stop waits for the line. A unit answers within
/// some ten milliseconds; what it says later than this may meet the stop on the wire.
const STOP_WAITS: Duration = Duration::from_millis(100);

/// What comes next for a call that does not use the line now.
pub(crate) enum Then {
    /// Whoever is more urgent may use it first.
    LetPass,
    /// Others may use it until then.
    StandBy(Instant),
    /// It is over.
    Done(Result<Done, Box<CallError>>),
}

/// A call on this line, and why it was cut short, if it was.
pub(crate) struct Talk<'a, 'r> {
    pub(crate) call: Conversation<'r>,
    pub(crate) ask: &'a Ask<'r>,
    /// Whether somebody still waits for it.
    is_wanted: &'a dyn Fn() -> bool,
    /// Why it was cut short the last time, and the one before.
    cuts: [Option<Failure>; 2],
    /// What came during its latest request and is known to answer nothing that was asked.
    pub(crate) strange: Vec<u8>,
    /// What another program had changed at the port, and was set again behind one of its requests.
    set_again: Option<String>,
}

impl<'a, 'r> Talk<'a, 'r> {
    pub(crate) fn new(call: Conversation<'r>, ask: &'a Ask<'r>, is_wanted: &'a dyn Fn() -> bool) -> Self {
        Self { call, ask, is_wanted, cuts: [None, None], strange: Vec::new(), set_again: None }
    }

    /// It is cut short at `now` by `failure`. A port that failed is opened again by who asks next.
    pub(crate) fn cut_short(&mut self, owner: &mut Owner, now: Instant, failure: Failure) {
        if matches!(failure, Failure::Port(_)) {
            owner.close();
        }
        let cut = match &failure {
            Failure::Port(PortError { kind: PortErrorKind::Lost, .. }) => Cut::Lost,
            Failure::Port(_) => Cut::Unusable,
            _ => Cut::GivenUp,
        };
        self.cuts = [Some(failure), self.cuts[0].take()];
        self.call.cut_short(now, &mut owner.known, cut);
    }

    /// What it came to; its answer goes to `take`.
    fn result(
        cuts: &mut [Option<Failure>; 2],
        strange: &[u8],
        set_again: &mut Option<String>,
        ask: &Ask<'_>,
        outcome: Outcome<'_>,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        match outcome {
            Outcome::Answered { times, answer, .. } => {
                if let Some(answer) = answer {
                    take(answer);
                }
                Ok(Done { sent: times.sent, ended: times.ended })
            }
            Outcome::Failed { why, sent, ended, raw, shows, before, .. } => {
                let cut = cuts[usize::from(before)].take();
                let shows = shows.map(|words| words.iter().collect()).unwrap_or_default();
                let failure = Failure::of(why, shows, cut);
                let raw = match failure {
                    Failure::NoAnswer { .. } if raw.is_empty() => strange,
                    _ => raw,
                };
                let error = ask.failed(failure, sent, ended, raw);
                Err(Box::new(CallError { set_again: set_again.take(), ..*error }))
            }
            // An outcome that this line does not know.
            _ => Err(ask.failed(Failure::Interrupted, None, None, &[])),
        }
    }
}

/// What is known of the request on the wire by who carries it out.
struct Carried {
    arrivals: Arrivals,
    pace: Option<Pace>,
    /// The end of the request.
    out: Option<Instant>,
    /// The end of the time-out, when the request is out; whether nobody was looking since the last bytes came.
    limit: Instant,
    slept: bool,
    looked_up: Instant,
    /// How many bytes came the last time.
    came: usize,
}

impl Carried {
    fn new(line: &dyn Line, now: Instant) -> Self {
        let pace = line.char_time().map(Pace::new);
        Self { arrivals: Arrivals::new(), pace, out: None, limit: now, slept: false, looked_up: now, came: 0 }
    }

    /// For how long nothing came by `now`.
    fn quiet(&self, now: Instant) -> Duration {
        self.out.map_or(Duration::ZERO, |out| now.saturating_duration_since(self.arrivals.last().max(out)))
    }

    /// Until when to wait for bytes, where something changes at `deadline` and the answer `lacks` so many; sleeps as long as
    /// they cannot have come.
    fn wait(&mut self, line: &mut dyn Line, now: Instant, deadline: Instant, lacks: usize) -> Instant {
        let wake = now + LOOK_UP;
        let nearly = self.pace.as_mut().and_then(|pace| pace.nearly_whole(now, self.came, lacks));
        let Some(nearly) = nearly else { return deadline.min(wake) };
        line.sleep(nearly.min(self.limit).min(wake));
        self.slept = true;
        // What has come by then is taken without waiting for more.
        now
    }
}

/// What came over the line and was not taken yet.
struct Inbox {
    buffer: [u8; 256],
    rest: Range<usize>,
}

impl Owner {
    /// Carries `talk` out until it leaves the line to others, or is over. `now`: on the line's clock.
    pub(crate) fn go_on(
        &mut self,
        talk: &mut Talk<'_, '_>,
        now: Instant,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Then {
        let then = self.carry_out(talk, now, give_up, take);
        self.count(talk.ask, talk.call.take_counts());
        self.count_strays();
        then
    }

    fn carry_out(
        &mut self,
        talk: &mut Talk<'_, '_>,
        now: Instant,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Then {
        let mut now = now;
        let mut carried: Option<Carried> = None;
        let mut inbox = Inbox { buffer: [0; 256], rest: 0..0 };
        self.prepare_next(talk);
        loop {
            match talk.call.next(now, &mut self.known) {
                Step::LetPass => return Then::LetPass,
                Step::StandBy(until) => return Then::StandBy(until),
                Step::Done(outcome) => {
                    let (cuts, set_again) = (&mut talk.cuts, &mut talk.set_again);
                    return Then::Done(Talk::result(cuts, &talk.strange, set_again, talk.ask, outcome, take));
                }
                Step::Send(frame) => {
                    let sent = match self.line.as_deref_mut() {
                        Some(line) => line.send(frame).map_err(|error| (line.now(), Failure::Port(error))),
                        None => Err((now, Failure::Closed)),
                    };
                    match sent {
                        Ok(end) => {
                            let limit = talk.call.sent(&mut self.known, end).unwrap_or(end);
                            if let Some(carried) = &mut carried {
                                (carried.out, carried.limit) = (Some(end), limit);
                            }
                        }
                        Err((at, failure)) => {
                            now = at;
                            talk.cut_short(self, now, failure);
                        }
                    }
                }
                Step::Listen(deadline) => {
                    if inbox.rest.is_empty()
                        && let Err(failure) = self.listen(talk, &mut carried, &mut inbox, (&mut now, deadline), give_up)
                    {
                        talk.cut_short(self, now, failure);
                        continue;
                    }
                    // Whatever there is no room for, there is after polling.
                    let bytes = &inbox.buffer[inbox.rest.clone()];
                    let taken = talk.call.heard(now, &mut self.known, bytes).unwrap_or(bytes.len());
                    inbox.rest.start += taken;
                }
                Step::Heard(exchange) => {
                    inbox.rest = 0..0;
                    let arrivals = carried.take().map_or_else(Arrivals::new, |carried| carried.arrivals);
                    self.lumps.learn(&arrivals, exchange.request.expected().adu_len(), ended(&exchange));
                    self.is_over(talk, now, &exchange, give_up);
                }
                // A step that this line does not know.
                _ => talk.cut_short(self, now, Failure::NotBegun(BeginError::OutOfTurn)),
            }
        }
    }

    /// Waits for bytes, where something changes at `deadline`, and has the time told.
    fn listen(
        &mut self,
        talk: &mut Talk<'_, '_>,
        carried: &mut Option<Carried>,
        inbox: &mut Inbox,
        (now, deadline): (&mut Instant, Instant),
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Failure> {
        let yields = self.yields(talk.ask);
        let Some(line) = self.line.as_deref_mut() else { return Err(Failure::Closed) };
        let mut until = deadline;
        if talk.call.is_in_flight() {
            let carried = carried.get_or_insert_with(|| Carried::new(line, *now));
            if now.saturating_duration_since(carried.looked_up) >= LOOK_UP {
                carried.looked_up = *now;
                if give_up() {
                    return Err(Failure::Interrupted);
                }
                let quiet = carried.quiet(*now);
                if quiet >= STOP_WAITS && yields.is_some_and(Stops::has_stop) {
                    talk.call.give_way(*now, &mut self.known, quiet);
                    return Ok(());
                }
            }
            until = carried.wait(line, *now, deadline, self.known.master().lacks());
        }
        let received = line.receive(&mut inbox.buffer, until);
        *now = line.now();
        let count = received.map_err(Failure::Port)?;
        inbox.rest = 0..count;
        if let Some(carried) = carried {
            if count > 0 {
                let (master, slept) = (self.known.master(), carried.slept);
                carried.arrivals.came(*now, count, || !slept && (master.lacks() > 0 || master.awaits_its_end()));
            }
            (carried.slept, carried.came) = (false, count);
        }
        Ok(())
    }

    /// A request of `talk` is over at `now`: keeps what it came to, and asks whether anybody still waits.
    fn is_over(
        &mut self,
        talk: &mut Talk<'_, '_>,
        now: Instant,
        exchange: &Exchange<'_>,
        give_up: &mut dyn FnMut() -> bool,
    ) {
        self.take_late(&mut talk.strange);
        let failure = exchange.failure.map(|why| Failure::of(why, Vec::new(), talk.cuts[0].clone()));
        if failure.as_ref().is_some_and(Failure::may_be_the_ports) {
            self.set_port_again(talk);
        }
        // Time-outs may be shorter than the time between two looks, and retries many.
        if failure.as_ref().is_some_and(may_be_given_up) && give_up() {
            self.keep(talk, exchange, Some(&Failure::Interrupted));
            talk.cut_short(self, now, Failure::Interrupted);
        } else {
            self.keep(talk, exchange, failure.as_ref());
        }
        talk.call.is_wanted((talk.is_wanted)());
        self.prepare_next(talk);
    }
}

impl Owner {
    /// Nothing came, or nothing right: another program may have changed the settings of the port.
    #[cold]
    fn set_port_again(&mut self, talk: &mut Talk<'_, '_>) {
        if let Some(told) = self.line.as_deref_mut().and_then(Line::set_again) {
            self.stats().settings_changed += 1;
            talk.set_again = Some(told);
        }
    }
}

/// How `exchange` ended, for who learns how answers come.
fn ended(exchange: &Exchange<'_>) -> Ended {
    match exchange.failure {
        None => Ended::Whole,
        Some(Unanswered::Corrupt(_)) => Ended::Damaged { bytes: exchange.bytes },
        Some(_) => Ended::Otherwise,
    }
}

/// Whether whoever waits for a request that came to `failure` is asked once more whether he does.
fn may_be_given_up(failure: &Failure) -> bool {
    !matches!(failure, Failure::Refused { .. } | Failure::NotBegun(_) | Failure::Port(_) | Failure::Interrupted)
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
        let begun = now.saturating_duration_since(Instant::ZERO + self.char_time.saturating_mul(self.count));
        self.begun = self.begun.min(Instant::ZERO + begun);
        let (chars, time) = EARLY;
        let all = self.char_time.saturating_mul(self.count.saturating_add(lacks).saturating_sub(chars));
        (lacks > chars).then(|| self.begun + all.saturating_sub(time))
    }
}

#[cfg(test)]
mod tests;
