//! The program: it asks, and a [`Conversation`] does the rest. Which of the calls it makes, and when it gives up, is left open.

use std::cell::OnceCell;
use std::hash::{Hash, Hasher};

use drivebus_rtu::{Conversation, FreshWords, Instant, OwnEcho, Question, Step as Next, Urgency};

use crate::fingerprint;
use crate::frames::{Content, Kind};
use crate::judge::{Source, Step};
use crate::scenario::{Scenario, Sight};
use crate::world::{State, Wrong, address};

/// Where a call takes its words from while it is not carried on. None is taken from there, so that all moments look alike.
static NO_WORDS: FreshWords = FreshWords::beginning_at(0);

thread_local! {
    /// Where a call takes its words from while this thread carries it on. They are those of the moment, not of the thread.
    static WORDS: OnceCell<&'static FreshWords> = const { OnceCell::new() };
}

/// Words of which the next is `word`.
fn words_from(word: u16) -> &'static FreshWords {
    WORDS.with(|words| {
        let words: &'static FreshWords = words.get_or_init(|| Box::leak(Box::new(FreshWords::beginning_at(0)))); // once for each thread
        words.begin_at(word);
        words
    })
}

/// One call of the program.
#[derive(Debug, Clone)]
pub struct Call {
    /// Who is asked.
    pub unit: usize,
    /// What is asked.
    pub kind: Kind,
    /// What decides about it.
    pub conversation: Box<Conversation<'static>>,
    /// The number of its first request.
    pub(crate) first: u16,
    /// Where it stands.
    pub(crate) standing: Standing,
    /// Its request on the wire.
    pub(crate) flight: Option<Flight>,
    pub(crate) truth: Truth,
}

/// Where a call stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Standing {
    /// It is about to send.
    Sending,
    /// It waits for bytes until then.
    Listening(Instant),
    /// It leaves the line to others until then.
    Aside(Instant),
}

/// A request on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Flight {
    /// What is asked.
    pub kind: Kind,
    /// From where it reads.
    pub(crate) place: u16,
    /// Its number.
    pub number: u16,
    /// Whether it was asked in quarantine, and its answer cannot be mistaken.
    pub(crate) ends_doubt: bool,
}

/// What is true of a call, which it cannot know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Truth {
    /// What came last in place of an answer to a read, how often in a row, and whether any of these was given to this call.
    pub(crate) row: Option<(Content, u8, bool)>,
    /// What was taken last for the answer to a write: whether it was given to this call, or may count as such.
    pub(crate) confirmed: Option<bool>,
    /// Whether its write went out.
    pub(crate) went_out: bool,
    /// Whether the registers held what it writes, at any time of the call.
    pub(crate) shown: bool,
    /// Whether they held something else, at any time since it was written last.
    pub(crate) hidden: bool,
}

/// The program.
#[derive(Debug, Clone)]
pub struct Program {
    /// The call under way.
    pub call: Option<Call>,
}

impl Program {
    /// The request on the wire.
    pub fn in_flight(&self) -> Option<Flight> {
        self.call.as_ref().and_then(|call| call.flight)
    }

    /// Whether a call is about to send.
    pub(crate) fn is_sending(&self) -> bool {
        self.call.as_ref().is_some_and(|call| call.standing == Standing::Sending)
    }

    pub(crate) fn hash_at<H: Hasher>(&self, now: Instant, timeless: &[&str], hasher: &mut H) {
        let Some(call) = &self.call else { return };
        (call.unit, call.kind, call.truth, call.flight.map(|flight| (flight.place, flight.ends_doubt))).hash(hasher);
        fingerprint::of(now, &(call.standing, &call.conversation), timeless).hash(hasher);
    }
}

/// How the program asks `kind` of `unit`.
fn question(scenario: &Scenario, retries: u8, unit: usize, kind: Kind) -> Question<'static> {
    let urgency = if matches!(kind, Kind::Stop | Kind::Watch) { Urgency::Stop } else { Urgency::Call };
    Question::new(address(unit).into(), kind.request(), scenario.timeout)
        .retries(retries.into())
        .urgency(urgency)
        .in_doubt(kind == Kind::Stop || !scenario.heeds)
        .read_back(kind.read_back())
}

impl State {
    /// The program asks `kind` of `unit`.
    pub(crate) fn ask(&mut self, step: &mut Step<'_>, unit: usize, kind: Kind) {
        let kind = if let Kind::Echo(_) = kind { Kind::Echo(self.fresh_word()) } else { kind };
        let question = question(step.scenario, self.left.retries, unit, kind);
        self.program.call = Some(Call {
            unit,
            kind,
            conversation: Box::new(Conversation::new(question, &NO_WORDS)),
            first: self.requests + 1,
            standing: Standing::Sending,
            flight: None,
            truth: Truth { hidden: true, ..Truth::default() },
        });
        self.go_on(step, Source::Nowhere);
    }

    /// The words that `call` takes: its own, where it echoes one; else such as no echo carries that may still come.
    fn words_for(&self, call: &Call) -> &'static FreshWords {
        let Kind::Echo(word) = call.kind else { return words_from(self.fresh_word()) };
        let words = words_from(word);
        words.next();
        words
    }

    /// Goes on with the call, as far as nothing else has to happen. What it was told last came from `source`.
    pub(crate) fn go_on(&mut self, step: &mut Step<'_>, source: Source) {
        let Some(mut call) = self.program.call.take() else { return };
        let echo = self.known.echo();
        call.conversation.take_words_from(self.words_for(&call));
        let standing = loop {
            match call.conversation.next(self.now, &mut self.known) {
                Next::LetPass => {}
                Next::StandBy(until) => break Some(Standing::Aside(until)),
                Next::Listen(_) if call.flight.is_none() => break Some(Standing::Sending),
                Next::Listen(until) => break Some(Standing::Listening(until)),
                Next::Heard(exchange) => self.request_is_over(step, &mut call, &exchange, source),
                Next::Done(outcome) => {
                    let came = outcome.into();
                    self.call_is_over(step, &call, came);
                    break None;
                }
                // Nothing was said that it could send on.
                _ => {
                    self.wrong = Some(Wrong::SentTwice);
                    break None;
                }
            }
        };
        if echo != OwnEcho::Present && self.known.echo() == OwnEcho::Present {
            step.sights.push(Sight::AdapterFound);
        }
        let Some(standing) = standing else { return };
        call.standing = standing;
        call.conversation.take_words_from(&NO_WORDS);
        call.conversation.take_counts();
        self.program.call = Some(call);
    }

    /// Hands out what the call is about to send.
    pub(crate) fn hand_out(&mut self) -> Option<Vec<u8>> {
        let (now, words) = (self.now, self.program.call.as_ref().map(|call| self.words_for(call))?);
        let call = self.program.call.as_mut()?;
        call.conversation.take_words_from(words);
        call.conversation.heard(now, &mut self.known, &[]).ok()?;
        let frame = match call.conversation.next(now, &mut self.known) {
            Next::Send(frame) => frame.to_vec(),
            _ => return None,
        };
        let (kind, place) = Kind::sent(&frame)?;
        let unit = call.unit;
        let is_own = kind == call.kind;
        if kind.is_write() && (!is_own || (kind == Kind::Run && call.truth.went_out)) {
            self.wrong = Some(Wrong::SentTwice);
        }
        call.truth.went_out |= kind.is_write();
        let flight = Flight { kind, place, number: self.requests, ends_doubt: false };
        let apart = self.master().tells_apart(now, address(unit), &kind.request_at(place));
        let ends_doubt = self.is_doubted(unit) && apart;
        if let Some(call) = &mut self.program.call {
            call.flight = Some(Flight { ends_doubt, ..flight });
            call.standing = Standing::Listening(now);
        }
        self.told.sent = Some(kind);
        Some(frame)
    }

    /// Gives `bytes`, which came from `source`, to who waits for some. None, where only time has passed.
    pub(crate) fn take_in(&mut self, step: &mut Step<'_>, bytes: &[u8], source: Source) {
        let now = self.now;
        match &mut self.program.call {
            // What comes before a request is sent does not make it go out.
            Some(call) if call.standing == Standing::Sending => {
                let _ = call.conversation.heard(now, &mut self.known, bytes);
            }
            Some(call) if call.flight.is_some() => {
                let _ = call.conversation.heard(now, &mut self.known, bytes);
                self.go_on(step, source);
            }
            _ => {
                self.known.stray(now, bytes);
                if self.known.take_strays().late > 0 {
                    step.sights.push(Sight::Late);
                    self.told.outcome = Some("known to be late");
                }
            }
        }
    }
}
