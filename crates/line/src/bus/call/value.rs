//! A write of words that can be read back: what it takes to know what became of it, and when it is sent once more.
//!
//! | what came of the write | what follows |
//! | --- | --- |
//! | silence, or a damaged answer | read back; sent again only where the unit shows other words |
//! | a refusal by which the unit decides nothing (06H: busy, or damaged) | the same; it counts half, as a damaged answer does |
//! | an acknowledgement (05H: taken, and at work) | read back until it shows the words or the time is over; never sent again |
//! | a confirmation of another value | read back once; never sent again: the unit limits what it takes |
//! | any other refusal | the caller is told |

use drivebus_rtu::{Answer, AnswerError, ExceptionCode, Meaning, Request, Table};

use crate::ask::{Ask, Done};
use crate::bus::call::Call;
use crate::bus::call::course::{Course, is_unanswered};
use crate::bus::errand::Errand;
use crate::error::{CallError, Failure};
use crate::turns::queue::Turn;

/// How often a unit that is at work is looked at within the time that a call may take.
const LOOKS: u32 = 8;

/// What came of a write that is not known to be done.
enum Came {
    /// Nothing that tells; sending it again takes so many halves of a retry.
    Nothing { cost: u32 },
    /// The unit took it and is at work, as it says by this exception.
    Acknowledged(ExceptionCode),
    /// The unit says that it took this value.
    Limited(u16),
}

impl<'b> Call<'b, '_> {
    /// Writes words that can be read back at `address`.
    ///
    /// What the unit does not show by the time that it is asked it has not taken: no request from before is open any more when
    /// it answers. All of it happens over the connection that the write went out over: behind another one, another unit may
    /// answer.
    pub(super) fn write_value(
        &self,
        turn: &mut Turn<'b, Errand>,
        course: &mut Course,
        address: u16,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let (table, written) = match *self.ask.request {
            Request::WriteSingle { value, .. } => (Table::Holding, vec![value]),
            Request::WriteMultiple { words, .. } => (Table::Holding, words.iter().collect()),
            Request::WriteCoil { on, .. } => (Table::Coil, vec![u16::from(on)]),
            _ => return self.once(turn, course, give_up, take),
        };
        let count = u16::try_from(written.len()).unwrap_or(u16::MAX);
        let Ok(read) = Request::read_of(table, address, count) else {
            return self.once(turn, course, give_up, take);
        };
        let mut writing = Call { ..*self };
        let (mut times, mut before) = (0, None);
        let mut left = self.retries.saturating_mul(2);
        loop {
            let outcome = writing.once(turn, course, give_up, take);
            let is_unproven = course.take_unproven();
            let mut error = match outcome {
                Ok(done) if !is_unproven => return Ok(done),
                Ok(done) => {
                    let failure = Failure::NoAnswer { timeout: self.ask.timeout, attempts: 1 };
                    self.ask.failed(failure, Some(done.sent), done.ended, &[])
                }
                Err(error) => error,
            };
            let came = self.came(&error);
            let (Some(came), Some(sent)) = (came, error.sent) else {
                // It may not have gone out this time, but it has before.
                error.sent = error.sent.or(before);
                return Err(error);
            };
            before = Some(sent);
            times += 1;
            writing.connection = Some(self.bus.lock().stats().reconnects);
            // What is read back decides: it is never asked in doubt, not even for a write that was.
            let ask = Ask { request: &read, in_doubt: false, ..self.ask };
            let reading = Call { ask, read_back: None, ..writing };
            let looks = if matches!(came, Came::Acknowledged(_)) { LOOKS } else { 1 };
            let (done, shows) = match reading.look(turn, course, (looks, &written), give_up) {
                Ok(looked) => looked,
                // It is still not known whether the write was taken.
                Err(silent) if is_unproven => return Err(Box::new(CallError { sent: Some(sent), ..*silent })),
                Err(_) => return Err(error),
            };
            if shows == written {
                return Ok(Done { sent, ended: done.ended });
            }
            let failure = match came {
                Came::Nothing { cost } if cost <= left => {
                    left -= cost;
                    continue;
                }
                Came::Nothing { .. } if self.means(&error).is_some() => return Err(error),
                Came::Nothing { .. } => Failure::NotTaken { times, shows },
                Came::Acknowledged(code) => Failure::Acknowledged { code, shows },
                Came::Limited(took) => Failure::Limited { took, shows: shows.first().copied().unwrap_or(took) },
            };
            return Err(self.ask.failed(failure, Some(sent), done.ended, &[]));
        }
    }

    /// Reads what the unit shows, at most so many times until that is what was `wanted`, spread over the time of the call.
    fn look(
        &self,
        turn: &mut Turn<'b, Errand>,
        course: &mut Course,
        (looks, wanted): (u32, &[u16]),
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(Done, Vec<u16>), Box<CallError>> {
        let pause = self.patience() / LOOKS;
        let mut look = 1;
        loop {
            let mut shows = Vec::new();
            course.go_on_with(self.ask.timeout, self.retries);
            let done = self.repeat(turn, course, give_up, &mut |answer| {
                if let Answer::Read { words, .. } = answer {
                    shows = words.iter().collect();
                }
            })?;
            if shows == wanted || look >= looks {
                return Ok((done, shows));
            }
            look += 1;
            self.stand_by(turn, done.ended + pause, give_up)?;
        }
    }

    /// What `error` tells of the write; `None` where it was not taken, or did not go out, and that is that.
    fn came(&self, error: &CallError) -> Option<Came> {
        match (&error.failure, self.ask.request) {
            (&Failure::Refused { code, .. }, _) => match self.means(error)? {
                Meaning::AskAgain => Some(Came::Nothing { cost: 1 }),
                Meaning::Taken => Some(Came::Acknowledged(code)),
                Meaning::NoSuch | Meaning::NotNow => None,
            },
            // A late confirmation of an earlier write is known as that: it never gets here while that one is open.
            (
                Failure::Wrong(AnswerError::Echo { asked: [asked, _], came: [came, took] }),
                Request::WriteSingle { .. },
            ) if asked == came => Some(Came::Limited(*took)),
            (failure, _) => is_unanswered(failure).then_some(Came::Nothing { cost: 2 }),
        }
    }
}
