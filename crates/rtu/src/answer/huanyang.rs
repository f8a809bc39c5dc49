//! Answers of units that speak Huanyang's own protocol.

use super::{Answer, AnswerError, Head, MOST};
use crate::huanyang::Huanyang;
use crate::pdu::function::EXCEPTION_BIT;
use crate::pdu::{ExceptionCode, MAX_PDU};
use crate::request::Request;

impl Huanyang {
    /// `pdu`, of this function or its refusal, as the answer.
    ///
    /// A refusal has no code: 02H is told of one to a read, 03H of one to a write.
    pub(crate) fn judge(self, pdu: &[u8]) -> Result<Answer<'_>, AnswerError> {
        if pdu.first().is_some_and(|function| function & EXCEPTION_BIT != 0) {
            let code = if self.is_write() { ExceptionCode::ILLEGAL_VALUE } else { ExceptionCode::ILLEGAL_ADDRESS };
            return match pdu {
                [_, _] | [_, 1, _] => Ok(Answer::exception(self.function(), code)),
                _ => Err(AnswerError::Length { len: pdu.len() }),
            };
        }
        let is_right = match (self, pdu) {
            (Self::ReadParameter { number }, [_, 2, came, _] | [_, 3, came, _, _])
            | (Self::ReadStatus { number }, [_, 3, came, _, _]) => *came == number,
            (Self::WriteParameter { number, value }, [_, 3, came, high, low]) => {
                *came == number && value == u16::from_be_bytes([*high, *low])
            }
            (Self::WriteParameter { number, value }, [_, 2, came, low]) => *came == number && value == u16::from(*low),
            (Self::Control { .. }, [_, 1, _]) => true,
            (Self::SetFrequency { value }, [_, 2, high, low]) => value == u16::from_be_bytes([*high, *low]),
            _ => return Err(AnswerError::Length { len: pdu.len() }),
        };
        if is_right {
            return Ok(Answer::Custom { pdu });
        }
        let mut asked = [0; MAX_PDU];
        let len = self.put(&mut asked);
        Err(AnswerError::Repeat { asked: Head::of(&asked[1..len], MOST), came: Head::of(&pdu[1..], MOST) })
    }

    /// What was asked by `request` is answered by `answer` to this: the same as a unit of Modbus would have said it. The word
    /// that was read goes to `word`.
    pub fn as_answered<'a>(self, answer: Answer<'a>, request: &Request<'a>, word: &'a mut [u16; 1]) -> Answer<'a> {
        let Answer::Custom { pdu } = answer else { return answer };
        match *pdu {
            [_, 2, _, low] if !self.is_write() => word[0] = low.into(),
            [_, 3, _, high, low] if !self.is_write() => word[0] = u16::from_be_bytes([high, low]),
            _ => return Answer::confirming(request).unwrap_or(answer),
        }
        Answer::read(word).unwrap_or(answer)
    }
}
