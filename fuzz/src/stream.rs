//! The language of the inputs: bytes that a fuzzer mutates well, read as things that happen on a line.
//!
//! A stream is a row of records. The low half of a record's first byte says what comes, the high half how long after
//! what came before ([`GAPS`]). A plain mutation of random bytes would hardly ever give a right CRC; here most records
//! put it behind their bytes, or take up what was sent before, so that what arrives is nearly right.

use std::time::Duration;

use crate::oracle::{frame, sealed};

/// Time before a record, in microseconds, by the high half of its first byte. The silence is 1 750.
pub(crate) const GAPS: [u64; 16] =
    [0, 0, 0, 0, 1, 400, 800, 1_749, 1_750, 1_751, 2_000, 5_000, 16_000, 49_000, 300_000, 900_000];
/// Silence at the end of a frame in every target that chooses it.
pub(crate) const SILENCE: Duration = Duration::from_micros(1_750);
/// More bytes than this in one stream show nothing new.
const MOST: usize = 1_536;

/// What is left of an input. Past its end everything is zero.
#[derive(Debug, Clone)]
pub(crate) struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    /// All of `data`.
    pub(crate) const fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    /// Whether nothing is left.
    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many bytes are left.
    pub(crate) const fn len(&self) -> usize {
        self.0.len()
    }

    /// One byte.
    pub(crate) fn byte(&mut self) -> u8 {
        self.bytes(1).first().copied().unwrap_or_default()
    }

    /// One word, high byte first.
    pub(crate) fn word(&mut self) -> u16 {
        u16::from_be_bytes([self.byte(), self.byte()])
    }

    /// Up to `count` bytes.
    pub(crate) fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (bytes, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        bytes
    }
}

/// Bytes that arrive together, `gap` after those before them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Arrival {
    /// Time since the arrival before.
    pub(crate) gap: Duration,
    /// What arrives; may be nothing.
    pub(crate) bytes: Vec<u8>,
}

/// How many bytes an adapter delivers at a time, and how long it holds back the others.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lumps {
    size: usize,
    pause: Duration,
}

impl Lumps {
    /// Reads one record; `sent` are the requests that went out before, which it may take up.
    pub(crate) fn next(&mut self, input: &mut Input<'_>, sent: &[Vec<u8>]) -> Vec<Arrival> {
        let head = input.byte();
        let gap = Duration::from_micros(GAPS[usize::from(head >> 4)]);
        if head & 0x0F == 15 {
            let how = input.byte();
            self.size = usize::from(how & 0x0F);
            self.pause = Duration::from_micros(GAPS[usize::from(how >> 4)]);
            return vec![Arrival { gap, bytes: Vec::new() }];
        }
        let bytes = piece(head & 0x0F, input, sent);
        if self.size == 0 || bytes.is_empty() {
            return vec![Arrival { gap, bytes }];
        }
        let lump = |(index, part): (usize, &[u8])| Arrival {
            gap: if index == 0 { gap } else { self.pause },
            bytes: part.to_vec(),
        };
        bytes.chunks(self.size).enumerate().map(lump).collect()
    }
}

/// The rest of `input` as a stream.
pub(crate) fn arrivals(input: &mut Input<'_>) -> Vec<Arrival> {
    let mut lumps = Lumps::default();
    let mut stream = Vec::new();
    let mut total = 0;
    while !input.is_empty() && total < MOST {
        let next = lumps.next(input, &[]);
        total += next.iter().map(|arrival| arrival.bytes.len()).sum::<usize>();
        stream.extend(next);
    }
    stream
}

/// The bytes of one record.
fn piece(kind: u8, input: &mut Input<'_>, sent: &[Vec<u8>]) -> Vec<u8> {
    match kind {
        // Anything.
        0 => {
            let len = usize::from(input.byte());
            input.bytes(len).to_vec()
        }
        // Anything, with its CRC.
        1 => {
            let len = usize::from(input.byte());
            sealed(input.bytes(len))
        }
        // A request of two words, or a confirmation, or an echo.
        2 => {
            let [unit, function] = [input.byte(), [3, 6, 8, 16, 3, 6, 8, 4][usize::from(input.byte() & 7)]];
            sealed(&[&[unit, function][..], &input.word().to_be_bytes(), &input.word().to_be_bytes()].concat())
        }
        // The answer to a read: words that rise from the first.
        3 => {
            let [unit, count] = [input.byte(), input.byte() % 126];
            let first = input.word();
            let words = (0..u16::from(count)).flat_map(|n| first.wrapping_add(n).to_be_bytes());
            sealed(&[unit, 3, 2 * count].into_iter().chain(words).collect::<Vec<u8>>())
        }
        // A write of several words.
        4 => {
            let [unit, count] = [input.byte(), input.byte() % 124];
            let address = input.word().to_be_bytes();
            let body = [unit, 16, address[0], address[1], 0, count, 2 * count].into_iter();
            sealed(&body.chain((0..2 * count).map(|n| n ^ address[1])).collect::<Vec<u8>>())
        }
        // An exception.
        5 => sealed(&[input.byte(), input.byte() | 0x80, input.byte()]),
        // One byte again and again, as a line without bias gives.
        6 => vec![[0x00, 0xFF, 0x01, 0x03][usize::from(input.byte() & 3)]; 2 * usize::from(input.byte())],
        // A function without a name, up to the longest frame.
        7 => {
            let body = [input.byte(), 0x41 + input.byte() % 8];
            sealed(
                &body
                    .into_iter()
                    .chain(std::iter::repeat_n(input.byte(), usize::from(input.byte()).min(252)))
                    .collect::<Vec<u8>>(),
            )
        }
        // The right answer to a request that was sent, the last one first.
        8 | 9 => recall(input, sent).map(|request| right_answer(&request, input.word())).unwrap_or_default(),
        // A request that was sent, come back.
        10 => recall(input, sent).unwrap_or_default(),
        // The right answer, damaged.
        11 => {
            let answer = recall(input, sent).map(|request| right_answer(&request, input.word())).unwrap_or_default();
            damaged(answer, input)
        }
        // The right answer with another address, function or byte count and a right CRC.
        12 => {
            let mut answer =
                recall(input, sent).map(|request| right_answer(&request, input.word())).unwrap_or_default();
            answer.truncate(answer.len().saturating_sub(2));
            sealed(&damaged(answer, input))
        }
        // A refusal of a request that was sent.
        13 => recall(input, sent)
            .map(|request| sealed(&[request[0], request[1] | 0x80, input.byte()]))
            .unwrap_or_default(),
        // One byte.
        _ => vec![input.byte()],
    }
}

fn recall(input: &mut Input<'_>, sent: &[Vec<u8>]) -> Option<Vec<u8>> {
    let back = usize::from(input.byte());
    sent.iter().rev().nth(back % sent.len().max(1)).cloned()
}

/// `bytes` with one bit flipped, or without their end.
fn damaged(mut bytes: Vec<u8>, input: &mut Input<'_>) -> Vec<u8> {
    let (how, place) = (input.byte(), usize::from(input.byte()));
    if bytes.is_empty() {
        return bytes;
    }
    let place = place % bytes.len();
    if how & 8 == 0 {
        bytes[place] ^= 1 << (how & 7);
    } else {
        bytes.truncate(place);
    }
    bytes
}

/// The frame that answers `request`; words that are read rise from `first`.
pub(crate) fn right_answer(request: &[u8], first: u16) -> Vec<u8> {
    let Some((unit, pdu)) = frame(request) else {
        return Vec::new();
    };
    match *pdu {
        [3, _, _, _, count] => {
            let words = (0..u16::from(count)).flat_map(|n| first.wrapping_add(n).to_be_bytes());
            sealed(&[unit, 3, count.wrapping_mul(2)].into_iter().chain(words).collect::<Vec<u8>>())
        }
        [16, a1, a0, c1, c0, ..] => sealed(&[unit, 16, a1, a0, c1, c0]),
        _ => request.to_vec(),
    }
}
