//! Questions to a unit of which little is known: what it answers to each, and which refusals are no answer yet.

use drivebus_drives::{Place, Table};
use drivebus_rtu::{ExceptionCode, Meaning, UnitAddress};
use thiserror::Error;

use crate::answer::{Answer, Said};
use crate::task::{Cause, LineError, Mailbox, Read};

/// How often a word is asked for once more where the refusal of it decides nothing. A unit says so at once.
const AGAIN: u32 = 4;

/// What some drives answer where they have nothing, instead of a refusal. That a word of a signature is just this, and means it, is
/// assumed of none.
///
/// Source: *Altivar 71 integrated Modbus* (Schneider 1755863), p. 39, of reads of several words; of reads of one word a program
/// that runs an Altivar 320 tells it.
const NOTHING: u16 = 0x8000;

/// Exceptions by which a gateway says that the unit behind it is out of reach, or silent.
///
/// Source: *Modbus Application Protocol* V1.1b3, §7.
const UNREACHED: [ExceptionCode; 2] = [ExceptionCode(0x0A), ExceptionCode(0x0B)];

/// Why a unit did not say what it was asked. `E` is the error of whoever drives.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NotTold<E> {
    /// The line failed, or the question was not put.
    #[error("{0}")]
    Failed(E),
    /// It refused each time, as one that is busy or gets damaged requests.
    #[error(
        "unit {} is busy, or gets requests damaged: it refused {place} with exception {:02X}H {times} times",
        unit.get(), code.0
    )]
    Busy {
        /// Which unit.
        unit: UnitAddress,
        /// Where it was asked.
        place: Place,
        /// How it refused at last.
        code: ExceptionCode,
        /// How often it did.
        times: u32,
        /// The last refusal.
        last: E,
    },
    /// A gateway says that the unit behind it is silent or out of reach.
    #[error("no answer of unit {}, says a gateway (exception {:02X}H)", unit.get(), code.0)]
    Unreached {
        /// Which unit.
        unit: UnitAddress,
        /// How the gateway says it.
        code: ExceptionCode,
    },
}

impl<E: LineError> NotTold<E> {
    /// What went wrong, as whoever asks looks at it: one that is always busy gives no answer that counts.
    pub fn cause(&self) -> Cause {
        match self {
            Self::Failed(error) => error.cause(),
            Self::Busy { .. } => Cause::BadAnswer,
            Self::Unreached { .. } => Cause::NoAnswer,
        }
    }
}

/// Whether `code` is how a gateway says that it does not reach the unit.
pub(crate) fn is_unreached(code: ExceptionCode) -> bool {
    UNREACHED.contains(&code)
}

/// How a unit answers one question for a word, whatever a refusal of it means.
///
/// # Errors
///
/// What whoever drives made of it, but for a refusal.
pub async fn answer_once<E: LineError>(line: &Mailbox<E>, read: Read) -> Result<Answer, E> {
    match line.read(read).await {
        Ok(words) => Ok(answered(read, &words)),
        Err(error) => match error.cause() {
            Cause::Refused(code, _) => Ok(refused(read, code)),
            _ => Err(error),
        },
    }
}

/// How a unit of which nothing is known answers the question for a word.
///
/// A refusal by which it decides nothing is no answer: it is asked again. So is one by 01H for holding registers: each
/// family reads them, and one says by that code that the request came damaged.
///
/// # Errors
///
/// [`NotTold::Failed`], and [`NotTold::Busy`] where it says each time that it is busy, or gets requests damaged.
pub async fn answer_at<E: LineError>(line: &Mailbox<E>, read: Read) -> Result<Answer, NotTold<E>> {
    let mut times = 0;
    loop {
        let last = match line.read(read).await {
            Ok(words) => return Ok(answered(read, &words)),
            Err(error) => error,
        };
        let Cause::Refused(code, meaning) = last.cause() else {
            return Err(NotTold::Failed(last));
        };
        times += 1;
        let decides = is_unreached(code) || meaning != Meaning::AskAgain;
        let is_odd = code == ExceptionCode::ILLEGAL_FUNCTION && read.place.table == Table::Holding;
        if times <= AGAIN && (is_odd || !decides) {
            continue;
        }
        if !decides {
            return Err(NotTold::Busy { unit: read.unit, place: read.place, code, times, last });
        }
        return Ok(refused(read, code));
    }
}

fn answered(read: Read, words: &[u16]) -> Answer {
    // One is there: a step takes as many words as were asked for.
    match words.first().copied().unwrap_or_default() {
        NOTHING if !read.place.table.is_bits() => refused(read, ExceptionCode::ILLEGAL_ADDRESS),
        word => Answer::word_at(read.place, word),
    }
}

fn refused(read: Read, code: ExceptionCode) -> Answer {
    Answer { place: read.place, said: Said::Refused(code) }
}
