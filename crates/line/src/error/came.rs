//! What came instead of an answer, in words: whole frames by what they say, and how many bytes are none.

use std::fmt::Write as _;

use drivebus_rtu::{Duration, Frame, Framer, Instant, function};

/// Things that are told one by one; of more, only that there are more.
const TOLD: usize = 3;

/// `raw`, which came where `request` was asked and is not its answer.
pub(super) fn in_words(request: &Frame<'_>, raw: &[u8]) -> String {
    let mut told = Vec::new();
    let mut framer = Framer::new(Duration::from_nanos(1));
    let mut now = Instant::ZERO;
    let mut rest = raw;
    let mut loose = 0;
    while !rest.is_empty() {
        rest = &rest[framer.receive(now, rest)..];
        now = now + Duration::from_nanos(1);
        while let Some(found) = framer.poll(now) {
            match found {
                Ok(frame) => {
                    loose_bytes(&mut told, &mut loose, raw);
                    told.push(of_frame(request, &frame));
                }
                Err(skipped) => loose += skipped.bytes.len(),
            }
        }
    }
    loose_bytes(&mut told, &mut loose, raw);
    told.dedup();
    if told.len() > TOLD {
        told.truncate(TOLD);
        told.push("more".to_owned());
    }
    told.join(", ")
}

fn loose_bytes(told: &mut Vec<String>, loose: &mut usize, raw: &[u8]) {
    match std::mem::take(loose) {
        0 => {}
        1 => told.push("1 byte that is no frame".to_owned()),
        count if count == raw.len() && is_text(raw) => {
            told.push(format!("the text \"{}\", no frame", String::from_utf8_lossy(raw).trim().escape_default()));
        }
        count => told.push(format!("{count} bytes that are no frame")),
    }
}

/// Whether `bytes` were written for people.
fn is_text(bytes: &[u8]) -> bool {
    bytes.len() >= 4 && bytes.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\r' | b'\n' | b'\t'))
}

/// What `frame` is, beside `request`.
fn of_frame(request: &Frame<'_>, frame: &Frame<'_>) -> String {
    if frame.as_bytes() == request.as_bytes() {
        return "the request itself, sent back".to_owned();
    }
    let (asked, came) = (first(request.pdu()), first(frame.pdu()));
    let is_refusal = came & function::EXCEPTION_BIT != 0;
    let mut text = match (is_refusal, frame.pdu()) {
        (true, [_, code]) => {
            format!("a refusal of function {:02X}H (exception {code:02X}H)", came & !function::EXCEPTION_BIT)
        }
        _ => format!("a whole frame of function {came:02X}H"),
    };
    if frame.address() != request.address() {
        let _ = write!(text, " of unit {}", frame.address());
    } else if came & !function::EXCEPTION_BIT != asked {
        let _ = write!(text, " where {asked:02X}H was asked");
    } else {
        // What fits is kept from being the answer by one thing only.
        text.push_str(" under another transaction number");
    }
    text
}

fn first(pdu: &[u8]) -> u8 {
    pdu.first().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::crc16;

    use super::*;

    fn frame(body: &[u8]) -> Vec<u8> {
        [body, &crc16(body).to_le_bytes()].concat()
    }

    #[test]
    fn what_came_is_told_by_what_it_is() {
        let request = frame(&[1, 3, 0x07, 0xFF, 0, 1]);
        let words = |raw: &[u8]| in_words(&Frame::parse(&request).unwrap(), raw);
        assert_eq!(words(&[0x83, 0x02]), "2 bytes that are no frame");
        assert_eq!(words(&[0x83]), "1 byte that is no frame");
        assert_eq!(words(b"login: \r\n"), "the text \"login:\", no frame");
        assert_eq!(words(&frame(&[1, 0xA3, 0])), "a refusal of function 23H (exception 00H) where 03H was asked");
        assert_eq!(words(&frame(&[0, 3, 2, 0, 1])), "a whole frame of function 03H of unit 0");
        assert_eq!(words(&frame(&[1, 4, 2, 0, 1])), "a whole frame of function 04H where 03H was asked");
        assert_eq!(words(&request), "the request itself, sent back");
        let fits = "a whole frame of function 03H under another transaction number";
        assert_eq!(words(&frame(&[1, 3, 2, 0, 1])), fits);
        let both = [&[0xFF][..], &frame(&[7, 3, 2, 0, 1])].concat();
        assert_eq!(words(&both), "1 byte that is no frame, a whole frame of function 03H of unit 7");
        let many: Vec<u8> = (2..8).flat_map(|unit| frame(&[unit, 3, 2, 0, 1])).collect();
        assert!(words(&many).ends_with("of unit 4, more"), "{}", words(&many));
    }

    #[test]
    fn any_bytes_have_words() {
        let request = frame(&[1, 3, 0, 0, 0, 1]);
        let request = Frame::parse(&request).unwrap();
        let mut mixed = 1_u32;
        for len in 1..600 {
            let raw: Vec<u8> = (0..len)
                .map(|_| {
                    mixed = mixed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    mixed.to_be_bytes()[0]
                })
                .collect();
            assert!(!in_words(&request, &raw).is_empty());
        }
    }
}
