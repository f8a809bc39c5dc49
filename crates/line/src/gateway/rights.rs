//! What a client may ask. Whatever is not let pass here never reaches the line.

use drivebus_rtu::{Destination, ExceptionCode, Request, UnitAddress};

/// What becomes of one request.
#[derive(Debug, PartialEq)]
pub(super) enum Judged<'a> {
    /// It may be asked.
    Asked(Destination, Request<'a>),
    /// It is not allowed here.
    Refused,
    /// It is a read, and cannot be one of the protocol.
    Wrong(ExceptionCode),
}

/// Judges a request to `unit`: reads of the units 1 to 247 are let pass, in the form that the specification gives them.
///
/// What has another form may be a write: 02H and 03H are commands in Huanyang's own protocol.
pub(super) fn judge(unit: u8, pdu: &[u8]) -> Judged<'_> {
    let Ok(unit) = UnitAddress::new(unit) else { return Judged::Refused };
    match (pdu, Request::parse(pdu)) {
        (_, Ok(request @ Request::Read { .. })) => Judged::Asked(unit.into(), request),
        // A count or a range that no unit has, in the right form.
        ([0x01..=0x04, _, _, _, _], Err(_)) => Judged::Wrong(ExceptionCode::ILLEGAL_VALUE),
        _ => Judged::Refused,
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn lets_pass(unit: u8, pdu: &[u8]) -> bool {
        matches!(judge(unit, pdu), Judged::Asked(..))
    }

    #[test]
    fn reserved_units_are_not_asked() {
        let passed: Vec<u8> = (0..=255).filter(|&unit| lets_pass(unit, &[3, 0, 0, 0, 1])).collect();
        assert_eq!(passed, (1..=247).collect::<Vec<u8>>());
    }

    #[test]
    fn a_read_that_cannot_be_is_told_from_what_is_not_allowed() {
        assert_eq!(judge(1, &[3, 0, 0, 0, 126]), Judged::Wrong(ExceptionCode::ILLEGAL_VALUE));
        assert_eq!(judge(1, &[4, 0xFF, 0xFF, 0, 2]), Judged::Wrong(ExceptionCode::ILLEGAL_VALUE));
        assert_eq!(judge(1, &[3, 1, 8]), Judged::Refused);
    }

    proptest! {
        /// Against the specification V1.1b3, §6.1 to §6.4, in other words.
        #[test]
        fn only_reads_pass(unit: u8, pdu in prop_oneof![
            vec(any::<u8>(), 1..8),
            (1_u8..=6, 0_u16.., 0_u16..2100).prop_map(|(function, address, count)| {
                [&[function][..], &address.to_be_bytes(), &count.to_be_bytes()].concat()
            }),
        ]) {
            let most = |function| if function < 3 { 2000 } else { 125 };
            let is_read = match *pdu {
                [function @ 1..=4, a1, a0, c1, c0] => {
                    let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                    (1..=most(function)).contains(&count) && u32::from(address) + u32::from(count) <= 0x1_0000
                }
                _ => false,
            };
            prop_assert_eq!(lets_pass(unit, &pdu), is_read && (1..=247).contains(&unit));
        }
    }
}
