//! What becomes of a call, and of each request that it takes.

use core::time::Duration;

use crate::pdu::MAX_PDU;
use crate::{
    Answer, AnswerError, BeginError, Destination, ExceptionCode, Expected, FrameError, Instant, Meaning, Meanings,
    Request, Tally, Words,
};

/// When a request went out and its answer was there, on the caller's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Times {
    /// The first bit of the request.
    pub sent: Instant,
    /// The last byte of the answer, or the end of the turnaround delay after a broadcast.
    pub ended: Instant,
}

/// Why a call, or one request of it, brought no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unanswered {
    /// The request cannot be sent like this. Nothing was sent.
    NotBegun(BeginError),
    /// What is known of so many units has no room for one more. Nothing was sent.
    NoRoom {
        /// How many there is room for.
        units: usize,
    },
    /// Bytes, answers or moments came that do not belong to the state of the call: see
    /// [`Conversation`](crate::Conversation). It ends there.
    Misused,
    /// The port was opened again since the caller saw who answers. Nothing was sent.
    Reopened,
    /// The unit was silent the last times, and others use the line. Nothing was sent.
    NotAsked {
        /// How long until it is asked again.
        left: Duration,
    },
    /// The unit may still answer an earlier request, and nothing that was tried settled it. Nothing was sent. Where the unit
    /// refused what was tried, that is what came.
    Doubtful,
    /// The line was never silent long enough to send. Nothing was sent.
    Busy {
        /// How long it was waited for silence.
        timeout: Duration,
    },
    /// The unit stayed silent. It may have done what was asked.
    NoAnswer {
        /// How long each wait was.
        timeout: Duration,
        /// How often it was tried.
        attempts: u32,
    },
    /// The gateway before the unit says that it stayed silent. It may have done what was asked.
    Unreached,
    /// A whole frame came that is not the answer.
    Wrong(AnswerError),
    /// An answer came and did not survive the line.
    Corrupt(FrameError),
    /// The unit refused.
    Refused {
        /// The function asked for.
        function: u8,
        /// Why, in the unit's own numbering.
        code: ExceptionCode,
    },
    /// The same read brought one answer now and another then.
    Disagreeing {
        /// How often it was asked.
        asked: u32,
    },
    /// Another master asks the same of the unit, so that its answers cannot be told from the own ones.
    OthersAsk,
    /// The unit shows other words than those written.
    NotTaken {
        /// How often they were sent.
        times: u32,
    },
    /// The unit confirmed the write with another value than was sent.
    Limited {
        /// What it says.
        took: u16,
    },
    /// The unit said that it took the write and is at it, and has not shown the words since.
    Acknowledged {
        /// By which exception.
        code: ExceptionCode,
    },
    /// Whoever has the line cut it short.
    CutShort(Cut),
}

/// Why whoever has the line cuts a call short.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cut {
    /// The port was lost. It may be there again the next time.
    Lost,
    /// The port cannot be used.
    Unusable,
    /// Nobody waits for the call any more, or it must not go on.
    GivenUp,
}

impl Unanswered {
    /// Whether it is of a kind that another request over the same line may not have.
    pub(super) const fn is_line_trouble(self) -> bool {
        use Unanswered::{Corrupt, NoAnswer, OthersAsk, Refused, Unreached, Wrong};
        matches!(self, NoAnswer { .. } | Unreached | Corrupt(_) | Wrong(_) | Refused { .. } | OthersAsk)
    }

    /// Whether a time-out was waited for in vain.
    pub(super) const fn is_silence(self) -> bool {
        matches!(self, Self::NoAnswer { .. })
    }

    /// Whether a refusal came, whatever it was meant for.
    pub(super) const fn is_refusal(self) -> bool {
        matches!(self, Self::Refused { .. } | Self::Wrong(AnswerError::Refusal { .. }))
    }

    pub(super) const fn is_refused(self) -> bool {
        matches!(self, Self::Refused { .. })
    }

    /// Whether the request went out, and no right answer came.
    pub(super) const fn is_unanswered(self) -> bool {
        matches!(self, Self::NoAnswer { .. } | Self::Unreached) || self.is_damaged()
    }

    /// Whether an answer came that was none.
    pub(super) const fn is_damaged(self) -> bool {
        matches!(self, Self::Wrong(_) | Self::Corrupt(_))
    }

    /// Whether the same read may well succeed the next time.
    pub(super) const fn is_passing(self) -> bool {
        match self {
            Self::Busy { .. } | Self::Doubtful | Self::Disagreeing { .. } | Self::CutShort(Cut::Lost) => true,
            other => other.is_unanswered(),
        }
    }

    /// Whether the port failed.
    pub(super) const fn is_of_the_port(self) -> bool {
        matches!(self, Self::CutShort(Cut::Lost | Cut::Unusable))
    }

    /// What the unit says by it, if it is a refusal.
    pub(super) const fn means(self, meanings: &Meanings) -> Option<Meaning> {
        match self {
            Self::Refused { code, .. } => Some(meanings.of(code)),
            _ => None,
        }
    }

    /// Whether the unit says by it that it does not give the words of a longer read.
    ///
    /// A code that means "ask again" to a family alone may say so too: what refuses malformed requests refuses too many words.
    pub(super) const fn refuses_words(self, meanings: &Meanings) -> bool {
        self.is_refusal() && !(self.asks_again(meanings) && self.asks_again(&Meanings::STANDARD))
    }

    /// Whether the unit says by it that it could not take a request, this one or one before it, and may the next time.
    pub(super) const fn asks_again(self, meanings: &Meanings) -> bool {
        match self {
            Self::Refused { code, .. } | Self::Wrong(AnswerError::Refusal { code }) => {
                matches!(meanings.of(code), Meaning::AskAgain)
            }
            _ => false,
        }
    }
}

/// A request, or a call, that brought no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Slip {
    pub(super) why: Unanswered,
    pub(super) sent: Option<Instant>,
    pub(super) ended: Instant,
}

/// One request and what came of it, before anything is made of that: for whoever keeps figures.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Exchange<'r> {
    /// Who was asked.
    pub destination: Destination,
    /// What was asked: by the caller, or to find the way back to a unit that may answer something else.
    pub request: Request<'r>,
    /// How long it was waited for at most.
    pub timeout: Duration,
    /// When the first bit of the request went out; `None`: it did not.
    pub sent: Option<Instant>,
    /// When it was over.
    pub ended: Instant,
    /// Why no answer came, if none did.
    pub failure: Option<Unanswered>,
    /// How many bytes came instead of an answer.
    pub bytes: usize,
    /// What was seen beside the answer.
    pub tally: Tally,
}

/// What a call came to.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Outcome<'a> {
    /// It was answered, or the broadcast is out and its time over.
    #[non_exhaustive]
    Answered {
        /// When.
        times: Times,
        /// The answer, with as many words as were asked for. None to a broadcast, and none to a write that was not confirmed
        /// and whose words the unit shows.
        answer: Option<Answer<'a>>,
    },
    /// It was not.
    #[non_exhaustive]
    Failed {
        /// Why.
        why: Unanswered,
        /// When the request went out last; `None`: it never did, so nothing was done.
        sent: Option<Instant>,
        /// When the call ended.
        ended: Instant,
        /// The bytes that came instead of an answer.
        raw: &'a [u8],
        /// What the unit shows where the words were written, if that was read back.
        shows: Option<Words<'a>>,
        /// Whether the port failed twice in a row, and this is how it did the first time: that tells more.
        before: bool,
    },
}

/// An answer, kept without its address and CRC, and what it answers.
#[derive(Clone, Copy)]
pub(super) struct Kept {
    pdu: [u8; MAX_PDU],
    len: usize,
    expected: Option<Expected>,
    /// How many words of it were asked for.
    asked: u16,
}

impl Kept {
    pub(super) const NONE: Self = Self { pdu: [0; MAX_PDU], len: 0, expected: None, asked: 0 };

    pub(super) fn set(&mut self, expected: Expected, answer: &Answer<'_>, asked: u16) {
        self.len = answer.put(&mut self.pdu);
        (self.expected, self.asked) = (Some(expected), asked);
    }

    /// Puts `words`, the first of which is the last that it has, behind its own: then it is the answer to `whole`. Where that
    /// word is another one, there is no answer.
    pub(super) fn goes_on_with(&mut self, whole: Expected, words: Words<'_>) {
        let own = self.expected.take().and_then(|expected| expected.parse(&self.pdu[..self.len]).ok());
        let mut all = [0; MAX_PDU / 2];
        let Some(Answer::Read { table, words: first }) = own else { return };
        let fits = !first.is_empty() && first.get(first.len() - 1) == words.get(0);
        let joined = first.iter().chain(words.iter().skip(1));
        let count = all.iter_mut().zip(joined).map(|(place, word)| *place = word).count();
        if fits && let Ok(answer) = Answer::read_of(table, &all[..count]) {
            self.len = answer.put(&mut self.pdu);
            self.expected = Some(whole);
        }
    }

    pub(super) fn clear(&mut self) {
        self.expected = None;
    }

    /// With as many words as were asked for.
    pub(super) fn answer(&self) -> Option<Answer<'_>> {
        Some(self.expected?.parse(&self.pdu[..self.len]).ok()?.shortened(self.asked))
    }

    /// The words that it carries.
    pub(super) fn words(&self) -> Option<Words<'_>> {
        match self.answer()? {
            Answer::Read { words, .. } => Some(words),
            _ => None,
        }
    }
}

impl core::fmt::Debug for Kept {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Kept({:02X?})", &self.pdu[..self.len])
    }
}
