//! What clients of Modbus TCP send, taken apart: one request after the other, or why the connection cannot go on.

use crate::ports::mbap::{MAX_BODY, MIN_BODY, message};

/// One request, as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Asked {
    /// The client's number for it, which its answer brings back.
    pub transaction: u16,
    /// Whom it is for.
    pub unit: u8,
    /// Function and data: 1..=253 bytes.
    pub pdu: Vec<u8>,
}

/// Bytes that are no request of Modbus TCP. Nothing tells where the next one begins, so the connection has to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotModbus {
    /// The header names another protocol.
    #[error("protocol {0} in the header, where Modbus has 0")]
    #[non_exhaustive]
    Protocol(u16),
    /// No request has that length.
    #[error("length {0} in the header, where Modbus has {MIN_BODY} to {MAX_BODY}")]
    #[non_exhaustive]
    Length(u16),
}

/// The requests in what comes over one connection, in whatever pieces it comes.
///
/// It keeps less than one request, and looks at each header before the rest of it has come.
#[derive(Debug, Default)]
pub struct Requests {
    /// What is not taken apart yet.
    bytes: Vec<u8>,
    wrong: Option<NotModbus>,
}

impl Requests {
    /// Takes what came, and gives each request that is complete by now to `ask`.
    ///
    /// # Errors
    ///
    /// [`NotModbus`]: what follows the last request cannot be read, now and from now on.
    pub fn take(&mut self, bytes: &[u8], mut ask: impl FnMut(Asked)) -> Result<(), NotModbus> {
        if let Some(wrong) = self.wrong {
            return Err(wrong);
        }
        self.bytes.extend_from_slice(bytes);
        let mut rest = &self.bytes[..];
        let outcome = loop {
            match first(rest) {
                Ok(Some((asked, behind))) => {
                    ask(asked);
                    rest = behind;
                }
                Ok(None) => break Ok(()),
                Err(wrong) => break Err(wrong),
            }
        };
        let taken = self.bytes.len() - rest.len();
        self.bytes.drain(..taken);
        self.wrong = outcome.err();
        outcome
    }

    /// Whether a request has begun and is not complete.
    pub fn has_begun(&self) -> bool {
        !self.bytes.is_empty()
    }
}

/// The request that `bytes` begin with, and what is behind it; `None` while it is not complete.
fn first(bytes: &[u8]) -> Result<Option<(Asked, &[u8])>, NotModbus> {
    if let [_, _, high, low, ..] = *bytes
        && [high, low] != [0, 0]
    {
        return Err(NotModbus::Protocol(u16::from_be_bytes([high, low])));
    }
    let [t1, t0, _, _, high, low, ref body @ ..] = *bytes else { return Ok(None) };
    let length = u16::from_be_bytes([high, low]);
    if !(MIN_BODY..=MAX_BODY).contains(&usize::from(length)) {
        return Err(NotModbus::Length(length));
    }
    let Some((body, behind)) = body.split_at_checked(usize::from(length)) else { return Ok(None) };
    let Some((&unit, pdu)) = body.split_first() else { return Ok(None) };
    Ok(Some((Asked { transaction: u16::from_be_bytes([t1, t0]), unit, pdu: pdu.to_vec() }, behind)))
}

/// The message that brings `pdu` back as the answer of `unit` to `transaction`.
pub(super) fn answer(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    message(transaction, &[&[unit], pdu])
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::ports::mbap::PREFIX;

    fn asked() -> impl Strategy<Value = Asked> {
        (any::<u16>(), any::<u8>(), vec(any::<u8>(), 1..=253)).prop_map(|(transaction, unit, pdu)| Asked {
            transaction,
            unit,
            pdu,
        })
    }

    fn taken(requests: &mut Requests, pieces: &[&[u8]]) -> (Vec<Asked>, Result<(), NotModbus>) {
        let mut found = Vec::new();
        let outcome = pieces.iter().try_for_each(|piece| requests.take(piece, |asked| found.push(asked)));
        (found, outcome)
    }

    /// The frame of the guide's §3.1.3, and of the specification V1.1b3, §6.3: read 3 words from 6BH.
    #[test]
    fn one_of_the_specification() {
        let bytes = [0x15, 0x01, 0, 0, 0, 6, 0xFF, 0x03, 0x00, 0x6B, 0x00, 0x03];
        let (found, outcome) = taken(&mut Requests::default(), &[&bytes]);
        assert_eq!(found, [Asked { transaction: 0x1501, unit: 0xFF, pdu: vec![3, 0, 0x6B, 0, 3] }]);
        assert_eq!(outcome, Ok(()));
        assert_eq!(answer(0x1501, 0xFF, &[0x83, 2]), [0x15, 0x01, 0, 0, 0, 3, 0xFF, 0x83, 2]);
    }

    /// Each length that a header can name.
    #[test]
    fn a_length_that_no_request_has() {
        for length in 0..=u16::MAX {
            let [high, low] = length.to_be_bytes();
            let (found, outcome) = taken(&mut Requests::default(), &[&[0, 1, 0, 0, high, low]]);
            assert!(found.is_empty());
            assert_eq!(outcome.is_ok(), (2..=254).contains(&length), "{length}");
        }
    }

    /// A protocol that is not Modbus is seen before the rest of the header is there, and for good.
    #[test]
    fn another_protocol() {
        let mut requests = Requests::default();
        let (_, outcome) = taken(&mut requests, &[b"GET "]);
        assert_eq!(outcome, Err(NotModbus::Protocol(0x5420)));
        assert_eq!(taken(&mut requests, &[&[0, 1, 0, 0, 0, 2, 1, 3]]), (vec![], outcome));
    }

    proptest! {
        #[test]
        fn pieces_do_not_matter(all in vec(asked(), 0..6), cuts in vec(any::<prop::sample::Index>(), 0..12)) {
            let bytes: Vec<u8> = all.iter().flat_map(|one| answer(one.transaction, one.unit, &one.pdu)).collect();
            let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(bytes.len() + 1)).chain([0, bytes.len()]).collect();
            cuts.sort_unstable();
            let pieces: Vec<&[u8]> = cuts.windows(2).map(|pair| &bytes[pair[0]..pair[1]]).collect();
            let mut requests = Requests::default();
            prop_assert_eq!(taken(&mut requests, &pieces), (all, Ok(())));
            prop_assert!(!requests.has_begun());
        }

        /// Whatever comes: what is taken apart are the bytes that came, and less than one request is kept.
        #[test]
        fn any_bytes(pieces in vec(vec(prop_oneof![Just(0), any::<u8>()], 0..40), 0..20)) {
            let mut requests = Requests::default();
            let pieces: Vec<&[u8]> = pieces.iter().map(Vec::as_slice).collect();
            let (found, outcome) = taken(&mut requests, &pieces);
            let again: Vec<u8> = found.iter().flat_map(|one| answer(one.transaction, one.unit, &one.pdu)).collect();
            prop_assert!(pieces.concat().starts_with(&again));
            if outcome.is_ok() {
                prop_assert!(requests.bytes.len() < PREFIX + MAX_BODY);
                prop_assert_eq!([again, requests.bytes].concat(), pieces.concat());
            }
        }
    }
}
