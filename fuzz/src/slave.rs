//! Invariant: a unit hears exactly the frames on the line, takes those for itself and for all as what their bytes say,
//! and what it answers is a valid answer to what it was asked.

use drivebus_rtu::{
    Adu, Answer, DataBits, Destination, ExceptionCode, IdentificationPage, Instant, MAX_PDU, Parity, Request,
    SerialFormat, Silence, Slave, SlaveEvent, StopBits, UnitAddress,
};

use crate::listener::{HELD, bursts};
use crate::oracle::{self, Asked, Length, Verdict};
use crate::stream::{Arrival, Input, SILENCE, arrivals};

/// What a unit made of the line.
#[derive(Debug, PartialEq, Eq)]
enum Heard {
    /// For this unit (true) or for all, told by the frame that asks the same.
    Asked(bool, Vec<u8>),
    /// For this unit or for all, of an impossible shape, with its function.
    Malformed(bool, u8),
    Foreign(Vec<u8>),
    Bad(u8),
}

/// See the file's first lines. The input: who listens, then a stream.
pub fn slave(data: &[u8]) {
    let mut input = Input::new(data);
    let Ok(unit) = UnitAddress::new(1 + input.byte() % 4) else { return };
    let stream = arrivals(&mut input);
    let silence = Silence::Fixed(SILENCE);
    let format = SerialFormat::new(19_200, DataBits::Eight, Parity::Even, StopBits::One, silence);
    let Ok(format) = format else { return };
    let mut slave = Slave::new(unit, &format);
    let mut heard = Vec::new();
    let mut now = Instant::ZERO;
    let end = Arrival { gap: SILENCE, bytes: Vec::new() };
    for Arrival { gap, bytes } in stream.iter().chain([&end]) {
        let next = now + *gap;
        while let Some(deadline) = slave.deadline().filter(|&deadline| deadline <= next) {
            now = now.max(deadline);
            listen(&mut slave, now, &mut heard);
            assert!(slave.deadline().is_none_or(|later| later > now), "a deadline in the past for ever");
        }
        now = next;
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            rest = &rest[slave.receive(now, rest)..];
            listen(&mut slave, now, &mut heard);
        }
    }
    let bursts = bursts(&stream);
    if bursts.iter().all(|burst| burst.len() <= HELD) {
        let all = bursts.iter().flat_map(|burst| oracle::frames_in(burst));
        let expected: Vec<Heard> = all.map(|found| expected(unit, found)).collect();
        assert_eq!(heard, expected);
    }
}

fn listen(slave: &mut Slave, now: Instant, heard: &mut Vec<Heard>) {
    let unit = slave.unit();
    while let Some(event) = slave.poll(now) {
        match event {
            SlaveEvent::Request { request, broadcast } => {
                let destination = if broadcast { Destination::Broadcast } else { unit.into() };
                let asked = Adu::request(destination, &request);
                check_answer(unit, &request, asked.as_bytes());
                heard.push(Heard::Asked(!broadcast, asked.as_bytes().to_vec()));
            }
            SlaveEvent::Malformed { function, error, broadcast } => {
                assert!(!error.to_string().is_empty());
                let refusal = Adu::answer(unit, &Answer::exception(function, ExceptionCode::ILLEGAL_VALUE));
                assert_eq!(refusal.as_bytes(), oracle::sealed(&[unit.get(), function | 0x80, 3]));
                heard.push(Heard::Malformed(!broadcast, function));
            }
            SlaveEvent::Foreign(frame) => heard.push(Heard::Foreign(frame.as_bytes().to_vec())),
            SlaveEvent::Bad { error, bytes } => {
                assert!(!error.to_string().is_empty() && !bytes.is_empty());
                heard.extend(bytes.iter().map(|&byte| Heard::Bad(byte)));
            }
            _ => unreachable!("a kind of event that this target does not know"),
        }
    }
}

/// What `unit` should make of a frame, or of a byte that belongs to none.
fn expected(unit: UnitAddress, found: Result<&[u8], u8>) -> Heard {
    let bytes = match found {
        Ok(bytes) => bytes,
        Err(byte) => return Heard::Bad(byte),
    };
    match oracle::frame(bytes) {
        Some((address, pdu)) if address == 0 || address == unit.get() => match pdu[0] {
            _ if oracle::is_request(pdu) => Heard::Asked(address != 0, bytes.to_vec()),
            function @ 1..=127 => Heard::Malformed(address != 0, function),
            _ => Heard::Foreign(bytes.to_vec()),
        },
        _ => Heard::Foreign(bytes.to_vec()),
    }
}

/// A unit that answers everything: as a device made of these parts would.
fn check_answer(unit: UnitAddress, request: &Request<'_>, asked: &[u8]) {
    let words: Vec<u16>;
    let mut buffer = [0; MAX_PDU];
    let answer = match *request {
        Request::Read { table, address, count, .. } => {
            // Whole bytes of bits: of the others an answer by itself does not tell.
            let whole = if table.is_bits() { count.next_multiple_of(8) } else { count };
            words = (0..whole).map(|n| if table.is_bits() { n & 1 } else { address.wrapping_add(n) }).collect();
            Answer::read_of(table, &words).ok()
        }
        Request::ReadWrite { address, count, .. } => {
            words = (0..count).map(|n| address.wrapping_add(n)).collect();
            Answer::read_write(&words).ok()
        }
        Request::ReportServerId => Answer::server_id(&[1, 0xFF]).ok(),
        Request::ReadIdentification { level, object, .. } => {
            let objects: Vec<(u8, &[u8])> = (0..=object).map(|number| (number, &b"object"[..])).collect();
            Some(IdentificationPage::answer(&objects, (level, object), &mut buffer))
        }
        Request::Custom { pdu, .. } => Answer::custom(pdu).ok(),
        _ => Answer::confirming(request),
    };
    let Some(answer) = answer else {
        unreachable!("no answer to {request:?}");
    };
    let adu = Adu::answer(unit, &answer);
    let Some((address, came)) = oracle::frame(adu.as_bytes()) else {
        unreachable!("{adu:?} is no frame");
    };
    let (_, pdu) = oracle::frame(asked).unwrap_or_default();
    let length = if matches!(request, Request::Custom { .. }) { Length::Any } else { Length::Named };
    let asked = Asked { pdu: pdu.to_vec(), length };
    let is_right = asked.judge(came) == Verdict::Right;
    // Of a function without a name the request itself is an answer, where the specification does not say otherwise.
    assert!(is_right || matches!(request, Request::Custom { .. }), "{request:?} confirmed by {came:02X?}");
    let asked_for = match *request {
        Request::Read { count, .. } => answer.shortened(count),
        _ => answer,
    };
    assert_eq!((address, request.judge(came) == Ok(asked_for)), (unit.get(), is_right));
}
