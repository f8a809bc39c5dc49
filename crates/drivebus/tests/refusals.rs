//! What a refusal means is what the documents of the family say, also for who uses the crate.

#![cfg(all(feature = "tcp", feature = "builtin-profiles"))]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::io::{Read, Write};
use std::net::TcpListener;
use std::thread;
use std::time::Duration;

use drivebus::rtu::{
    Adu, Answer, ExceptionCode, Instant, MAX_PDU, Request, SerialFormat, Slave, SlaveEvent, UnitAddress,
};
use drivebus::{Bus, ErrorKind, Profile};

/// A unit 1 behind a serial server that refuses its first two reads by `code`, and has 1250 in each word; the URL of its port.
///
/// The first of a line that was just opened is asked again in any case, behind an echo.
fn refusing_twice(code: u8) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("socket://{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let unit = UnitAddress::new(1).unwrap();
        let mut slave = Slave::new(unit, &SerialFormat::DEFAULT);
        let (mut bytes, mut now, mut reads) = ([0; MAX_PDU], Instant::ZERO, 0);
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            now = now + Duration::from_secs(1);
            slave.receive(now, &bytes[..count]);
            let Some(SlaveEvent::Request { request, .. }) = slave.poll(now) else { continue };
            let answer = match request {
                Request::Echo { .. } => Answer::confirming(&request).unwrap(),
                Request::Read { count, .. } if reads == 2 => Answer::read(&[1250; 125][..count.into()]).unwrap(),
                other => {
                    reads += i32::from(matches!(other, Request::Read { .. }));
                    Answer::exception(other.function(), ExceptionCode(code))
                }
            };
            stream.write_all(Adu::answer(unit, &answer).as_bytes()).unwrap();
        }
    });
    url
}

/// ENC EDS300 manual, p. 45: 01H says that the request came with a wrong CRC, and 02H that it has no such function.
#[test]
fn an_eds300_that_heard_a_damaged_request_is_asked_again() {
    let read = |code, family| {
        let bus = Bus::open(&refusing_twice(code)).unwrap();
        let drive = bus.drive(1, &Profile::builtin(family).unwrap()).unwrap();
        drive.read("running_frequency").map(|value| value.to_string())
    };
    assert_eq!(read(0x01, "eds300").unwrap(), "12.50");
    assert_eq!(read(0x02, "eds300").unwrap_err().kind(), ErrorKind::Refused);
    // To a Goodrive 01H is a decision: it has no such function.
    assert_eq!(read(0x01, "gd350").unwrap_err().kind(), ErrorKind::Refused);
}
