//! What is asked, and what is made of the answer: the same for who waits and for a future.

use drivebus_line::{DeviceQuestion, Reply};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Frame, UnitAddress};

use crate::error::Error;

/// The words of an answer to a read.
pub(crate) fn words(answer: &Answer<'_>) -> Vec<u16> {
    match answer {
        Answer::Read { words, .. } => words.iter().collect(),
        _ => Vec::new(),
    }
}

/// The words of a reply to a read of `count`: bits come in whole bytes.
pub(crate) fn words_of(reply: &Reply, count: u16) -> Vec<u16> {
    Answer::parse(&reply.pdu).map(|answer| words(&answer.shortened(count))).unwrap_or_default()
}

/// Goes on after `error` where that is a refusal, and `question` has something less to ask for.
pub(crate) fn asks_less(question: &mut DeviceQuestion, error: Error) -> Result<(), Error> {
    let refused = error.code().is_some_and(|code| question.refused(ExceptionCode(code)));
    if refused { Ok(()) } else { Err(error) }
}

/// The answer's PDU as it came.
pub(crate) fn pdu(unit: UnitAddress, answer: &Answer<'_>) -> Vec<u8> {
    let frame = Adu::answer(unit, answer);
    Frame::parse(frame.as_bytes()).map(|frame| frame.pdu().to_vec()).unwrap_or_default()
}
