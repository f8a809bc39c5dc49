//! What Modbus says, written a second time: slow, plain, and sharing nothing with the crates that are judged by it.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6 and §7; *Modbus over Serial Line* V1.02, §2.5.1.

/// CRC-16/MODBUS by the division that defines it: one bit at a time, as it leaves the wire.
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(EMPTY_CRC, |register, &byte| crc_after(register, byte))
}

/// The CRC of nothing.
pub(crate) const EMPTY_CRC: u16 = 0xFFFF;

/// The CRC of what had `register`, and `byte` behind it. Zero behind a whole frame.
pub(crate) fn crc_after(register: u16, byte: u8) -> u16 {
    (0..8).map(|place| u16::from(byte >> place & 1)).fold(register, |register, bit| {
        let out = (register ^ bit) & 1;
        (register >> 1) ^ (out * 0xA001)
    })
}

/// `body` with its CRC behind it.
pub(crate) fn sealed(body: &[u8]) -> Vec<u8> {
    let crc = crc(body);
    [body, &[crc.to_le_bytes()[0], crc.to_le_bytes()[1]]].concat()
}

/// Address and PDU of `bytes`, if they are one whole frame.
pub(crate) fn frame(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let (body, end) = bytes.split_at_checked(bytes.len().checked_sub(2)?)?;
    let whole = (4..=256).contains(&bytes.len()) && crc(body).to_le_bytes() == *end;
    body.split_first().filter(|_| whole).map(|(address, pdu)| (*address, pdu))
}

fn word(bytes: &[u8], at: usize) -> usize {
    usize::from(bytes[at]) << 8 | usize::from(bytes[at + 1])
}

/// Whether a master may ask `pdu`.
pub(crate) fn is_request(pdu: &[u8]) -> bool {
    let in_range = |max: usize| (1..=max).contains(&word(pdu, 3)) && word(pdu, 1) + word(pdu, 3) <= 65_536;
    match (pdu.first(), pdu.len()) {
        (None | Some(0 | 0x80..), _) | (_, 254..) => false,
        (Some(1 | 2), len) => len == 5 && in_range(2000),
        (Some(3 | 4), len) => len == 5 && in_range(125),
        (Some(5), len) => len == 5 && matches!(word(pdu, 3), 0 | 0xFF00),
        (Some(6), len) => len == 5,
        (Some(8), len) => len < 3 || word(pdu, 1) != 0 || len == 5,
        (Some(16), len) => {
            len >= 6 && in_range(123) && usize::from(pdu[5]) == 2 * word(pdu, 3) && len == 6 + 2 * word(pdu, 3)
        }
        _ => true,
    }
}

/// Whether a unit may answer `pdu` to anything at all.
pub(crate) fn is_answer(pdu: &[u8]) -> bool {
    match (pdu.first(), pdu.len()) {
        (None, _) | (_, 254..) => false,
        (Some(0x80..), len) => len == 2,
        (Some(1 | 2), len) => (3..=252).contains(&len) && usize::from(pdu[1]) == len - 2,
        (Some(3 | 4), len) => len >= 4 && len % 2 == 0 && usize::from(pdu[1]) == len - 2,
        (Some(5), len) => len == 5 && matches!(word(pdu, 3), 0 | 0xFF00),
        (Some(6 | 16), len) => len == 5,
        (Some(8), len) => len < 3 || word(pdu, 1) != 0 || len == 5,
        _ => true,
    }
}

/// What a PDU is to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// What was asked for.
    Right,
    /// An exception to it.
    Refusal,
    /// Neither.
    Wrong,
}

/// What is known of the length of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Length {
    /// The function says it.
    Named,
    /// The PDU is the caller's own, and the caller said how many bytes its answer has.
    Given(u8),
    /// The PDU is the caller's own, and only silence tells.
    Any,
}

/// A request as the judge knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Asked {
    /// The whole PDU.
    pub(crate) pdu: Vec<u8>,
    /// What is known of its answer's length.
    pub(crate) length: Length,
}

impl Asked {
    /// What `answer` is to this request.
    pub(crate) fn judge(&self, answer: &[u8]) -> Verdict {
        let function = self.pdu[0];
        let right = match (answer.first(), self.length) {
            (Some(&came), _) if came == function | 0x80 && answer.len() == 2 => return Verdict::Refusal,
            (Some(&came), _) if came != function => false,
            (Some(_), Length::Any) => fits(&self.pdu, answer),
            // Who gives a length knows better.
            (Some(_), Length::Given(len)) => usize::from(len) == answer.len(),
            (Some(read @ 1..=4), Length::Named) => {
                let count = word(&self.pdu, 3);
                let bytes = if *read < 3 { count.div_ceil(8) } else { 2 * count };
                answer.len() == 2 + bytes && usize::from(answer[1]) == bytes
            }
            (Some(15 | 16), Length::Named) => answer == &self.pdu[..5],
            (Some(0x11), Length::Named) => answer.len() > 2 && usize::from(answer[1]) == answer.len() - 2,
            (Some(0x17), Length::Named) => {
                let bytes = 2 * word(&self.pdu, 3);
                answer.len() == 2 + bytes && usize::from(answer[1]) == bytes
            }
            (Some(0x2B), Length::Named) => identifies(&self.pdu, answer),
            (Some(_), Length::Named) => answer == self.pdu,
            (None, _) => false,
        };
        if right { Verdict::Right } else { Verdict::Wrong }
    }
}

/// Whether `answer` brings objects of an identification that `asked` may ask for (§6.21).
fn identifies(asked: &[u8], answer: &[u8]) -> bool {
    let &[_, 0x0E, level, conformity, more, next, count, ref objects @ ..] = answer else { return false };
    let (mut numbers, mut rest) = (Vec::new(), objects);
    while let [number, len, behind @ ..] = rest {
        if behind.len() < usize::from(*len) {
            return false;
        }
        numbers.push(*number);
        rest = &behind[usize::from(*len)..];
    }
    let most = [2, 0x7F, 0xFF, 0xFF][usize::from(asked[2]) - 1];
    let rising = numbers.windows(2).all(|pair| pair[0] < pair[1]);
    let goes_on = match (more, numbers.last()) {
        (0, _) => true,
        (0xFF, Some(&last)) => next > last && asked[2] < 4,
        _ => false,
    };
    let begins = match (asked[2], numbers.first()) {
        (4, first) => numbers.len() == 1 && first == Some(&asked[3]),
        (_, None) => true,
        (_, Some(&first)) => asked[3] == 0 || first == 0 || first == asked[3],
    };
    level == asked[2]
        && [1, 2, 3, 0x81, 0x82, 0x83].contains(&conformity)
        && rest.is_empty()
        && numbers.len() == usize::from(count)
        && numbers.iter().all(|&number| number <= most)
        && rising
        && goes_on
        && begins
}

/// The frames in `bytes`, which begin and end with silence; `Err` stands for a byte that belongs to none.
///
/// A frame whose length its function tells is heard at its last byte, unless one that began earlier may still be under
/// way; what is left when the line falls silent may be one as a whole, or hold some. The earliest and then the shortest
/// wins. Found by trying: slow.
pub(crate) fn frames_in(bytes: &[u8]) -> Vec<Result<&[u8], u8>> {
    let mut heard = Vec::new();
    let mut rest = bytes;
    for silent in [false, true] {
        while let Some((start, len)) = first_in(rest, silent) {
            heard.extend(rest[..start].iter().map(|&byte| Err(byte)));
            heard.push(Ok(&rest[start..start + len]));
            rest = &rest[start + len..];
        }
    }
    heard.extend(rest.iter().map(|&byte| Err(byte)));
    heard
}

/// Where the first frame of `bytes` begins and how long it is; `silent`: nothing more will come.
fn first_in(bytes: &[u8], silent: bool) -> Option<(usize, usize)> {
    for start in 0..bytes.len() {
        let here = &bytes[start..];
        let lengths = lengths(here);
        let whole = (silent && start == 0).then_some(here.len());
        let is_frame = |len: &usize| here.get(..*len).is_some_and(|part| frame(part).is_some());
        if let Some(len) = lengths.iter().copied().chain(whole).find(is_frame) {
            return Some((start, len));
        }
        let unnamed = start == 0 && here.len() <= 256 && matches!(here, [..=247, 1..=127, ..]) && lengths.is_empty();
        let under_way = matches!(here, [..=247]) || unnamed || lengths.iter().any(|&len| len > here.len());
        if under_way && !silent {
            return None;
        }
    }
    None
}

/// How long a frame of either direction that begins with `here` can be, shortest first, where its function tells.
pub(crate) fn lengths(here: &[u8]) -> Vec<usize> {
    let even = |at: usize, most: u8| here.get(at).filter(|&&bytes| bytes >= 2 && bytes <= most && bytes % 2 == 0);
    let mut lengths = match here {
        [248..=255, ..] => vec![],
        [_, 1 | 2, ..] => {
            let bytes = here.get(2).filter(|&&bytes| (1..=250).contains(&bytes));
            vec![Some(8), bytes.map(|&bytes| 5 + usize::from(bytes))]
        }
        [_, 3 | 4, ..] => vec![Some(8), even(2, 250).map(|&bytes| 5 + usize::from(bytes))],
        [_, 16, ..] => vec![Some(8), even(6, 246).map(|&bytes| 9 + usize::from(bytes))],
        [_, 5 | 6 | 8, ..] => vec![Some(8)],
        [_, 0x81..=0xFF, ..] => vec![Some(5)],
        _ => vec![],
    };
    lengths.sort_unstable();
    lengths.into_iter().flatten().collect()
}

/// Whether the specification lets `answer` be one to `asked`, both of the same function, which is the caller's own PDU.
///
/// Of a request that is not as the specification says, nothing is said.
fn fits(asked: &[u8], answer: &[u8]) -> bool {
    let counted =
        |bytes: usize| !(1..=251).contains(&bytes) || (answer.len() == 2 + bytes && usize::from(answer[1]) == bytes);
    let own_count = || answer.len() >= 2 && usize::from(answer[1]) == answer.len() - 2;
    let back = |count: usize, len: usize| answer.len() == len && answer[..=count] == asked[..=count];
    let is_whole = |at: usize| asked.len() > at && usize::from(asked[at]) == asked.len() - at - 1;
    match (asked[0], asked.len()) {
        (1 | 2, 5) => counted(word(asked, 3).div_ceil(8)),
        (4, 5) => counted(2 * word(asked, 3)),
        (7, 1) => answer.len() == 2,
        (5, 5) => back(4, 5),
        (8, 5) if [0, 1, 3, 10, 20].contains(&word(asked, 1)) => back(4, 5),
        (8, 5) => back(2, 5),
        (0x0B, 1) => answer.len() == 5,
        (0x0C | 0x11, 1) => own_count(),
        (0x0F, _) if is_whole(5) => back(4, 5),
        (0x14, _) if is_whole(1) && (asked.len() - 2).is_multiple_of(7) => {
            counted(asked[2..].chunks(7).map(|record| 2 + 2 * word(record, 5)).sum())
        }
        (0x15, len) if is_whole(1) => back(6.min(len - 1), len),
        (0x16, 7) => back(6, 7),
        (0x17, _) if is_whole(9) => counted(2 * word(asked, 3)),
        (0x18, 3) => {
            answer.len() >= 5 && word(answer, 1) == answer.len() - 3 && 2 * word(answer, 3) == answer.len() - 5
        }
        (0x2B, 4) if asked[1] == 0x0E => answer.len() >= 3 && answer[1..3] == asked[1..3],
        (0x2B, 2..) => answer.get(1) == asked.get(1),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oracle_knows_printed_frames() {
        // INVT GD350 IP54 manual, 9.4.1 and 9.4.3.
        let read = [0x01, 0x03, 0x00, 0x04, 0x00, 0x02, 0x85, 0xCA];
        let answer = [0x01, 0x03, 0x04, 0x13, 0x88, 0x00, 0x00, 0x7E, 0x9D];
        let echo = [0x01, 0x08, 0x00, 0x00, 0x12, 0xAB, 0xAD, 0x14];
        assert_eq!(crc(b"123456789"), 0x4B37); // reveng's check value of CRC-16/MODBUS
        assert_eq!(sealed(&read[..6]), read);
        assert_eq!(frame(&read), Some((1, &read[1..6])));
        assert!(is_request(&read[1..6]) && is_answer(&answer[1..7]) && is_request(&echo[1..6]));
        let asked = Asked { pdu: read[1..6].to_vec(), length: Length::Named };
        assert_eq!(asked.judge(&answer[1..7]), Verdict::Right);
        assert_eq!(asked.judge(&[0x83, 0x02]), Verdict::Refusal);
        assert_eq!(asked.judge(&answer[1..5]), Verdict::Wrong);
        let stream = [&read[..], &[0xFF], &answer[..], &[0x00], &echo[..]].concat();
        let heard = frames_in(&stream);
        assert_eq!(heard, [Ok(&read[..]), Err(0xFF), Ok(&answer[..]), Err(0x00), Ok(&echo[..])]);
    }
}
