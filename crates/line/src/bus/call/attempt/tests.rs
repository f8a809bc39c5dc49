//! What is told when a call has no request left, or nothing that was tried helped.

use drivebus_rtu::{Duration, ExceptionCode, FrameError, SerialFormat, UnitAddress};

use super::*;
use crate::bus::Bus;
use crate::nobody;
use crate::options::{BusOptions, CallOptions};

const UNIT: UnitAddress = UnitAddress::MIN;
const REFUSAL: Failure = Failure::Refused { function: 8, code: ExceptionCode::ILLEGAL_FUNCTION };
const DAMAGE: Failure = Failure::Corrupt(FrameError::Crc { computed: 1, received: 2 });

/// What a read is told that has no request left: with answers that did not agree so far, if `heard` says how many, and whose
/// latest probe ended in `probed`.
fn told(heard: Option<u32>, probed: Option<Failure>) -> Failure {
    let bus = Bus::open(nobody::opener(), BusOptions::new(SerialFormat::DEFAULT), &mut || false).unwrap();
    let read = Request::read(7, 1).unwrap();
    let ask = bus.port().ask(UNIT.into(), &read, &CallOptions::default());
    let call = Call::new(bus.port(), ask, CallOptions::default());
    let mut turn = bus.port().queue.turn((Priority::Read, Some(UNIT)), &mut || false).unwrap();

    let mut course = Course::new(Duration::from_millis(100), 0);
    while course.sends() {}
    course.hearing = heard.map(|asked| {
        let rivals = Attribution::Repeat { words: 4, refusal: 4 };
        Hearing { agreement: Agreement::new(rivals, 1), asked, known: None }
    });
    let failure = probed.map(|failure| ask.failed(failure, None, None, &[]));
    let mut tried = Tried::default();
    tried.failure = failure;
    let Err(error) = call.until_sure(&mut turn, &mut course, &mut tried, true, &mut || false) else {
        panic!("it may ask");
    };
    assert_eq!(error.sent, None);
    error.failure
}

#[test]
fn a_call_that_has_no_request_left_says_what_kept_it() {
    assert_eq!(told(None, None), Failure::Doubtful);
    assert_eq!(told(None, Some(DAMAGE)), DAMAGE, "what became of the latest probe");
    assert_eq!(told(None, Some(REFUSAL)), Failure::Doubtful, "it was the probe that was refused, not the read");
    assert_eq!(told(Some(6), None), Failure::Disagreeing { asked: 6 });
    assert_eq!(told(Some(6), Some(DAMAGE)), DAMAGE, "the answers were not what ended it");
    assert_eq!(told(Some(6), Some(REFUSAL)), Failure::Doubtful);
}
