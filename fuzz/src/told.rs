//! What a master says, kept, and the PDUs of requests and answers, put together without the crate that is judged.

use drivebus_rtu::{Answer, AnswerError, Event, Request, Table};

/// An event, kept.
#[derive(Debug, PartialEq)]
pub(crate) enum Said {
    Transmit(Vec<u8>),
    Answer { pdu: Vec<u8>, exception: bool },
    Wrong { frame: Vec<u8>, error: AnswerError },
    Corrupt(Vec<u8>),
    NoAnswer(Vec<u8>),
    BroadcastDone,
    Busy,
}

impl Said {
    pub(crate) fn of(event: Event<'_>) -> Self {
        match event {
            Event::Transmit(frame) => Self::Transmit(frame.to_vec()),
            Event::Answer(answer) => {
                Self::Answer { pdu: pdu_told(&answer), exception: matches!(answer, Answer::Exception { .. }) }
            }
            Event::Wrong { error, frame } => Self::Wrong { frame: frame.to_vec(), error },
            Event::Corrupt { bytes, .. } => Self::Corrupt(bytes.to_vec()),
            Event::NoAnswer { bytes } => Self::NoAnswer(bytes.to_vec()),
            Event::BroadcastDone => Self::BroadcastDone,
            Event::Busy => Self::Busy,
            new => unreachable!("{new:?} is not judged here"),
        }
    }
}

fn four(function: u8, first: u16, second: u16) -> Vec<u8> {
    [&[function][..], &first.to_be_bytes(), &second.to_be_bytes()].concat()
}

/// Bits, eight to a byte, the first the lowest.
fn bytes_of(bits: impl Iterator<Item = u16>) -> Vec<u8> {
    let bits: Vec<u8> = bits.map(|word| u8::from(word != 0)).collect();
    bits.chunks(8).map(|byte| byte.iter().rev().fold(0, |all, bit| all << 1 | bit)).collect()
}

/// The PDU of a request, put together here.
pub(crate) fn pdu_of(request: &Request<'_>) -> Vec<u8> {
    match *request {
        Request::Read { table, address, count, .. } => four(table.function(), address, count),
        Request::WriteCoil { address, on, .. } => four(5, address, if on { 0xFF00 } else { 0 }),
        Request::WriteSingle { address, value, .. } => four(6, address, value),
        Request::Echo { data, .. } => four(8, 0, data),
        Request::WriteMultiple { address, words, .. } => {
            let count = u8::try_from(words.len()).unwrap_or(0);
            let mut pdu = four(16, address, count.into());
            pdu.push(2 * count);
            pdu.extend(words.iter().flat_map(u16::to_be_bytes));
            pdu
        }
        Request::WriteCoils { address, words, .. } => {
            let bytes = bytes_of(words.iter());
            let mut pdu = four(15, address, u16::try_from(words.len()).unwrap_or(0));
            pdu.push(u8::try_from(bytes.len()).unwrap_or(0));
            pdu.extend(bytes);
            pdu
        }
        Request::ReportServerId => vec![0x11],
        Request::MaskWrite { address, and, or, .. } => [&four(0x16, address, and)[..], &or.to_be_bytes()].concat(),
        Request::ReadWrite { address, count, write_address, words, .. } => {
            let written = u8::try_from(words.len()).unwrap_or(0);
            let mut pdu = four(0x17, address, count);
            pdu.extend(four(0, write_address, written.into()).into_iter().skip(1));
            pdu.push(2 * written);
            pdu.extend(words.iter().flat_map(u16::to_be_bytes));
            pdu
        }
        Request::ReadIdentification { level, object, .. } => vec![0x2B, 0x0E, level.code(), object],
        Request::Custom { pdu, .. } => pdu.to_vec(),
        new => unreachable!("{new:?} is not judged here"),
    }
}

/// The PDU that an answer must have been told by, put together here.
pub(crate) fn pdu_told(answer: &Answer<'_>) -> Vec<u8> {
    match *answer {
        Answer::Read { table: table @ (Table::Coil | Table::Discrete), words, .. } => {
            let bytes = bytes_of(words.iter());
            [&[table.function(), u8::try_from(bytes.len()).unwrap_or(0)][..], &bytes].concat()
        }
        Answer::WriteCoil { address, on, .. } => four(5, address, if on { 0xFF00 } else { 0 }),
        Answer::Read { table, words, .. } => {
            let count = u8::try_from(2 * words.len()).unwrap_or(0);
            [table.function(), count].into_iter().chain(words.iter().flat_map(u16::to_be_bytes)).collect()
        }
        Answer::WriteSingle { address, value, .. } => four(6, address, value),
        Answer::Echo { data, .. } => four(8, 0, data),
        Answer::WriteMultiple { address, count, .. } => four(16, address, count),
        Answer::Exception { function, code, .. } => vec![function | 0x80, code.0],
        Answer::WriteCoils { address, count, .. } => four(15, address, count),
        Answer::ServerId { data, .. } => [&[0x11, u8::try_from(data.len()).unwrap_or(0)][..], data].concat(),
        Answer::MaskWrite { address, and, or, .. } => [&four(0x16, address, and)[..], &or.to_be_bytes()].concat(),
        Answer::ReadWrite { words, .. } => {
            let count = u8::try_from(2 * words.len()).unwrap_or(0);
            [0x17, count].into_iter().chain(words.iter().flat_map(u16::to_be_bytes)).collect()
        }
        Answer::Identification { page, .. } => page.pdu().to_vec(),
        Answer::Custom { pdu, .. } => pdu.to_vec(),
        new => unreachable!("{new:?} is not judged here"),
    }
}
