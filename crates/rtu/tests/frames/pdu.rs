//! Every request and answer survives the wire; everything else is refused or taken as it is, never misread.

use crate::common::{answers, exchanges, requests};
use drivebus_rtu::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_request_survives_the_wire(owned in requests()) {
        let request = owned.borrow();
        let adu = Adu::request(Destination::Broadcast, &request);
        let frame = Frame::parse(adu.as_bytes()).unwrap();
        prop_assert_eq!(Request::parse(frame.pdu()), Ok(request));
        prop_assert_eq!(request.adu_len(), adu.as_bytes().len());
    }

    #[test]
    fn an_answer_survives_the_wire(owned in answers()) {
        let answer = owned.borrow();
        let adu = Adu::answer(UnitAddress::MAX, &answer);
        let frame = Frame::parse(adu.as_bytes()).unwrap();
        prop_assert_eq!(frame.address(), 247);
        prop_assert_eq!(Answer::parse(frame.pdu()), Ok(answer));
    }

    #[test]
    fn what_parses_is_emitted_as_it_came(pdu in prop::collection::vec(any::<u8>(), 0..=260)) {
        if let Ok(request) = Request::parse(&pdu) {
            let adu = Adu::request(Destination::Broadcast, &request);
            prop_assert_eq!(Frame::parse(adu.as_bytes()).unwrap().pdu(), &pdu[..]);
        }
        if let Ok(answer) = Answer::parse(&pdu) {
            let adu = Adu::answer(UnitAddress::MIN, &answer);
            prop_assert_eq!(Frame::parse(adu.as_bytes()).unwrap().pdu(), &pdu[..]);
        }
    }

    #[test]
    fn one_flipped_bit_never_parses(owned in requests(), bit in 0..2048_usize) {
        let adu = Adu::request(UnitAddress::MIN.into(), &owned.borrow());
        let mut bytes = adu.as_bytes().to_vec();
        let bit = bit % (bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
        let refused = matches!(Frame::parse(&bytes), Err(FrameError::Crc { .. }));
        prop_assert!(refused);
    }

    #[test]
    fn the_right_answer_is_taken_and_no_other(owned in exchanges(), other in exchanges()) {
        let (request, answer) = owned.borrow();
        let adu = Adu::answer(UnitAddress::MIN, &answer);
        let pdu = Frame::parse(adu.as_bytes()).unwrap().pdu();
        prop_assert_eq!(request.judge(pdu), Ok(answer));

        let (_, stranger) = other.borrow();
        let adu = Adu::answer(UnitAddress::MIN, &stranger);
        let pdu = Frame::parse(adu.as_bytes()).unwrap().pdu();
        let fits = match (answer, stranger) {
            // Words are told apart by how many they are, bits by how many bytes they fill, and all by their function.
            (Answer::Read { table: ours, words: a, .. }, Answer::Read { table: theirs, words: b, .. }) => {
                ours == theirs && if ours.is_bits() { a.len().div_ceil(8) == b.len().div_ceil(8) } else { a.len() == b.len() }
            }
            (a, b) => a == b,
        };
        prop_assert_eq!(request.judge(pdu).is_ok(), fits);
    }
}

#[test]
fn requests_out_of_range_cannot_be_made() {
    assert_eq!(Request::read(0, 0), Err(RequestError::Count { count: 0, max: 125 }));
    assert_eq!(Request::read(0, 126), Err(RequestError::Count { count: 126, max: 125 }));
    assert_eq!(Request::read(0xFFFF, 2), Err(RequestError::Range { address: 0xFFFF, count: 2 }));
    assert!(Request::read(0xFFFF, 1).is_ok());
    assert_eq!(Request::write_many(0, &[]), Err(RequestError::Count { count: 0, max: 123 }));
    assert_eq!(Request::write_many(0, &[0; 124]), Err(RequestError::Count { count: 124, max: 123 }));
    assert_eq!(Request::custom(&[], AnswerLength::BySilence), Err(RequestError::PduLength { len: 0 }));
    assert_eq!(Request::custom(&[0x83], AnswerLength::BySilence), Err(RequestError::Function { function: 0x83 }));
    assert_eq!(Request::custom(&[7], AnswerLength::Bytes(0)), Err(RequestError::AnswerLength { len: 0 }));
}

#[test]
fn each_table_has_its_function_and_its_limit() {
    for (table, function, most) in [
        (Table::Coil, 0x01, 2000),
        (Table::Discrete, 0x02, 2000),
        (Table::Holding, 0x03, 125),
        (Table::Input, 0x04, 125),
    ] {
        let longest = Request::read_of(table, 0, most).unwrap();
        assert_eq!(longest.function(), function);
        assert!(!longest.is_write());
        let [c1, c0] = (most + 1).to_be_bytes();
        let count = usize::from(most) + 1;
        assert_eq!(Request::parse(&[function, 0, 0, c1, c0]), Err(RequestError::Count { count, max: most }));
        assert_eq!(Request::read_of(table, 0, 0), Err(RequestError::Count { count: 0, max: most }));
        assert_eq!(Request::read_of(table, 0xFFFF, 2), Err(RequestError::Range { address: 0xFFFF, count: 2 }));
        assert_eq!(longest.expected().adu_len(), Some(255), "250 bytes of data, and five around them");
        assert_eq!(Request::parse(&[function, 0, 0, 0]), Err(RequestError::PduLength { len: 4 }));
        assert_eq!(Table::named(table.name()), Some(table));
    }
}

/// §6.5: FF00H is on, 0000H is off, and nothing else is either.
#[test]
fn a_coil_is_on_or_off() {
    assert_eq!(Request::parse(&[0x05, 0x00, 0xAC, 0xFF, 0x00]), Ok(Request::write_coil(172, true)));
    assert_eq!(Request::parse(&[0x05, 0x00, 0xAC, 0x00, 0x00]), Ok(Request::write_coil(172, false)));
    for value in [1, 0xFF, 0xFF01, 0x0100] {
        let [v1, v0] = u16::to_be_bytes(value);
        assert_eq!(Request::parse(&[0x05, 0, 0xAC, v1, v0]), Err(RequestError::Coil { value }));
        assert_eq!(Answer::parse(&[0x05, 0, 0xAC, v1, v0]), Err(AnswerError::Coil { value }));
    }
    assert!(Request::write_coil(172, false).is_write());
    let on = Request::write_coil(172, true);
    let other = Err(AnswerError::Echo { asked: [172, 0xFF00], came: [172, 0] });
    assert_eq!(on.judge(&[0x05, 0x00, 0xAC, 0x00, 0x00]), other, "it confirms the opposite");
}

#[test]
fn an_answer_belongs_to_one_table_only() {
    let read = |table| Request::read_of(table, 0, 8).unwrap();
    for asked in Table::ALL {
        for came in Table::ALL {
            let adu = Adu::answer(UnitAddress::MIN, &Answer::read_of(came, &[1; 8]).unwrap());
            let verdict = read(asked).judge(Frame::parse(adu.as_bytes()).unwrap().pdu()).map(|_| ());
            let wrong = AnswerError::Function { asked: asked.function(), came: came.function() };
            assert_eq!(verdict, if asked == came { Ok(()) } else { Err(wrong) });
        }
    }
}

/// §6.1: the rest of the last byte is filled with zeros. Who fills it otherwise is understood.
#[test]
fn bits_that_nobody_asked_for_are_not_there() {
    let asked = Request::read_of(Table::Coil, 0, 3).unwrap();
    for byte in [0b0000_0101, 0b1010_0101] {
        let pdu = [0x01, 1, byte];
        let Ok(Answer::Read { words, .. }) = asked.judge(&pdu) else { unreachable!("{byte:08b}") };
        assert_eq!(words, Words::new(&[1, 0, 1]));
    }
}

#[test]
fn what_is_carried_as_it_is_stays_so() {
    // The Huanyang HY writes a parameter by 02H: as a read of discrete inputs it would be asked twice.
    for pdu in [[0x01, 0, 19, 0, 19], [0x02, 3, 5, 0, 100], [0x04, 0, 8, 0, 1], [0x05, 0, 0xAC, 0xFF, 0]] {
        assert_eq!(Request::raw(&pdu, None), Request::custom(&pdu, AnswerLength::BySilence));
        assert!(!matches!(Request::parse(&pdu), Ok(Request::Custom { .. })), "{pdu:02X?}");
    }
}

#[test]
fn a_write_is_known_as_one() {
    assert!(!Request::read(0, 1).unwrap().is_write());
    assert!(!Request::echo(0).is_write());
    assert!(Request::write(0, 0).is_write());
    assert!(Request::write_many(0, &[0]).unwrap().is_write());
    for (pdu, write) in [
        (&[0x03, 0, 0, 0, 1][..], false),
        (&[0x04, 0, 0, 0, 1], false),
        (&[0x08, 0, 0, 0, 1], false),
        (&[0x08, 0, 1, 0, 0], true), // restart communications
        (&[0x2B, 0x0E, 1, 0], false),
        (&[0x2B, 0x0D, 0, 0], true), // CANopen
        (&[0x2B], true),
        (&[0x05, 0, 0, 0xFF, 0], true),
        (&[0x17, 0], true), // read and write at once
        (&[0x41], true),    // a maker's own: nobody knows
    ] {
        assert_eq!(Request::custom(pdu, AnswerLength::BySilence).unwrap().is_write(), write, "{pdu:02X?}");
    }
}

/// Forms: *Modbus Application Protocol* V1.1b3, §6.1 to §6.4, §6.7, §6.8, §6.9, §6.10, §6.13, §6.14, §6.18, §6.21. Huanyang's own
/// protocol is as LinuxCNC has it, src/hal/user_comps/huanyang-vfd/hy_modbus.c: function, number of bytes, bytes; 02H writes a
/// parameter, 03H is a command, 04H reads a status.
#[test]
fn only_what_has_the_form_of_a_read_is_known_to_be_one() {
    let only_reads = |pdu: &[u8]| Request::custom(pdu, AnswerLength::BySilence).unwrap().only_reads();
    for function in 0x01..=0x04 {
        assert!(only_reads(&[function, 0, 19, 0, 19]), "{function:02X}H");
        assert!(only_reads(&[function, 0xFF, 0xFF, 0, 1]), "{function:02X}H");
        let most: u16 = if function < 3 { 2000 } else { 125 };
        for (count, good) in [(0, false), (1, true), (most, true), (most + 1, false), (0xFFFF, false)] {
            let [c1, c0] = count.to_be_bytes();
            assert_eq!(only_reads(&[function, 0, 0, c1, c0]), good, "{function:02X}H, {count}");
        }
        assert!(!only_reads(&[function, 0xFF, 0xFF, 0, 2]), "beyond the last");
        let long = [function, 0, 19, 0, 19, 0, 0];
        for length in (1..=4).chain([6, 7]) {
            assert!(!only_reads(&long[..length]), "{function:02X}H, {length} bytes");
        }
    }
    for command in [0x01, 0x11, 0x08] {
        assert!(!only_reads(&[0x03, 1, command]), "runs, reverses, stops");
    }
    for word in [0u16, 1, 8, 2000, 2001, 0xFFFF] {
        let [w1, w0] = word.to_be_bytes();
        assert!(!only_reads(&[0x02, 3, 5, w1, w0]), "writes {word} to PD005, byte for byte");
    }
    assert!(only_reads(&[0x04, 3, 0, 0, 0]), "asks for a status; to a unit of Modbus it is a read of nothing");
    assert!(!only_reads(&[0x04, 2, 0, 0, 0]));
    for (pdu, good) in [
        (&[0x07][..], true),
        (&[0x07, 0], false),
        (&[0x0B], true),
        (&[0x0C], true),
        (&[0x0C, 1, 2], false),
        (&[0x11], true),
        (&[0x11, 0], false),
        (&[0x08, 0, 0, 0xA5, 0x37], true),
        (&[0x08, 0, 0, 1, 2, 3, 4], true),
        (&[0x08, 0, 2, 0, 0], true),
        (&[0x08, 0, 0x0B, 0, 0], true),
        (&[0x08, 0, 0x0B], false),
        (&[0x08, 0, 1, 0, 0], false),
        (&[0x08], false),
        (&[0x14, 7, 6, 0, 4, 0, 1, 0, 2], true),
        (&[0x14, 7, 5, 0, 4, 0, 1, 0, 2], false),
        (&[0x14, 14, 6, 0, 4, 0, 1, 0, 2], false),
        (&[0x14, 0], false),
        (&[0x14], false),
        (&[0x18, 0x04, 0xDE], true),
        (&[0x18, 0x04], false),
        (&[0x05, 0, 0, 0xFF, 0], false),
        (&[0x06, 0, 0, 0, 0], false),
        (&[0x2B, 0x0E, 1, 0], true),
        (&[0x2B, 0x0E, 4, 0x80], true),
        (&[0x2B, 0x0E, 0, 0], false),
        (&[0x2B, 0x0E, 5, 0], false),
        (&[0x2B, 0x0E, 1], false),
        (&[0x2B, 0x0E, 1, 0, 0], false),
        (&[0x2B, 0x0D, 1, 0], false),
        (&[0x41], false),
    ] {
        assert_eq!(only_reads(pdu), good, "{pdu:02X?}");
    }
    for table in Table::ALL {
        assert!(Request::read_of(table, 0x0305, 17).unwrap().only_reads(), "who says so means the table");
    }
    assert!(Request::echo(7).only_reads());
    assert!(!Request::write(0, 0).only_reads());
    assert!(!Request::write_coil(0, true).only_reads());
    assert!(!Request::write_many(0, &[0]).unwrap().only_reads());
}

#[test]
fn a_refusal_of_another_function_is_no_answer() {
    let expected = Request::read(0, 1).unwrap().expected();
    assert_eq!(expected.judge(&[0x83, 0x02]), Ok(Answer::exception(0x03, ExceptionCode::ILLEGAL_ADDRESS)));
    assert_eq!(expected.judge(&[0x86, 0x02]), Err(AnswerError::Function { asked: 3, came: 0x86 }));
    assert_eq!(expected.judge(&[]), Err(AnswerError::Length { len: 0 }));
    assert_eq!(expected.judge(&[0x03, 4, 0, 1, 0, 2]), Err(AnswerError::Count { asked: 1, came: 2 }));
    assert_eq!(expected.judge(&[0x03, 2, 0]), Err(AnswerError::Length { len: 3 }));
}

#[test]
fn an_answer_longer_than_a_frame_is_none() {
    let longest = [&[0x03, 250][..], &[0; 250]].concat();
    assert!(matches!(Answer::parse(&longest), Ok(Answer::Read { words, .. }) if words.len() == 125));
    for bytes in [252, 254] {
        let pdu = [&[0x03, bytes][..], &vec![0; usize::from(bytes)]].concat();
        assert_eq!(Answer::parse(&pdu), Err(AnswerError::Length { len: pdu.len() }));
    }
}

/// *Modbus Application Protocol* V1.1b3: the requests of §6.1 to §6.6, §6.11, §6.12, and what a unit may make of spoilt ones.
#[test]
fn what_a_request_touches_is_told_by_its_bytes() {
    let told = |pdu: &[u8]| {
        Touched::by(pdu).map(|touched| {
            (touched.table, touched.address, touched.count, touched.written().map(Iterator::collect::<Vec<_>>))
        })
    };
    assert_eq!(told(&[0x01, 0x00, 0x13, 0x00, 0x13]), Some((Table::Coil, 0x13, 0x13, None)));
    assert_eq!(told(&[0x02, 0x00, 0xC4, 0x00, 0x16]), Some((Table::Discrete, 0xC4, 0x16, None)));
    assert_eq!(told(&[0x03, 0x00, 0x6B, 0x00, 0x03]), Some((Table::Holding, 0x6B, 3, None)));
    assert_eq!(told(&[0x04, 0x00, 0x08, 0x00, 0x01]), Some((Table::Input, 8, 1, None)));
    assert_eq!(told(&[0x05, 0x00, 0xAC, 0xFF, 0x00]), Some((Table::Coil, 0xAC, 1, Some(vec![1]))));
    assert_eq!(told(&[0x05, 0x00, 0xAC, 0x00, 0x00]), Some((Table::Coil, 0xAC, 1, Some(vec![0]))));
    assert_eq!(told(&[0x06, 0x00, 0x01, 0x00, 0x03]), Some((Table::Holding, 1, 1, Some(vec![3]))));
    let coils = vec![1, 0, 1, 1, 0, 0, 1, 1, 1, 0];
    assert_eq!(told(&[0x0F, 0, 0x13, 0, 0x0A, 2, 0xCD, 0x01]), Some((Table::Coil, 0x13, 10, Some(coils))));
    let words = Some(vec![0x000A, 0x0102]);
    assert_eq!(told(&[0x10, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2]), Some((Table::Holding, 1, 2, words.clone())));
    // Counts that are wrong, of words and of bytes, and one byte too many.
    assert_eq!(told(&[0x10, 0, 1, 0, 1, 2, 0, 0x0A, 1, 2]), Some((Table::Holding, 1, 1, words.clone())));
    assert_eq!(told(&[0x10, 0, 1, 0, 9, 9, 0, 0x0A, 1, 2, 3]), Some((Table::Holding, 1, 9, words)));
    assert_eq!(told(&[0x0F, 0, 1, 0, 20, 1, 0xFF]), Some((Table::Coil, 1, 20, Some(vec![1; 8]))));
    // Nothing to write yet, and what is no read or write.
    for pdu in [&[0x10, 0, 1, 0, 1][..], &[0x0F, 0, 1, 0, 1, 1]] {
        assert_eq!(told(pdu).and_then(|(.., words)| words), None);
    }
    for pdu in [
        &[][..],
        &[3],
        &[3, 0, 0, 0],
        &[6, 0, 1, 0, 3, 0],
        &[5, 0, 1, 0xFF],
        &[8, 0, 0, 1, 2],
        &[0x83, 2],
        &[0x2B, 14, 1, 0, 0],
    ] {
        assert_eq!(told(pdu), None, "{pdu:02X?}");
    }
}

proptest! {
    #[test]
    fn whole_requests_touch_what_they_ask_for(owned in requests()) {
        let request = owned.borrow();
        let adu = Adu::request(Destination::Broadcast, &request);
        let touched = Touched::by(Frame::parse(adu.as_bytes()).unwrap().pdu());
        let words = touched.and_then(|touched| Some(touched.written()?.collect::<Vec<_>>()));
        match request {
            Request::Read { table, address, count, .. } => {
                let touched = touched.unwrap();
                prop_assert_eq!((touched.table, touched.address, touched.count, words), (table, address, count, None));
            }
            Request::WriteSingle { address, value, .. } => {
                prop_assert_eq!((touched.unwrap().address, words), (address, Some(vec![value])));
            }
            Request::WriteMultiple { address, words: written, .. } => {
                prop_assert_eq!((touched.unwrap().address, words), (address, Some(written.iter().collect())));
            }
            _ => {}
        }
    }
}
