//! One call, from the first thought of it to its end: whether the unit may be asked, what has to come before, how the question
//! is put, whether what came can be believed, and whether it is asked again.
//!
//! | room | what is decided there |
//! | --- | --- |
//! | `known` | what is known of the line, and what comes before a request |
//! | `attempt` | one attempt: what comes before the question, the question, and how often it takes to be sure of the answer |
//! | `attempts` | from the first attempt to the end, and what the caller is told |
//! | `came_to` | what follows from what a request came to |
//! | `exchange` | one request on the wire, and what is learned of it |
//! | `course` | how long a call may go on, how often, and after what there is another attempt |
//! | `write_back` | a write of words that can be read back |
//! | `probes` | which request shows that a unit owes nothing |
//! | `longer_reads` | how many words a read asks for, so that its answer is told apart |
//! | `two_parts` | the same in two reads, where no longer one helps |
//! | `among_others` | the same where other masters' answers come, too |
//! | `first_contact` | a stop's reads on a line that was just opened |
//! | `adapter`, `echo` | whether the adapter sends our own bytes back |
//! | `units`, `watched` | what is remembered of each unit |
//! | `dead_units` | units that do not answer |

mod adapter;
mod among_others;
mod attempt;
mod attempts;
mod came_to;
mod course;
mod dead_units;
mod echo;
mod exchange;
mod first_contact;
mod fresh_words;
mod known;
mod longer_reads;
mod outcome;
mod probes;
mod question;
mod step;
mod two_parts;
mod units;
mod watched;
mod write_back;

use core::time::Duration;

use crate::bytes::Bytes;
use crate::{Instant, UnitAddress};

use attempt::Attempt;
use course::Course;
use exchange::{Flight, Purpose};
use known::Ask;
use outcome::{Kept, Slip};
use write_back::Write;

pub use echo::OwnEcho;
pub use fresh_words::FreshWords;
pub use known::{Known, Opened};
pub use outcome::{Cut, Exchange, Outcome, Times, Unanswered};
pub use question::{Question, Urgency};
pub use step::{Counts, OutOfTurn, Step};

/// One call, as a value that is given time.
///
/// It has no clock, no port and no thread. Whoever has those asks it by [`next`](Self::next) what to do, does that, and says
/// what came of it; what the line has taught is in [`Known`], which all calls on one line share. One call at a time uses a
/// `Known`: between two steps another may where the step is [`LetPass`](Step::LetPass) or [`StandBy`](Step::StandBy).
///
/// ```
/// use drivebus_rtu::{
///     OwnEcho, Answer, Conversation, Duration, FreshWords, Instant, Known, Opened, Outcome, Question, Request, SerialFormat,
///     Step, UnitAddress,
/// };
///
/// let mut known: Known<4, 16> = Known::new(SerialFormat::DEFAULT, OwnEcho::Absent, 1);
/// let words = FreshWords::beginning_at(0x1234);
/// let mut now = Instant::ZERO;
/// known.opened(now, &Opened::new().gapless(true)); // nobody else asks on it
///
/// let read = Request::read(0x2100, 1)?;
/// let question = Question::new(UnitAddress::MIN.into(), read, Duration::from_millis(500)).retries(2);
/// let mut call = Conversation::new(question, &words);
/// let mut wire: &[u8] = &[];
/// let word = loop {
///     match call.next(now, &mut known) {
///         Step::LetPass | Step::Heard(_) => {}
///         Step::StandBy(until) => now = until,
///         Step::Send(frame) => {
///             assert_eq!(frame, [0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
///             wire = &[0x01, 0x03, 0x02, 0x00, 0x07, 0xF9, 0x86];
///             call.sent(&mut known, now)?;
///         }
///         Step::Listen(until) => {
///             now = if wire.is_empty() { until } else { now };
///             let count = call.heard(now, &mut known, wire)?;
///             wire = &wire[count..];
///         }
///         Step::Done(Outcome::Answered { answer: Some(Answer::Read { words, .. }), .. }) => break words.get(0),
///         other => panic!("{other:?}"),
///     }
/// };
/// assert_eq!(word, Some(7));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Conversation<'r> {
    question: Question<'r>,
    words: &'r FreshWords,
    /// How often it may be asked once more; never where its unit was silent the last times.
    retries: u32,
    /// The connection that it must go over.
    connection: Option<u64>,
    /// How long its unit takes at most until its answer begins, as its answers have taught.
    learned: Option<Duration>,
    is_wanted: bool,
    write: Option<Write<'r>>,
    course: Course,
    attempt: Attempt,
    /// How the attempt before this one ended, if that was with the port.
    port_failed: Option<Slip>,
    /// What came while it stood by was not taken down yet.
    has_paused: bool,
    /// Whether that is how the call ended.
    ended_before: bool,
    state: State<'r>,
    answer: Kept,
    came: Bytes,
    counts: Counts,
    latest: Instant,
}

/// Where a call stands.
#[derive(Debug, Clone)]
enum State<'r> {
    /// Its unit may have been silent: it waits off the line, until then at most.
    Sparing { patience: Option<Instant> },
    /// Nothing of it is on the wire, and others may go first.
    Passing,
    /// They have.
    Passed,
    /// What came in meanwhile is taken down.
    Overhearing,
    /// The next request is chosen.
    Deciding,
    /// Its request is on the wire.
    InFlight(Flight<'r>),
    /// What came behind an answer is taken down.
    Proving { ask: Ask<'r>, count: u16, times: Times },
    /// The request is over, and nobody was told yet.
    Over(Flight<'r>, Result<Times, Slip>),
    /// That was told: now it is judged.
    Heard(Flight<'r>, Result<Times, Slip>),
    /// The unit is at work: it is looked at again then.
    Pausing(Instant),
    /// All is over.
    Done(Result<Times, Slip>),
}

impl<'r> Conversation<'r> {
    /// One that has not begun. Probes take their words from `words`, as all on this line do.
    pub fn new(question: Question<'r>, words: &'r FreshWords) -> Self {
        Self {
            retries: question.retries,
            connection: question.connection,
            learned: None,
            is_wanted: true,
            write: None,
            course: Course::new(question.timeout, question.retries),
            attempt: Attempt::new(question.verify, 0),
            port_failed: None,
            has_paused: false,
            ended_before: false,
            state: State::Sparing { patience: None },
            answer: Kept::NONE,
            came: Bytes::NONE,
            counts: Counts::default(),
            latest: Instant::ZERO,
            words,
            question,
        }
    }

    /// From now on probes take their words from `words`: for who carries several conversations on from one, each as if there
    /// were no other.
    pub const fn take_words_from(&mut self, words: &'r FreshWords) {
        self.words = words;
    }

    /// From the next request on a read waits no longer for the first character of its answer than `longest`, and the time that
    /// its characters take on top: what the unit's answers have taught.
    pub const fn expect_within(&mut self, longest: Option<Duration>) {
        self.learned = longest;
    }

    /// Whether somebody still waits for it. What nobody waits for is not asked once more.
    pub const fn is_wanted(&mut self, is_wanted: bool) {
        self.is_wanted = is_wanted;
    }

    /// How often something happened since the last time.
    pub const fn take_counts(&mut self) -> Counts {
        core::mem::replace(&mut self.counts, Counts { retries: 0, verified: 0, resyncs: 0 })
    }

    /// What to do at `now`.
    pub fn next<'a, const U: usize, const P: usize>(
        &'a mut self,
        now: Instant,
        known: &'a mut Known<U, P>,
    ) -> Step<'a, 'r> {
        if now < self.latest {
            self.misused(known);
        }
        self.latest = self.latest.max(now);
        loop {
            match self.state {
                State::Sparing { patience } => {
                    if let Some(until) = self.spare_the_others(now, known, patience) {
                        return Step::StandBy(until);
                    }
                }
                State::Passing => {
                    self.state = State::Passed;
                    return Step::LetPass;
                }
                State::Passed => self.passed(now, known),
                State::Overhearing => return Step::Listen(known.master.hears_until().unwrap_or(now).max(now)),
                State::Proving { .. } => return Step::Listen(now),
                State::Deciding => self.decide(now, known),
                State::InFlight(_) => match self.poll(now, known) {
                    Polled::Send => return Step::Send(known.master.frame()),
                    Polled::Listen(until) => return Step::Listen(until),
                    Polled::Over => {}
                },
                State::Over(flight, result) => {
                    self.state = State::Heard(flight, result);
                    return Step::Heard(self.exchange(&flight, &result));
                }
                State::Heard(flight, result) => self.conclude(now, known, flight, result),
                State::Pausing(until) => {
                    self.state = State::Passing;
                    self.has_paused = true;
                    return Step::StandBy(until);
                }
                State::Done(result) => return Step::Done(self.outcome(result)),
            }
        }
    }

    /// Says that the bytes of [`Step::Send`] are on their way, and that the last will have left at `end`. Returns until when
    /// it is waited for the answer at most.
    ///
    /// # Errors
    ///
    /// [`OutOfTurn`]: nothing was to be sent, or it was said before.
    pub fn sent<const U: usize, const P: usize>(
        &mut self,
        known: &mut Known<U, P>,
        end: Instant,
    ) -> Result<Instant, OutOfTurn> {
        match &mut self.state {
            State::InFlight(flight) if flight.sent.is_some() && !flight.is_out && flight.is_begun_last(known) => {
                flight.is_out = true;
                known.master.sent(end);
                Ok(end + flight.timeout)
            }
            _ => Err(OutOfTurn),
        }
    }

    /// Takes bytes that had come by `now`, as many as there is room for, and returns how many. None say that none came.
    ///
    /// # Errors
    ///
    /// [`OutOfTurn`]: it does not listen, or `now` is before the last moment that it was told.
    pub fn heard<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        bytes: &[u8],
    ) -> Result<usize, OutOfTurn> {
        if now < self.latest {
            return Err(OutOfTurn);
        }
        self.latest = now;
        match &mut self.state {
            State::InFlight(flight) if flight.is_begun_last(known) => {
                flight.listened = true;
                Ok(known.master.receive(now, bytes))
            }
            State::Overhearing | State::Proving { .. } if !bytes.is_empty() => {
                known.stray(now, bytes);
                Ok(bytes.len())
            }
            State::Overhearing if known.master.hears_until().is_some_and(|silent| now < silent) => Ok(0),
            State::Overhearing => {
                known.take_down(now);
                self.state = State::Deciding;
                Ok(0)
            }
            &mut State::Proving { ask, count, times } => {
                known.master.overhear(now);
                self.proved(now, known, ask, count, times);
                Ok(0)
            }
            _ => Err(OutOfTurn),
        }
    }

    /// Cuts it short at `now`: the port was lost, or nobody waits for it any more. A request on the wire is given up. What
    /// becomes of the call [`next`](Self::next) tells: where the port was lost it may go on.
    pub fn cut_short<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>, why: Cut) {
        let why = Unanswered::CutShort(why);
        match self.state {
            State::InFlight(flight) => self.give_up(now, known, flight, why),
            // It was cut short before, or given up.
            State::Over(flight, Err(slip)) => self.state = State::Over(flight, Err(Slip { why, ..slip })),
            State::Heard(flight, Err(slip)) if !slip.why.is_refused() => {
                self.state = State::Heard(flight, Err(Slip { why, ..slip }));
            }
            // The unit has said what it does, whoever waits for that.
            State::Over(..) | State::Heard(..) | State::Done(_) => {}
            // Nothing of it has begun.
            State::Sparing { .. } => {
                let slip = self.slip(why, None, now);
                self.finish(known, Err(slip));
            }
            _ => {
                let slip = self.slip(why, None, now);
                self.end_attempt(now, known, Err(slip));
            }
        }
    }

    /// The unit has been quiet for so long at `now`, and whoever is more urgent waits: it is waited for no longer.
    pub fn give_way<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>, quiet: Duration) {
        if let State::InFlight(flight) = self.state {
            self.give_up(now, known, flight, Unanswered::NoAnswer { timeout: quiet, attempts: 1 });
        }
    }

    /// The request on the wire is given up, and nothing came of it.
    fn give_up<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        flight: Flight<'r>,
        why: Unanswered,
    ) {
        flight.give_up(now, known);
        let slip = self.slip(why, flight.sent, now);
        self.over(known, flight, Err(slip));
    }

    /// Whether a request of it was begun and is not over.
    pub const fn is_in_flight(&self) -> bool {
        matches!(self.state, State::InFlight(_))
    }

    /// Who is asked.
    fn unit(&self) -> Option<UnitAddress> {
        self.question.destination.unit()
    }

    /// Whether the unit says by `why` that it could not take a request, and may the next time.
    fn asks_again(&self, why: Unanswered) -> bool {
        self.unit().is_some() && why.asks_again(&self.question.meanings)
    }

    /// What is asked now: what the caller asks, or what was written.
    fn ask(&self) -> Ask<'r> {
        let Question { destination, request, timeout, in_doubt, .. } = self.question;
        match &self.write {
            // What is read back decides: it is never asked in doubt, not even for a write that was.
            Some(write) if write.is_reading() => Ask { destination, request: write.read, timeout, in_doubt: false },
            _ => Ask { destination, request, timeout, in_doubt },
        }
    }

    /// An error, with nothing that came instead of an answer.
    fn slip(&mut self, why: Unanswered, sent: Option<Instant>, ended: Instant) -> Slip {
        self.came.clear();
        Slip { why, sent, ended }
    }

    /// When what the caller asks went out last, as far as it did.
    fn question_sent(&self) -> Option<Instant> {
        let before = self.write.as_ref().and_then(Write::before);
        match &self.state {
            _ if before.is_some() => before,
            State::InFlight(flight) | State::Over(flight, _) | State::Heard(flight, _) => match flight.purpose {
                Purpose::LookAfter { times } | Purpose::Proof { times, .. } => Some(times.sent),
                Purpose::Look | Purpose::Probe(_) => None,
                _ => flight.sent,
            },
            State::Proving { times, .. } => Some(times.sent),
            _ => None,
        }
    }

    #[cold]
    fn misused<const U: usize, const P: usize>(&mut self, known: &mut Known<U, P>) {
        let sent = self.question_sent();
        match &self.state {
            State::Done(_) => return,
            State::InFlight(flight) => flight.give_up(self.latest, known),
            _ => {}
        }
        let slip = self.slip(Unanswered::Misused, sent, self.latest);
        self.state = State::Done(Err(slip));
    }

    /// How long a unit that was silent may keep its caller waiting: no longer than it would by staying silent again. Who
    /// polls has others to ask meanwhile.
    pub fn patience(&self) -> Duration {
        if self.question.urgency == Urgency::Poll {
            return Duration::ZERO;
        }
        self.question.timeout.saturating_mul(self.retries.saturating_add(1))
    }
}

/// What the request on the wire needs.
enum Polled {
    Send,
    Listen(Instant),
    Over,
}
