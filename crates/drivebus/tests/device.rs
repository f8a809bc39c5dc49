//! Who made a unit, asked over a real connection, for who waits and for who awaits.

#![cfg(feature = "tcp")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::io::{Read, Write};
use std::net::TcpListener;
use std::thread;
use std::time::Duration;

use drivebus::rtu::{
    Adu, Answer, ExceptionCode, IdentificationPage, Instant, MAX_PDU, Request, SerialFormat, Slave, SlaveEvent,
    UnitAddress,
};
use drivebus::{Bus, ErrorKind, aio};

const OBJECTS: &[(u8, &[u8])] = &[(0, b"Example"), (1, b"EX-1"), (2, b"V2.11"), (0x80, &[b'x'; 240])];

/// A unit 5 with these objects behind a serial server, for one connection; the URL of its port.
fn serve() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("socket://{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut slave = Slave::new(UnitAddress::new(5).unwrap(), &SerialFormat::DEFAULT);
        let (mut bytes, mut buffer, mut now) = ([0; 256], [0; MAX_PDU], Instant::ZERO);
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            slave.receive(now, &bytes[..count]);
            // Silence ends a request of a function that a unit does not know the length of.
            now = now + Duration::from_secs(1);
            let Some(SlaveEvent::Request { request, .. }) = slave.poll(now) else { continue };
            let answer = match request {
                Request::ReadIdentification { level, object, .. } => {
                    IdentificationPage::answer(OBJECTS, (level, object), &mut buffer)
                }
                Request::Echo { .. } => Answer::confirming(&request).unwrap(),
                other => Answer::exception(other.function(), ExceptionCode::ILLEGAL_FUNCTION),
            };
            let frame = Adu::answer(UnitAddress::new(5).unwrap(), &answer);
            stream.write_all(frame.as_bytes()).unwrap();
        }
    });
    url
}

#[test]
fn a_unit_says_who_made_it() {
    let bus = Bus::open(&serve()).unwrap();
    let told = bus.device_identification(5).unwrap();
    assert_eq!((told.vendor().as_deref(), told.revision().as_deref()), (Some("Example"), Some("V2.11")));
    assert_eq!((told.product_code().as_deref(), told.model_name()), (Some("EX-1"), None));
    assert_eq!((told.objects()[&0x80].len(), told.conformity(), told.is_complete()), (240, 0x83, true));
    assert_eq!(bus.device_identification(0).unwrap_err().kind(), ErrorKind::NotAllowed);
}

#[tokio::test]
async fn it_says_the_same_to_who_awaits() {
    let bus = aio::Bus::open(&serve()).await.unwrap();
    let told = bus.device_identification(5).await.unwrap();
    assert_eq!(told.vendor().as_deref(), Some("Example"));
    assert!(told.is_complete());
}

#[cfg(feature = "sim")]
#[tokio::test]
async fn a_drive_that_does_not_know_the_function_refuses() {
    let bus = Bus::open("sim://gd350?clock=virtual").unwrap();
    let error = bus.device_identification(1).unwrap_err();
    assert_eq!((error.kind(), error.code(), error.may_have_acted()), (ErrorKind::Refused, Some(1), false));
    assert_eq!(bus.aio().device_identification(1).await.unwrap_err().code(), Some(1));
}
