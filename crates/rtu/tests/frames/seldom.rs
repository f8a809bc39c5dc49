//! Functions that few units know: 0FH, 11H, 16H, 17H and 2BH/0EH.
//!
//! Bytes: *Modbus Application Protocol* V1.1b3, §6.11, §6.13, §6.16, §6.17, §6.21.

use drivebus_rtu::IdentificationLevel::{Basic, Extended, One, Regular};
use drivebus_rtu::*;
use proptest::prelude::*;

const T35: Duration = Duration::from_micros(3_646); // 9600 8N1

fn unit() -> UnitAddress {
    UnitAddress::new(17).unwrap()
}

/// The PDU of `request`, and that it is read back as the same.
fn pdu(request: &Request<'_>) -> Vec<u8> {
    let frame = Adu::request(unit().into(), request);
    assert_eq!(frame.as_bytes().len(), request.adu_len());
    let pdu = Frame::parse(frame.as_bytes()).unwrap().pdu().to_vec();
    assert_eq!(Request::parse(&pdu).as_ref(), Ok(request));
    assert_eq!(Request::raw(&pdu, None).as_ref(), Ok(request));
    pdu
}

fn put(answer: &Answer<'_>) -> Vec<u8> {
    Frame::parse(Adu::answer(unit(), answer).as_bytes()).unwrap().pdu().to_vec()
}

/// The basic identification that §6.21 has as its example, where all fits into one answer.
fn basic() -> Vec<u8> {
    let mut pdu = vec![0x2B, 0x0E, 0x01, 0x01, 0x00, 0x00, 0x03];
    for (object, value) in [(0, "Company identification"), (1, "Product code XX"), (2, "V2.11")] {
        pdu.extend([object, u8::try_from(value.len()).unwrap()]);
        pdu.extend(value.as_bytes());
    }
    pdu
}

#[test]
fn coils_are_written_as_the_specification_has_it() {
    let coils = [1, 0, 1, 1, 0, 0, 1, 1, 1, 0];
    let request = Request::write_coils(0x13, &coils).unwrap();
    assert_eq!(pdu(&request), [0x0F, 0x00, 0x13, 0x00, 0x0A, 0x02, 0xCD, 0x01]);
    assert_eq!(request.expected().length(), AnswerLength::Bytes(5));
    let answer = [0x0F, 0x00, 0x13, 0x00, 0x0A];
    assert_eq!(request.judge(&answer), Ok(Answer::confirming(&request).unwrap()));
    assert_eq!(put(&Answer::confirming(&request).unwrap()), answer);
    let wrong = request.judge(&[0x0F, 0x00, 0x13, 0x00, 0x0B]);
    assert_eq!(wrong, Err(AnswerError::Echo { asked: [0x13, 10], came: [0x13, 11] }));
    let filled = [0x0F, 0x00, 0x13, 0x00, 0x0A, 0x02, 0xCD, 0x05];
    assert_eq!(Request::raw(&filled, None), Request::custom(&filled, AnswerLength::BySilence), "goes out as it is");
    for (address, count) in [(0, 0), (0, 1_969), (0xFFFF, 2)] {
        assert!(Request::write_coils(address, &vec![1; count]).is_err(), "{count} at {address}");
    }
    assert!(Request::write_coils(0xF850, &[1; 1_968]).is_ok());
}

#[test]
fn bits_are_changed_as_the_specification_has_it() {
    let request = Request::mask_write(4, 0xF2, 0x25);
    let bytes = [0x16, 0x00, 0x04, 0x00, 0xF2, 0x00, 0x25];
    assert_eq!(pdu(&request), bytes);
    assert_eq!(request.judge(&bytes), Ok(Answer::confirming(&request).unwrap()));
    assert_eq!(put(&Answer::confirming(&request).unwrap()), bytes);
    assert_eq!(request.expected().length(), AnswerLength::Bytes(7));
    assert!(request.expected().may_repeat_request());
}

#[test]
fn words_are_written_and_read_as_the_specification_has_it() {
    let request = Request::read_write(3, 6, 0x0E, &[0xFF, 0xFF, 0xFF]).unwrap();
    let bytes = [0x17, 0, 3, 0, 6, 0, 0x0E, 0, 3, 6, 0, 0xFF, 0, 0xFF, 0, 0xFF];
    assert_eq!(pdu(&request), bytes);
    let words = [0x00FE, 0x0ACD, 0x0001, 0x0003, 0x000D, 0x00FF];
    let answer = [0x17, 0x0C, 0x00, 0xFE, 0x0A, 0xCD, 0x00, 0x01, 0x00, 0x03, 0x00, 0x0D, 0x00, 0xFF];
    assert_eq!(put(&Answer::read_write(&words).unwrap()), answer);
    assert_eq!(request.judge(&answer), Ok(Answer::read_write(&words).unwrap()));
    assert_eq!(request.expected().length(), AnswerLength::Bytes(14));
    let short = request.judge(&[0x17, 2, 0, 1]);
    assert_eq!(short, Err(AnswerError::Count { asked: 6, came: 1 }));
    for (count, written) in [(0, 1), (126, 1), (1, 0), (1, 122)] {
        assert!(Request::read_write(0, count, 0, &vec![0; written]).is_err(), "{count}, {written}");
    }
    assert!(Request::read_write(0xFFFF, 2, 0, &[0]).is_err());
    assert!(Request::read_write(0, 2, 0xFFFF, &[0, 0]).is_err());
    assert!(Request::read_write(0, 125, 0, &[0; 121]).is_ok());
}

#[test]
fn a_unit_says_what_it_is_in_bytes_of_its_own() {
    let request = Request::report_server_id();
    assert_eq!(pdu(&request), [0x11]);
    let answer = [0x11, 0x03, b'A', b'B', 0xFF];
    assert_eq!(request.judge(&answer), Ok(Answer::server_id(b"AB\xFF").unwrap()));
    assert_eq!(put(&Answer::server_id(b"AB\xFF").unwrap()), answer);
    for wrong in [&[0x11, 0x02, b'A', b'B', 0xFF][..], &[0x11, 4, b'A', b'B', 0xFF], &[0x11, 0], &[0x11]] {
        assert_eq!(request.judge(wrong), Err(AnswerError::Length { len: wrong.len() }));
    }
}

#[test]
fn a_unit_says_who_made_it() {
    let request = Request::read_identification(Basic, 0);
    assert_eq!(pdu(&request), [0x2B, 0x0E, 0x01, 0x00]);
    let bytes = basic();
    let Ok(Answer::Identification { page, .. }) = request.judge(&bytes) else { panic!("an identification") };
    let objects: Vec<_> = page.objects().collect();
    assert_eq!(objects, [(0, &b"Company identification"[..]), (1, b"Product code XX"), (2, b"V2.11")]);
    assert_eq!((page.conformity(), page.next(), page.len()), (1, None, 3));
    assert_eq!(put(&Answer::parse(&bytes).unwrap()), bytes);
}

/// KBR, multicomp F144-3, document 25359_EDEBDA0279-2320-1_EN, p. 63.
#[test]
fn a_unit_that_is_sold_says_who_made_it() {
    let frame = Adu::request(UnitAddress::MIN.into(), &Request::read_identification(Basic, 0));
    assert_eq!(frame.as_bytes(), [0x01, 0x2B, 0x0E, 0x01, 0x00, 0x70, 0x77]);
    let mut wire = vec![0x01, 0x2B, 0x0E, 0x01, 0x01, 0x00, 0x00, 0x03, 0x00, 0x08];
    wire.extend(b"KBR GmbH\x01\x12multicomp F144-3  \x02\x09 2.00r016\xCD\xDB");
    let frame = Frame::parse(&wire).unwrap();
    let expected = Request::read_identification(Basic, 0).expected();
    assert!(expected.judge_frame(UnitAddress::MIN, &frame).is_ok());
    assert_eq!(frame_len(&wire), Some(wire.len()));
}

#[test]
fn what_another_question_brings_is_no_answer() {
    let judge = |level, object, pdu: &[u8]| Request::read_identification(level, object).judge(pdu).err();
    let page = |head: &[u8], objects: &[u8]| {
        let objects: Vec<u8> = objects.iter().flat_map(|&object| [object, 1, b'x']).collect();
        [&[0x2B, 0x0E], head, &objects].concat()
    };
    let three = page(&[1, 1, 0, 0, 3], &[0, 1, 2]);
    assert_eq!(judge(Basic, 0, &three), None);
    assert_eq!(judge(Regular, 0, &three), Some(AnswerError::Level { asked: 2, came: 1 }));
    assert_eq!(judge(One, 0, &three), Some(AnswerError::Level { asked: 4, came: 1 }));
    // A unit that has no such object begins anew.
    assert_eq!(judge(Basic, 5, &three), None);
    let rest = page(&[1, 1, 0, 0, 2], &[1, 2]);
    assert_eq!(judge(Basic, 1, &rest), None);
    assert_eq!(judge(Basic, 2, &rest), Some(AnswerError::Object { asked: 2, came: 1 }));
    let beyond = page(&[1, 1, 0, 0, 2], &[0, 3]);
    assert_eq!(judge(Basic, 0, &beyond), Some(AnswerError::Object { asked: 0, came: 3 }));
    assert_eq!(judge(Extended, 0, &page(&[3, 0x83, 0, 0, 2], &[0, 0xFF])), None);
    let two = page(&[3, 3, 0, 0, 2], &[1, 1]);
    assert_eq!(judge(Extended, 0, &two), Some(AnswerError::Object { asked: 1, came: 1 }));
    let one = page(&[4, 0x81, 0, 0, 1], &[2]);
    assert_eq!(judge(One, 2, &one), None);
    assert_eq!(judge(One, 1, &one), Some(AnswerError::Object { asked: 1, came: 2 }));
    assert_eq!(judge(One, 0, &page(&[4, 0x81, 0, 0, 2], &[0, 1])), Some(AnswerError::Object { asked: 0, came: 0 }));
    for conformity in [0, 4, 0x80, 0x84, 0xFF] {
        let wrong = page(&[1, conformity, 0, 0, 1], &[0]);
        assert_eq!(judge(Basic, 0, &wrong), Some(AnswerError::Conformity { came: conformity }));
    }
    for (more, next, good) in [(0, 0, true), (0, 7, true), (0xFF, 1, true), (0xFF, 0, false), (1, 1, false)] {
        let came = page(&[1, 1, more, next, 1], &[0]);
        let wrong = AnswerError::MoreFollows { more, next };
        assert_eq!(judge(Basic, 0, &came), Some(wrong).filter(|_| !good), "{more:02X}H {next:02X}H");
    }
    let more = page(&[4, 0x81, 0xFF, 3, 1], &[2]);
    assert_eq!(judge(One, 2, &more), Some(AnswerError::MoreFollows { more: 0xFF, next: 3 }));
    // Two objects that are announced as three, as the second example of §6.21 prints it.
    assert!(judge(Basic, 0, &page(&[1, 1, 0xFF, 2, 3], &[0, 1])).is_some());
    assert_eq!(judge(Basic, 0, &[0xAB, 0x01]), None, "a refusal");
}

#[test]
fn only_writes_are_writes() {
    let words = [1];
    for (request, writes) in [
        (Request::write_coils(0, &words).unwrap(), true),
        (Request::report_server_id(), false),
        (Request::mask_write(0, 0, 0), true),
        (Request::read_write(0, 1, 0, &words).unwrap(), true),
        (Request::read_identification(Extended, 0), false),
    ] {
        assert_eq!((request.is_write(), request.only_reads()), (writes, !writes), "{request:?}");
    }
}

/// A unit whose objects need several answers, asked as it says.
#[test]
fn a_unit_answers_in_several_parts() {
    let long = [b'x'; 100];
    let objects: &[(u8, &[u8])] = &[(0, &long), (1, &long), (2, &long), (4, b"name"), (0x90, &[])];
    let ask = |level, object, buffer: &mut [u8; MAX_PDU]| {
        let answer = IdentificationPage::answer(objects, (level, object), buffer);
        let request = Request::read_identification(level, object);
        assert!(request.judge(&put(&answer)).is_ok(), "{answer:?}");
        match answer {
            Answer::Identification { page, .. } => {
                Some((page.objects().map(|(number, _)| number).collect::<Vec<_>>(), page.next()))
            }
            _ => None,
        }
    };
    let buffer = &mut [0; MAX_PDU];
    assert_eq!(ask(Extended, 0, buffer), Some((vec![0, 1], Some(2))));
    assert_eq!(ask(Extended, 2, buffer), Some((vec![2, 4, 0x90], None)));
    assert_eq!(ask(Basic, 2, buffer), Some((vec![2], None)));
    assert_eq!(ask(Regular, 3, buffer), Some((vec![0, 1], Some(2))), "it has no such object, and begins anew");
    assert_eq!(ask(One, 4, buffer), Some((vec![4], None)));
    assert_eq!(ask(One, 3, buffer), None);
}

/// The answer comes at its last byte, however it is cut: nobody waits for the silence behind it.
#[test]
fn the_lengths_of_its_objects_tell_where_it_ends() {
    let request = Request::read_identification(Basic, 0);
    for pdu in [basic(), vec![0x2B, 0x0E, 1, 1, 0, 0, 0]] {
        let wire = Adu::answer(unit(), &Answer::custom(&pdu).unwrap()).as_bytes().to_vec();
        for lump in 1..=wire.len() {
            let mut framer = Framer::new(T35);
            framer.expect(unit(), request.expected());
            framer.wait_for_the_rest(Duration::from_millis(20), Instant::ZERO);
            let mut now = Instant::ZERO;
            let mut heard = Vec::new();
            for piece in wire.chunks(lump) {
                now = now + Duration::from_millis(8);
                framer.receive(now, piece);
                assert!(heard.is_empty());
                heard.extend(framer.poll(now).map(|frame| frame.unwrap().as_bytes().to_vec()));
            }
            assert_eq!(heard, std::slice::from_ref(&wire), "{lump}");
            assert_eq!(framer.deadline(), None);
        }
    }
}

/// As the specification has them, and as a sniffer tells them apart.
#[test]
fn a_listener_tells_request_and_answer() {
    let words = [1, 0, 1];
    let page = basic();
    let answers = [
        (Request::write_coils(3, &words).unwrap(), Answer::confirming(&Request::write_coils(3, &words).unwrap())),
        (Request::report_server_id(), Answer::server_id(b"AB\xFF").ok()),
        (Request::read_write(3, 2, 7, &words).unwrap(), Answer::read_write(&[5, 6]).ok()),
        (Request::read_identification(Basic, 0), Answer::parse(&page).ok()),
        (Request::read_identification(Basic, 0), Some(Answer::exception(0x2B, ExceptionCode::ILLEGAL_FUNCTION))),
    ];
    for (request, answer) in answers {
        let (asked, came) = (Adu::request(unit().into(), &request), Adu::answer(unit(), &answer.unwrap()));
        let wire = [asked.as_bytes(), came.as_bytes()].concat();
        let mut sniffer = Sniffer::new(&SerialFormat::DEFAULT);
        sniffer.receive(Instant::ZERO, &wire);
        let mut heard = Vec::new();
        let mut now = Instant::ZERO;
        while heard.len() < 2 {
            while let Some(told) = sniffer.poll(now) {
                heard.push((told.bytes.to_vec(), told.role));
            }
            now = sniffer.deadline().unwrap_or(now + Duration::from_secs(1));
            assert!(now < Instant::ZERO + Duration::from_secs(60), "{heard:?}");
        }
        assert_eq!(heard[0], (asked.as_bytes().to_vec(), Role::Request), "{request:?}");
        assert_eq!(heard[1].0, came.as_bytes(), "{request:?}");
        assert!(matches!(heard[1].1, Role::Answer), "{:?}", heard[1].1);
    }
}

fn any_page() -> impl Strategy<Value = Vec<u8>> {
    let objects = proptest::collection::btree_map(any::<u8>(), proptest::collection::vec(any::<u8>(), 0..20), 0..9);
    (1_u8..=3, objects).prop_map(|(level, objects)| {
        let last = [2, 0x7F, 0xFF][usize::from(level) - 1];
        let objects: Vec<_> = objects.into_iter().filter(|(object, _)| *object <= last).collect();
        let mut pdu = vec![0x2B, 0x0E, level, 0x80 | level, 0, 0, u8::try_from(objects.len()).unwrap()];
        for (object, value) in objects {
            pdu.extend([object, u8::try_from(value.len()).unwrap()]);
            pdu.extend(value);
        }
        pdu
    })
}

proptest! {
    /// Nothing that is cut or extended is an answer to the same question, and what is right is one to no other level.
    #[test]
    fn no_other_length_is_an_answer(page in any_page(), cut in 1_usize..40, behind in proptest::collection::vec(any::<u8>(), 1..40)) {
        let level = IdentificationLevel::of_code(page[2]).unwrap();
        let request = Request::read_identification(level, 0);
        prop_assert!(request.judge(&page).is_ok());
        let left = page.len().saturating_sub(cut).max(3);
        prop_assert!(left == page.len() || request.judge(&page[..left]).is_err());
        let longer = [&page[..], &behind].concat();
        prop_assert!(request.judge(&longer).is_err());
        for other in [Basic, Regular, Extended, One] {
            prop_assert_eq!(Request::read_identification(other, 0).judge(&page).is_ok(), other == level);
        }
    }

    /// Of the bytes that say how it is built, none can be another one.
    #[test]
    fn no_byte_that_says_how_it_is_built_can_be_another(page in any_page(), at in 0_usize..7, to in any::<u8>()) {
        let request = Request::read_identification(IdentificationLevel::of_code(page[2]).unwrap(), 0);
        let mut changed = page.clone();
        changed[at] = to;
        let same = match at {
            3 => matches!(to & 0x7F, 1..=3),
            // What begins where nothing follows is said of nothing.
            5 => true,
            _ => to == page[at],
        };
        // FFH says that more follows from 00H on, which none does that has an object.
        prop_assert_eq!(request.judge(&changed).is_ok(), same, "{:02X?}", changed);
    }

    /// One changed byte on the wire is heard as no answer at all, by whoever waits for one.
    #[test]
    fn a_damaged_answer_is_none(page in any_page(), at in any::<proptest::sample::Index>(), by in 1_u8..) {
        let request = Request::read_identification(IdentificationLevel::of_code(page[2]).unwrap(), 0);
        let mut wire = Adu::answer(unit(), &Answer::custom(&page).unwrap()).as_bytes().to_vec();
        let at = at.index(wire.len());
        wire[at] ^= by;
        let mut framer = Framer::new(T35);
        framer.expect(unit(), request.expected());
        framer.wait_for_the_rest(Duration::from_millis(20), Instant::ZERO);
        framer.receive(Instant::ZERO, &wire);
        let mut now = Instant::ZERO;
        loop {
            while let Some(heard) = framer.poll(now) {
                let taken = heard.is_ok_and(|frame| request.expected().judge_frame(unit(), &frame).is_ok());
                prop_assert!(!taken);
            }
            match framer.deadline() {
                Some(next) => now = next,
                None => break,
            }
        }
    }
}
