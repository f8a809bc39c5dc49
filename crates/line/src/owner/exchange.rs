//! Carries a conversation out on an open line: bytes, the clock, and the wish to give up.

use std::time::Duration;

use drivebus_rtu::{Answer, Conversation, Cut, Exchange, Instant, Outcome, Step, Unanswered};

use crate::ask::{Ask, Done};
use crate::error::{CallError, Failure};
use crate::line::{PortError, PortErrorKind};
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
    /// The last time, and the one before.
    cuts: [Option<Failure>; 2],
}

impl<'a, 'r> Talk<'a, 'r> {
    pub(crate) fn new(call: Conversation<'r>, ask: &'a Ask<'r>, is_wanted: &'a dyn Fn() -> bool) -> Self {
        Self { call, ask, is_wanted, cuts: [None, None] }
    }

    /// It is cut short at `now` by `failure`.
    pub(crate) fn cut_short(&mut self, owner: &mut Owner, now: Instant, failure: Failure) {
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
                Err(ask.failed(failure, sent, ended, raw))
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
    came: usize,
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
        let mut yields = self.yields(talk.ask);
        let mut buffer = [0; 256];
        // What of it was not taken yet.
        let mut rest = 0..0;
        self.prepare_next(talk);
        loop {
            match talk.call.next(now, &mut self.known) {
                Step::LetPass => return Then::LetPass,
                Step::StandBy(until) => return Then::StandBy(until),
                Step::Done(outcome) => return Then::Done(Talk::result(&mut talk.cuts, talk.ask, outcome, take)),
                Step::Send(frame) => {
                    let Some(line) = self.line.as_deref_mut() else {
                        talk.cut_short(self, now, Failure::Closed);
                        continue;
                    };
                    match line.send(frame) {
                        Ok(end) => {
                            let limit = talk.call.sent(&mut self.known, end).unwrap_or(end);
                            if let Some(carried) = &mut carried {
                                (carried.out, carried.limit) = (Some(end), limit);
                            }
                        }
                        Err(error) => {
                            now = line.now();
                            talk.cut_short(self, now, Failure::Port(error));
                        }
                    }
                }
                // Whatever there was no room for, there is after polling.
                Step::Listen(_) if !rest.is_empty() => {
                    let taken = talk.call.heard(now, &mut self.known, &buffer[rest.clone()]).unwrap_or(rest.len());
                    rest.start += taken;
                }
                Step::Listen(deadline) => {
                    let Some(line) = self.line.as_deref_mut() else {
                        talk.cut_short(self, now, Failure::Closed);
                        continue;
                    };
                    let mut until = deadline;
                    if talk.call.is_in_flight() {
                        let carried = carried.get_or_insert_with(|| Carried {
                            arrivals: Arrivals::new(),
                            pace: line.char_time().map(Pace::new),
                            out: None,
                            limit: now,
                            slept: false,
                            looked_up: now,
                            came: 0,
                        });
                        if now.saturating_duration_since(carried.looked_up) >= LOOK_UP {
                            carried.looked_up = now;
                            let last = |out| now.saturating_duration_since(carried.arrivals.last().max(out));
                            let quiet = carried.out.map_or(Duration::ZERO, last);
                            if give_up() {
                                talk.cut_short(self, now, Failure::Interrupted);
                                continue;
                            }
                            if quiet >= STOP_WAITS && yields.is_some_and(Stops::has_stop) {
                                talk.call.give_way(now, &mut self.known, quiet);
                                continue;
                            }
                        }
                        let wake = now + LOOK_UP;
                        until = deadline.min(wake);
                        let (came, lacks) = (carried.came, self.known.master().lacks());
                        let nearly = carried.pace.as_mut().and_then(|pace| pace.nearly_whole(now, came, lacks));
                        if let Some(nearly) = nearly {
                            line.sleep(nearly.min(carried.limit).min(wake));
                            carried.slept = true;
                            // What has come by then is taken without waiting for more.
                            until = now;
                        }
                    }
                    let received = line.receive(&mut buffer, until);
                    now = line.now();
                    let count = match received {
                        Ok(count) => count,
                        Err(error) => {
                            talk.cut_short(self, now, Failure::Port(error));
                            continue;
                        }
                    };
                    if let Some(carried) = &mut carried {
                        if count > 0 {
                            let (master, slept) = (self.known.master(), carried.slept);
                            carried.arrivals.came(now, count, || !slept && master.lacks() > 0);
                        }
                        (carried.slept, carried.came) = (false, count);
                    }
                    // Whatever there is no room for now, there is after polling.
                    let taken = talk.call.heard(now, &mut self.known, &buffer[..count]).unwrap_or(count);
                    rest = taken..count;
                }
                Step::Heard(exchange) => {
                    rest = 0..0;
                    let arrivals = carried.take().map_or_else(Arrivals::new, |carried| carried.arrivals);
                    self.lumps.learn(&arrivals, exchange.request.expected().adu_len(), ended(&exchange));
                    let cut = talk.cuts[0].clone();
                    let mut failure = exchange.failure.map(|why| Failure::of(why, Vec::new(), cut));
                    // Time-outs may be shorter than the time between two looks, and retries many.
                    let is_given_up = failure.as_ref().is_some_and(may_be_given_up) && give_up();
                    if is_given_up {
                        failure = Some(Failure::Interrupted);
                    }
                    self.keep(talk.ask, &exchange, failure.as_ref());
                    if is_given_up {
                        talk.cut_short(self, now, Failure::Interrupted);
                    }
                    talk.call.is_wanted((talk.is_wanted)());
                    yields = self.yields(talk.ask);
                    self.prepare_next(talk);
                }
                _ => {}
            }
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
