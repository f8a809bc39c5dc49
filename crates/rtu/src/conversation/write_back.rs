//! A write of words that can be read back: what it takes to know what became of it, and when it is sent once more.
//!
//! | what came of the write | what follows |
//! | --- | --- |
//! | silence, or a damaged answer | read back; sent again only where the unit shows other words |
//! | a refusal by which the unit decides nothing (06H: busy, or damaged) | the same; it counts half, as a damaged answer does |
//! | an acknowledgement (05H: taken, and at work) | read back until it shows the words or the time is over; never sent again |
//! | a confirmation of another value | read back once; never sent again: the unit limits what it takes |
//! | a refusal, where that of an earlier write may come for it | read back; never sent again: what the unit shows is told |
//! | any other refusal | the caller is told |

use super::known::Known;
use super::outcome::{Slip, Times, Unanswered};
use super::{Conversation, Question, State};
use crate::bytes::Bytes;
use crate::{AnswerError, ExceptionCode, Instant, Meaning, Request, Table};

/// How often a unit that is at work is looked at within the time that a call may take.
const LOOKS: u32 = 8;

/// A write whose words can be read back, and how far it is.
#[derive(Debug, Clone)]
pub(super) struct Write<'r> {
    /// What reads the words back.
    pub(super) read: Request<'r>,
    /// How often it was sent, and when before.
    times: u32,
    before: Option<Instant>,
    /// What is left of the retries, in halves.
    left: u32,
    looking: Option<Looking>,
}

/// What the write came to, and how often it was looked what the unit shows.
#[derive(Debug, Clone)]
struct Looking {
    slip: Slip,
    raw: Bytes,
    came: Came,
    is_unproven: bool,
    look: u32,
}

/// What came of a write that is not known to be done.
#[derive(Debug, Clone, Copy)]
enum Came {
    /// Nothing that tells; sending it again takes so many halves of a retry.
    Nothing { cost: u32 },
    /// The unit took it and is at work, as it says by this exception.
    Acknowledged(ExceptionCode),
    /// The unit says that it took this value.
    Limited(u16),
    /// The unit refused this write, or one before it whose refusal came late.
    Refused,
}

impl<'r> Write<'r> {
    /// The one that `question` asks for, if it does and its words can be read.
    pub(super) fn of(question: &Question<'r>, retries: u32) -> Option<Self> {
        let address = question.read_back?;
        let (table, count) = match question.request {
            Request::WriteSingle { .. } => (Table::Holding, 1),
            Request::WriteMultiple { words, .. } => (Table::Holding, u16::try_from(words.len()).unwrap_or(u16::MAX)),
            Request::WriteCoil { .. } => (Table::Coil, 1),
            _ => return None,
        };
        let read = Request::read_of(table, address, count).ok()?;
        Some(Self { read, times: 0, before: None, left: retries.saturating_mul(2), looking: None })
    }

    /// When it went out last, once it is known what came of that.
    pub(super) const fn before(&self) -> Option<Instant> {
        self.before
    }

    /// Whether it is read back now.
    pub(super) const fn is_reading(&self) -> bool {
        self.looking.is_some()
    }
}

impl<'r> Conversation<'r> {
    /// The write, or the look at what the unit shows, came to `result`.
    ///
    /// What the unit does not show by the time that it is asked it has not taken: no request from before is open any more when
    /// it answers. All of it happens over the connection that the write went out over: behind another one, another unit may
    /// answer.
    pub(super) fn write_goes_on<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        mut write: Write<'r>,
        result: Result<Times, Slip>,
    ) {
        match write.looking.take() {
            None => self.written(known, write, result),
            Some(looking) => self.looked(now, known, write, looking, result),
        }
    }

    /// It was sent, and came to `result`.
    fn written<const U: usize, const P: usize>(
        &mut self,
        known: &mut Known<U, P>,
        mut write: Write<'r>,
        result: Result<Times, Slip>,
    ) {
        let is_unproven = self.course.take_unproven();
        let slip = match result {
            Ok(_) if !is_unproven => return self.finish(known, result),
            Ok(times) => {
                let why = Unanswered::NoAnswer { timeout: self.question.timeout, attempts: 1 };
                self.slip(why, Some(times.sent), times.ended)
            }
            Err(slip) => slip,
        };
        let (Some(came), Some(sent)) = (self.came_of(&slip, is_unproven), slip.sent) else {
            // It may not have gone out this time, but it has before.
            return self.finish(known, Err(Slip { sent: slip.sent.or(write.before), ..slip }));
        };
        write.before = Some(sent);
        write.times += 1;
        self.connection = Some(known.connection());
        write.looking = Some(Looking { slip, raw: self.came, came, is_unproven, look: 1 });
        self.write = Some(write);
        self.go_on_with(self.retries);
    }

    /// What the unit shows was read, or not.
    fn looked<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        mut write: Write<'r>,
        mut looking: Looking,
        result: Result<Times, Slip>,
    ) {
        let sent = looking.slip.sent;
        let times = match result {
            Ok(times) => times,
            // It is still not known whether the write was taken; that it cannot be read is no refusal of it.
            Err(look) if looking.is_unproven && look.why.is_refused() => {
                let why = Unanswered::NoAnswer { timeout: self.question.timeout, attempts: 1 };
                let slip = self.slip(why, sent, look.ended);
                return self.finish(known, Err(slip));
            }
            Err(look) if looking.is_unproven => return self.finish(known, Err(Slip { sent, ..look })),
            Err(_) => {
                self.came = looking.raw;
                self.ended_before = false;
                return self.finish(known, Err(looking.slip));
            }
        };
        let is_shown = self.shows_what_was_written();
        let looks = if matches!(looking.came, Came::Acknowledged(_)) { LOOKS } else { 1 };
        if !is_shown && looking.look < looks {
            looking.look += 1;
            write.looking = Some(looking);
            self.write = Some(write);
            self.go_on_with(self.retries);
            self.state = State::Pausing(times.ended + self.patience() / LOOKS);
            return;
        }
        if is_shown {
            self.answer.clear();
            let times = Times { sent: sent.unwrap_or(now), ended: times.ended };
            return self.finish(known, Ok(times));
        }
        let why = match looking.came {
            Came::Nothing { cost } if cost <= write.left => {
                write.left -= cost;
                self.write = Some(write);
                return self.go_on_with(0);
            }
            // Which of them was refused, nobody can tell; what the unit shows is sure.
            Came::Refused => {
                self.came = looking.raw;
                let why = Unanswered::NotTaken { times: write.times };
                return self.finish(known, Err(Slip { why, sent, ended: times.ended }));
            }
            Came::Nothing { .. } if looking.slip.why.means(&self.question.meanings).is_some() => {
                self.came = looking.raw;
                return self.finish(known, Err(looking.slip));
            }
            Came::Nothing { .. } => Unanswered::NotTaken { times: write.times },
            Came::Acknowledged(code) => Unanswered::Acknowledged { code },
            Came::Limited(took) => Unanswered::Limited { took },
        };
        let slip = self.slip(why, sent, times.ended);
        self.finish(known, Err(slip));
    }

    /// Whether the words that were read are those that were written.
    fn shows_what_was_written(&self) -> bool {
        let Some(words) = self.answer.words() else { return false };
        match self.question.request {
            Request::WriteSingle { value, .. } => words.iter().eq([value]),
            Request::WriteMultiple { words: written, .. } => words.iter().eq(written.iter()),
            Request::WriteCoil { on, .. } => words.iter().eq([u16::from(on)]),
            _ => false,
        }
    }

    /// What `slip` tells of the write, `is_unproven` where it may be meant for an earlier one; `None` where it was not taken, or
    /// did not go out, and that is that.
    fn came_of(&self, slip: &Slip, is_unproven: bool) -> Option<Came> {
        match (slip.why, self.question.request) {
            (Unanswered::Refused { code, .. }, _) => match slip.why.means(&self.question.meanings)? {
                Meaning::AskAgain => Some(Came::Nothing { cost: 1 }),
                Meaning::Taken => Some(Came::Acknowledged(code)),
                Meaning::NoSuch | Meaning::NotNow => is_unproven.then_some(Came::Refused),
            },
            // A late confirmation of an earlier write is known as that: it never gets here while that one is open.
            (
                Unanswered::Wrong(AnswerError::Echo { asked: [asked, _], came: [came, took] }),
                Request::WriteSingle { .. },
            ) if asked == came => Some(Came::Limited(took)),
            (why, _) => why.is_unanswered().then_some(Came::Nothing { cost: 2 }),
        }
    }
}
