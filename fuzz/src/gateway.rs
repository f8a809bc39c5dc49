//! Invariant: whatever a client of Modbus TCP sends, in whatever pieces, the requests that come out are those that stand in
//! its bytes, one behind the other, up to the first header that no request has; and after that, none ever.
//!
//! The oracle walks over all the bytes at once, as the guide's §3.1.3 describes a header. The same bytes as RTU over TCP: what
//! comes out is what they begin with, each with its CRC, and less than one frame is kept.

use drivebus_line::gateway::{Framing, Requests};
use drivebus_rtu::MAX_ADU;

use crate::oracle;
use crate::stream::Input;

/// Number, unit and PDU.
type Asked<'a> = (u16, u8, &'a [u8]);

/// What a walk over all the bytes finds: each request, and whether one could not be read.
fn walked(bytes: &[u8]) -> (Vec<Asked<'_>>, bool) {
    let word = |at: usize| Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    let (mut found, mut at) = (Vec::new(), 0);
    loop {
        match word(at + 2) {
            Some(0) => {}
            Some(_) => return (found, true),
            None => return (found, false),
        }
        let Some(length) = word(at + 4) else { return (found, false) };
        if !(2..=254).contains(&length) {
            return (found, true);
        }
        let end = at + 6 + usize::from(length);
        let (Some(number), Some(body)) = (word(at), bytes.get(at + 6..end)) else { return (found, false) };
        found.push((number, body[0], &body[1..]));
        at = end;
    }
}

/// See the file's first lines. The input: a byte, whose value and one more is the length of the pieces, then the bytes.
pub fn gateway(data: &[u8]) {
    let mut input = Input::new(data);
    let piece = usize::from(input.byte()) + 1;
    let bytes = data.get(1..).unwrap_or_default();
    let (mut requests, mut came, mut ended) = (Requests::default(), Vec::new(), None);
    for piece in bytes.chunks(piece) {
        let outcome = requests.take(piece, |asked| came.push((asked.transaction, asked.unit, asked.pdu)));
        assert!(ended.is_none() || outcome.is_err(), "a stream that has ended goes on");
        ended = outcome.err();
    }
    let (there, is_over) = walked(bytes);
    let came: Vec<_> = came.iter().map(|(number, unit, pdu)| (*number, *unit, pdu.as_slice())).collect();
    assert_eq!(came, there, "requests are not those of the bytes");
    assert_eq!(ended.is_some(), is_over, "{ended:?}");
    over_rtu(bytes, piece);
}

fn over_rtu(bytes: &[u8], piece: usize) {
    let (mut requests, mut again, mut is_over) = (Requests::new(Framing::Rtu), Vec::new(), false);
    for piece in bytes.chunks(piece) {
        let outcome = requests.take(piece, |asked| {
            again.extend(oracle::sealed(&[&[asked.unit], &asked.pdu[..]].concat()));
        });
        assert!(!is_over || outcome.is_err(), "a stream that has ended goes on");
        is_over = outcome.is_err();
    }
    assert!(bytes.starts_with(&again), "requests are not those of the bytes");
    assert!(is_over || bytes.len() - again.len() < MAX_ADU, "more is kept than one frame");
}
