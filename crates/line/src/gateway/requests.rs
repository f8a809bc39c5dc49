//! What clients send, taken apart: one request after the other, or why the connection cannot go on.

use crate::gateway::asked::{Asked, NotModbus};
use crate::gateway::framing::Framing;
use crate::gateway::rtu_request::{self, Looked};
use crate::gateway::tcp_request;

/// The requests in what comes over one connection, in whatever pieces it comes.
///
/// It keeps less than one request, and looks at each header before the rest of it has come.
#[derive(Debug, Default)]
pub struct Requests {
    framing: Framing,
    /// What is not taken apart yet.
    bytes: Vec<u8>,
    looked: Looked,
    wrong: Option<NotModbus>,
}

impl Requests {
    /// Of a connection that is framed so.
    pub fn new(framing: Framing) -> Self {
        Self { framing, ..Self::default() }
    }

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
            let first = match self.framing {
                Framing::Tcp => tcp_request::first(rest),
                Framing::Rtu => rtu_request::first(rest, &mut self.looked),
            };
            match first {
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

#[cfg(test)]
mod tests {
    use drivebus_rtu::MAX_ADU;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::ports::mbap::{MAX_BODY, PREFIX};

    fn taken(requests: &mut Requests, pieces: &[&[u8]]) -> (Vec<Asked>, Result<(), NotModbus>) {
        let mut found = Vec::new();
        let outcome = pieces.iter().try_for_each(|piece| requests.take(piece, |asked| found.push(asked)));
        (found, outcome)
    }

    fn sent(framing: Framing, asked: &[Asked]) -> Vec<u8> {
        asked.iter().flat_map(|one| framing.message(one.transaction, one.unit, &one.pdu)).collect()
    }

    /// The frame of the guide's §3.1.3, and of the specification V1.1b3, §6.3: read 3 words from 6BH.
    #[test]
    fn one_of_the_specification() {
        let bytes = [0x15, 0x01, 0, 0, 0, 6, 0xFF, 0x03, 0x00, 0x6B, 0x00, 0x03];
        let (found, outcome) = taken(&mut Requests::default(), &[&bytes]);
        assert_eq!(found, [Asked { transaction: 0x1501, unit: 0xFF, pdu: vec![3, 0, 0x6B, 0, 3] }]);
        assert_eq!(outcome, Ok(()));
        assert_eq!(Framing::Tcp.message(0x1501, 0xFF, &[0x83, 2]), [0x15, 0x01, 0, 0, 0, 3, 0xFF, 0x83, 2]);
    }

    /// The read of the GD350 manual, §9.4.2.1: unit 1, two words from 0004H.
    #[test]
    fn one_of_a_manual() {
        let bytes = [0x01, 0x03, 0x00, 0x04, 0x00, 0x02, 0x85, 0xCA];
        let (found, outcome) = taken(&mut Requests::new(Framing::Rtu), &[&bytes]);
        assert_eq!((&found, outcome), (&vec![Asked { transaction: 0, unit: 1, pdu: vec![3, 0, 4, 0, 2] }], Ok(())));
        assert_eq!(sent(Framing::Rtu, &found), bytes);
        assert!(Framing::Rtu.message(0, 0, &[6, 0, 0, 0, 1]).is_empty(), "nobody answers for all");
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

    #[test]
    fn what_is_no_frame_of_rtu() {
        let mut requests = Requests::new(Framing::Rtu);
        assert_eq!(taken(&mut requests, &[b"GET / HTTP/1.1\r\n\r\n"]).1, Ok(()), "perhaps somebody's own function");
        assert_eq!(taken(&mut requests, &[&[b'x'; 300]]).1, Err(NotModbus::Crc));
        let good = Framing::Rtu.message(0, 1, &[3, 0, 4, 0, 2]);
        assert_eq!(taken(&mut requests, &[&good]), (vec![], Err(NotModbus::Crc)));
        for wrong in [&[1, 3, 0, 4, 0, 2, 0, 0][..], &[1, 0x10, 0, 4, 0, 2, 0xFF]] {
            assert_eq!(taken(&mut Requests::new(Framing::Rtu), &[wrong]).1, Err(NotModbus::Crc));
        }
    }

    fn of_tcp() -> impl Strategy<Value = Asked> {
        (any::<u16>(), any::<u8>(), vec(any::<u8>(), 1..=253)).prop_map(|(transaction, unit, pdu)| Asked {
            transaction,
            unit,
            pdu,
        })
    }

    fn of_rtu() -> impl Strategy<Value = Asked> {
        let plain = (prop::sample::select(vec![1_u8, 2, 3, 4, 5, 6, 8]), vec(any::<u8>(), 4))
            .prop_map(|(function, rest)| [&[function][..], &rest].concat());
        let many = (prop::sample::select(vec![15_u8, 16]), vec(any::<u8>(), 4), vec(any::<u8>(), 0..200)).prop_map(
            |(function, rest, data)| [&[function][..], &rest, &[u8::try_from(data.len()).unwrap()], &data].concat(),
        );
        (1_u8.., prop_oneof![plain, many]).prop_map(|(unit, pdu)| Asked { transaction: 0, unit, pdu })
    }

    fn cut<'a>(bytes: &'a [u8], at: &[prop::sample::Index]) -> Vec<&'a [u8]> {
        let mut cuts: Vec<usize> = at.iter().map(|cut| cut.index(bytes.len() + 1)).chain([0, bytes.len()]).collect();
        cuts.sort_unstable();
        cuts.windows(2).map(|pair| &bytes[pair[0]..pair[1]]).collect()
    }

    proptest! {
        #[test]
        fn pieces_do_not_matter(
            (framing, all) in prop_oneof![
                vec(of_tcp(), 0..6).prop_map(|all| (Framing::Tcp, all)),
                vec(of_rtu(), 0..6).prop_map(|all| (Framing::Rtu, all)),
            ],
            at in vec(any::<prop::sample::Index>(), 0..12),
        ) {
            let bytes = sent(framing, &all);
            let mut requests = Requests::new(framing);
            prop_assert_eq!(taken(&mut requests, &cut(&bytes, &at)), (all, Ok(())));
            prop_assert!(!requests.has_begun());
        }

        /// Whatever comes: what is taken apart are the bytes that came, and less than one request is kept.
        #[test]
        fn any_bytes(
            is_rtu: bool,
            pieces in vec(vec(prop_oneof![Just(0), Just(1), any::<u8>()], 0..40), 0..20),
        ) {
            let framing = if is_rtu { Framing::Rtu } else { Framing::Tcp };
            let mut requests = Requests::new(framing);
            let pieces: Vec<&[u8]> = pieces.iter().map(Vec::as_slice).collect();
            let (found, outcome) = taken(&mut requests, &pieces);
            // What is for all units is answered by nobody, and so it is not made again here.
            prop_assume!(!is_rtu || found.iter().all(|one| one.unit != 0));
            let again = sent(framing, &found);
            prop_assert!(pieces.concat().starts_with(&again));
            if outcome.is_ok() {
                let most = if is_rtu { MAX_ADU } else { PREFIX + MAX_BODY };
                prop_assert!(requests.bytes.len() < most);
                prop_assert_eq!([again, requests.bytes].concat(), pieces.concat());
            }
        }
    }
}
