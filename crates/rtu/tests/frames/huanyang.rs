//! Huanyang's own protocol: frames that others print, what is said in it, and what is its frame.

use drivebus_rtu::huanyang::{Huanyang, Protocol, has_form, is_sure};
use drivebus_rtu::{
    Adu, Answer, ExceptionCode, Frame, Framer, Instant, MAX_PDU, Request, SerialFormat, Slave, SlaveEvent, Table,
    UnitAddress, crc16,
};

/// `bytes` with their CRC behind them.
fn framed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc16(bytes).to_le_bytes()].concat()
}

/// hy_modbus.c: functions, lengths and data. Modbus: a read of one register, its answer, a single write.
#[test]
fn a_frame_that_modbus_has_is_not_surely_of_this_protocol() {
    for (bytes, form, sure) in [
        (&[1, 3, 1, 0x08][..], true, true),
        (&[1, 4, 3, 0, 0, 0], true, true),
        (&[1, 4, 3, 0, 0, 1], true, false),
        (&[1, 4, 3, 0, 0, 125], true, false),
        (&[1, 4, 3, 0, 0, 126], true, true),
        (&[1, 4, 1, 0], true, true),
        (&[1, 5, 2, 0x13, 0x88], true, true),
        (&[1, 6, 2, 0, 0], true, true),
        (&[1, 6, 3, 0, 0, 0], true, false),
        (&[1, 1, 3, 0, 0, 0], true, false),
        (&[1, 2, 2, 0, 0], true, false),
        (&[1, 3, 2, 0, 0], false, false),
        (&[1, 7, 2, 0, 0], false, false),
        (&[1, 3, 0, 0, 0, 1], false, false),
    ] {
        let mut frame = framed(bytes);
        assert_eq!((has_form(&frame), is_sure(&frame)), (form, sure), "{bytes:02X?}");
        frame[0] ^= 1;
        assert!(!has_form(&frame), "{bytes:02X?}");
    }
    assert!(!has_form(&[]) && !is_sure(&[1, 3, 1]));
}

/// A unit, what it is asked, the frame of that, its answer, and the word that it tells.
type Printed = (u8, Huanyang, &'static [u8], &'static [u8], Option<u16>);

/// Frames as others print them: unit 4 of a Huanyang HY01D523B (unininu.tistory.com, 01. Function Read); FluidNC,
/// HuanyangProtocol.cpp (start, stop, 25 Hz); Dema D5M manual, p. 72 (set frequency, 30 Hz).
const PRINTED: [Printed; 7] = [
    (
        4,
        Huanyang::ReadParameter { number: 1 },
        &[0x04, 0x01, 0x03, 0x01, 0x00, 0x00, 0x6D, 0xDB],
        &[0x04, 0x01, 0x02, 0x01, 0x02, 0xF5, 0xAD],
        Some(2),
    ),
    (
        4,
        Huanyang::ReadParameter { number: 2 },
        &[0x04, 0x01, 0x03, 0x02, 0x00, 0x00, 0x9D, 0xDB],
        &[0x04, 0x01, 0x02, 0x02, 0x02, 0xF5, 0x5D],
        Some(2),
    ),
    (
        1,
        Huanyang::Control { bits: 0x01 },
        &[0x01, 0x03, 0x01, 0x01, 0x31, 0x88],
        &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
        None,
    ),
    (
        1,
        Huanyang::Control { bits: 0x11 },
        &[0x01, 0x03, 0x01, 0x11, 0x30, 0x44],
        &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
        None,
    ),
    (
        1,
        Huanyang::Control { bits: 0x08 },
        &[0x01, 0x03, 0x01, 0x08, 0xF1, 0x8E],
        &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
        None,
    ),
    (
        1,
        Huanyang::SetFrequency { value: 2500 },
        &[0x01, 0x05, 0x02, 0x09, 0xC4, 0xBF, 0x0F],
        &[0x01, 0x05, 0x02, 0x09, 0xC4, 0xBF, 0x0F],
        None,
    ),
    (
        1,
        Huanyang::ReadStatus { number: 0 },
        &[0x01, 0x04, 0x01, 0x00, 0x41, 0x89],
        &[0x01, 0x04, 0x03, 0x00, 0x0B, 0xB8, 0xF7, 0x0C],
        Some(3000),
    ),
];

#[test]
fn frames_are_as_they_are_printed() {
    for (unit, asked, request, answer, word) in PRINTED {
        let address = UnitAddress::new(unit).unwrap();
        let request_of = Request::Huanyang(asked);
        assert_eq!(Adu::request(address.into(), &request_of).as_bytes(), request, "{asked:?}");
        assert_eq!(request_of.adu_len(), request.len());
        assert_eq!(Huanyang::parse(Frame::parse(request).unwrap().pdu()), Some(asked));

        let mut framer = Framer::new(SerialFormat::DEFAULT.t35());
        framer.expect(address, request_of.expected());
        for (at, byte) in answer.iter().enumerate() {
            assert!(framer.poll(Instant::ZERO).is_none(), "{asked:?}: {at}");
            framer.receive(Instant::ZERO, &[*byte]);
        }
        let frame = framer.poll(Instant::ZERO).unwrap().unwrap();
        assert_eq!(frame.as_bytes(), answer, "at its last byte");
        let told = request_of.judge(frame.pdu()).unwrap();
        let mut room = [0];
        let write = Request::write(0x0300, 8);
        match asked.as_answered(told, &write, &mut room) {
            Answer::Read { words, .. } => assert_eq!(words.get(0), word),
            other => assert_eq!((Some(other), word), (Answer::confirming(&write), None)),
        }
        // The same of another unit, and with another number, is none.
        assert!(request_of.expected().judge_frame(UnitAddress::new(9).unwrap(), &frame).is_err());
    }
}

#[test]
fn an_answer_to_something_else_is_none() {
    for (asked, pdu) in [
        (Huanyang::ReadParameter { number: 5 }, &[1, 3, 6, 0x9C, 0x40][..]),
        (Huanyang::ReadParameter { number: 5 }, &[1, 4, 5, 0, 0, 0]),
        (Huanyang::ReadStatus { number: 1 }, &[4, 3, 0, 0x9C, 0x40]),
        (Huanyang::ReadStatus { number: 1 }, &[4, 2, 1, 0]),
        (Huanyang::WriteParameter { number: 5, value: 40_000 }, &[2, 3, 5, 0x9C, 0x41]),
        (Huanyang::SetFrequency { value: 2500 }, &[5, 2, 9, 0xC5]),
        (Huanyang::Control { bits: 8 }, &[3, 2, 0, 8]),
        (Huanyang::Control { bits: 8 }, &[0x83, 2, 0, 8]),
    ] {
        assert!(Request::Huanyang(asked).judge(pdu).is_err(), "{asked:?}");
    }
    // A refusal as the maker has it, and as one of Modbus has it.
    for pdu in [&[0x81, 1, 5][..], &[0x81, 2]] {
        let told = Request::Huanyang(Huanyang::ReadParameter { number: 5 }).judge(pdu);
        assert_eq!(told, Ok(Answer::exception(1, ExceptionCode::ILLEGAL_ADDRESS)));
    }
    let told = Request::Huanyang(Huanyang::WriteParameter { number: 5, value: 0 }).judge(&[0x82, 1, 5]);
    assert_eq!(told, Ok(Answer::exception(2, ExceptionCode::ILLEGAL_VALUE)));
}

#[test]
fn each_register_stands_for_one_thing_and_nothing_else_is_said() {
    let read = |address| Huanyang::of(&Request::read(address, 1).unwrap());
    let write = |address, value| Huanyang::of(&Request::write(address, value));
    assert_eq!(read(0x0105), Some(Huanyang::ReadParameter { number: 5 }));
    assert_eq!(read(0x0401), Some(Huanyang::ReadStatus { number: 1 }));
    assert_eq!(write(0x0105, 7), Some(Huanyang::WriteParameter { number: 5, value: 7 }));
    assert_eq!(write(0x0300, 0x11), Some(Huanyang::Control { bits: 0x11 }));
    assert_eq!(write(0x0500, 2500), Some(Huanyang::SetFrequency { value: 2500 }));
    for address in [0x0000, 0x0200, 0x0300, 0x0500, 0x2000, 0x8105] {
        assert_eq!(read(address), None, "{address:04X}");
    }
    for (address, value) in [(0x0300, 0x100), (0x0301, 1), (0x0401, 1), (0x0501, 1), (0x2000, 5)] {
        assert_eq!(write(address, value), None, "{address:04X}");
    }
    assert_eq!(Huanyang::of(&Request::read(0x0105, 2).unwrap()), None);
    assert_eq!(Huanyang::of(&Request::read_of(Table::Input, 0x0401, 1).unwrap()), None);
    assert_eq!(Huanyang::of(&Request::echo(7)), None);
    assert_eq!(Huanyang::of(&Request::write_many(0x0500, &[2500]).unwrap()), None);
}

/// Each request of a master is what a unit hears, and each answer of a unit what the master takes.
#[test]
fn a_master_and_a_unit_understand_each_other() {
    let unit = UnitAddress::MIN;
    for word in [0_u16, 1, 0x0A, 0xFF, 0x100, 0x9C40, 0xFFFF] {
        let [low, _] = word.to_le_bytes();
        for asked in [
            Huanyang::ReadParameter { number: low },
            Huanyang::WriteParameter { number: low, value: word },
            Huanyang::Control { bits: low },
            Huanyang::ReadStatus { number: low },
            Huanyang::SetFrequency { value: word },
        ] {
            let request = Request::Huanyang(asked);
            let mut slave = Slave::new(unit, &SerialFormat::DEFAULT).speaking(Protocol::Huanyang);
            slave.receive(Instant::ZERO, Adu::request(unit.into(), &request).as_bytes());
            let silent = slave.deadline().unwrap_or(Instant::ZERO);
            assert_eq!(slave.poll(silent), Some(SlaveEvent::Request { request, broadcast: false }));
            let mut pdu = [0; MAX_PDU];
            let len = asked.answer(word, word <= 0xFF, 0x09, &mut pdu);
            assert_eq!(request.judge(&pdu[..len]), Ok(Answer::custom(&pdu[..len]).unwrap()));
            assert!(matches!(request.judge(&asked.refusal()), Ok(Answer::Exception { .. })));
        }
    }
    // A read of Modbus is nothing to such a unit.
    let mut slave = Slave::new(unit, &SerialFormat::DEFAULT).speaking(Protocol::Huanyang);
    slave.receive(Instant::ZERO, &[0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
    assert!(matches!(slave.poll(Instant::ZERO), Some(SlaveEvent::Foreign(_))));
}
