//! Who made a unit, asked on a line on which answers come late, damaged, or not at all.

use drivebus_line::{CallError, CallOptions, DeviceIdentification, DeviceQuestion, Failure};
use drivebus_rtu::{Adu, Answer, IdentificationLevel, IdentificationPage, MAX_PDU, Request};

use crate::scripted::{OBJECTS, Pieces, Rig, after, at_once, lumps, millis, right, unit};

const BASIC: Request<'_> = Request::read_identification(IdentificationLevel::Basic, 0);

/// The basic identification of a unit whose revision is `revision`.
fn revised(revision: &[u8]) -> Vec<u8> {
    let mut buffer = [0; MAX_PDU];
    let objects: &[(u8, &[u8])] = &[(0, b"Example"), (1, b"EX-1"), (2, revision)];
    let answer = IdentificationPage::answer(objects, (IdentificationLevel::Basic, 0), &mut buffer);
    Adu::answer(unit(1), &answer).as_bytes().to_vec()
}

/// The revision that unit 1 gives, if it gives any.
fn revision(rig: &Rig, retries: u32) -> Result<Option<Vec<u8>>, Box<CallError>> {
    let mut told = None;
    let options = CallOptions::new().retries(retries);
    rig.call(unit(1).into(), &BASIC, options, &mut || false, &mut |answer| {
        if let Answer::Identification { page, .. } = answer {
            told = page.objects().find(|(object, _)| *object == 2).map(|(_, value)| value.to_vec());
        }
    })?;
    Ok(told)
}

fn device(rig: &Rig) -> Result<DeviceIdentification, Box<CallError>> {
    let mut question = DeviceQuestion::new();
    while let Some(request) = question.request() {
        let take = &mut |answer: Answer<'_>| question.answered(&answer);
        rig.call(unit(1).into(), &request, CallOptions::new().timeout(millis(2_000)), &mut || false, take)?;
    }
    Ok(question.told())
}

#[test]
fn all_objects_come_however_the_answers_are_cut() {
    for in_lumps in [false, true] {
        let rig = Rig::new(move |_, sent| match right(sent) {
            bytes if in_lumps => lumps(millis(5), &bytes),
            bytes => at_once(&bytes),
        });
        let told = device(&rig).unwrap();
        assert!(told.is_complete());
        let objects: Vec<_> = told.objects().iter().map(|(object, value)| (*object, value.as_slice())).collect();
        assert_eq!(objects, OBJECTS);
        assert_eq!(rig.wire.lock().unwrap().sent.len(), 2);
    }
}

/// Nothing on the way to an answer may be taken for it: a byte is damaged, lost or added at each place.
#[test]
fn what_is_damaged_on_the_way_is_asked_for_again() {
    let whole = revised(b"V1");
    for place in 0..whole.len() {
        for kind in 0..3 {
            let mut spoilt = whole.clone();
            match kind {
                0 => spoilt[place] ^= 0x11,
                1 => drop(spoilt.remove(place)),
                _ => spoilt.insert(place, 0x5A),
            }
            let right = whole.clone();
            let rig = Rig::new(move |_, sent| match sent[1] {
                0x2B if spoilt.is_empty() => at_once(&right),
                0x2B => at_once(&std::mem::take(&mut spoilt)),
                _ => at_once(&crate::scripted::right(sent)),
            });
            assert_eq!(revision(&rig, 2).unwrap().as_deref(), Some(&b"V1"[..]), "place {place}, kind {kind}");
            // A byte too many may stand before the answer or behind it, and spoils nothing there.
            let is_beside = kind == 2 && place == 0;
            assert_eq!(rig.sent(&BASIC), if is_beside { 1 } else { 2 }, "place {place}, kind {kind}");
        }
    }
}

/// The answer to the first question comes when the second is out, and before its own: it is not taken for that.
#[test]
fn a_late_answer_is_not_that_to_the_next_question() {
    for late in [510, 530, 700, 1_400] {
        let mut number = 0;
        let rig = Rig::new(move |_, sent| {
            if sent[1] != 0x2B {
                return after(millis(10), &right(sent));
            }
            number += 1;
            match number {
                1 => after(millis(late), &revised(b"V1")),
                _ => after(millis(60), &revised(b"V2")),
            }
        });
        assert!(matches!(revision(&rig, 0).unwrap_err().failure, Failure::NoAnswer { .. }));
        match revision(&rig, 0) {
            Ok(told) => assert_eq!(told.as_deref(), Some(&b"V2"[..]), "{late} ms"),
            Err(error) => assert!(error.sent.is_none(), "{late} ms: {error}"),
        }
    }
}

/// The unit misses the first question, and sends every word back.
#[test]
fn what_only_reads_is_asked_again_and_a_write_is_not() {
    let again = CallOptions::new().retries(2);
    for (request, times) in [
        (BASIC, 2),
        (Request::report_server_id(), 2),
        (Request::mask_write(4, 0, 1), 1),
        (Request::write_coils(4, &[1]).unwrap(), 1),
        (Request::read_write(4, 1, 4, &[1]).unwrap(), 1),
    ] {
        let (mut is_first, function) = (true, request.function());
        let rig = Rig::new(move |_, sent| {
            let misses = sent[1] == function && std::mem::take(&mut is_first);
            if misses { Pieces::new() } else { after(millis(10), &right(sent)) }
        });
        let came = rig.call(unit(1).into(), &request, again, &mut || false, &mut |_| ());
        assert_eq!((rig.sent(&request), came.is_ok()), (times, times > 1), "{request:?}: {came:?}");
        assert!(came.is_ok() || came.is_err_and(|error| error.may_have_acted()));
    }
}
