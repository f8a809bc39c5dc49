//! Writes that an earlier one could confirm, and what makes sure of them; calls that end while something of them waits.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};

use drivebus_line::{CallError, CallOptions, Done, Errand, Failure, PortErrorKind, Running};
use drivebus_rtu::{Adu, Answer, ExceptionCode, OVERTAKING, Request, function};

use crate::scripted::{Pieces, Rig, after, at_once, millis, right, unit};

/// What a unit shows in register 100, right or damaged.
fn shows(word: u16) -> Vec<u8> {
    Adu::answer(unit(1), &Answer::read(&[word]).unwrap()).as_bytes().to_vec()
}

/// A unit that confirms the first write to register 100 so late that it is taken for the confirmation of the third, which it
/// does not hear. Reads of register 100 are answered by `read_back`.
fn late(read_back: impl Fn() -> Pieces + Send + 'static) -> Rig {
    let mut writes = 0;
    let rig = Rig::new(move |_, request| match request {
        [1, 6, 0, 100, ..] => {
            writes += 1;
            match writes {
                1 => after(millis(1_500), &right(request)),
                3 => Vec::new(),
                _ => at_once(&right(request)),
            }
        }
        [1, 3, 0, 100, ..] => read_back(),
        _ => at_once(&right(request)),
    });
    rig.read(7, 1).unwrap();
    let before = rig.now();
    write(&rig, 5, None).unwrap_err();
    write(&rig, 6, None).unwrap();
    // The late one is there some ten milliseconds after what is sent now.
    rig.pass(millis(1_480).saturating_sub(rig.since(before)));
    rig
}

fn write(rig: &Rig, word: u16, read_back: Option<u16>) -> Result<Done, Box<CallError>> {
    let options = CallOptions::new().read_back(read_back);
    rig.call(unit(1).into(), &Request::write(100, word), options, &mut || false, &mut |_| ())
}

fn look_up() -> Request<'static> {
    Request::read(100, 1).unwrap()
}

/// What the unit shows decides, and not the confirmation of an earlier write.
#[test]
fn a_confirmation_that_may_be_an_earlier_ones_proves_nothing() {
    for (shown, outcome) in [(6, Err(Failure::NotTaken { times: 1, shows: vec![6] })), (5, Ok(()))] {
        let rig = late(move || at_once(&shows(shown)));
        let before = rig.now();
        let result = write(&rig, 5, Some(100));
        assert!(rig.since(before) < millis(200), "nothing was waited for");
        assert_eq!(result.map(|_| ()).map_err(|error| error.failure), outcome);
        assert_eq!((rig.sent(&Request::write(100, 5)), rig.sent(&look_up())), (2, 1));
    }
}

/// The request went out, whatever became of the look that followed.
#[test]
fn a_write_that_is_neither_proven_nor_found_is_said_to_be_sent() {
    let rig = late(|| {
        let mut answer = shows(6);
        answer[4] ^= 1;
        at_once(&answer)
    });
    let before = rig.now();
    let error = write(&rig, 5, Some(100)).unwrap_err();
    assert!(matches!(error.failure, Failure::Corrupt(_)), "{error}");
    let sent = error.sent.unwrap().saturating_duration_since(before);
    assert!(sent < millis(20), "when the write went out, not when it was looked for: {sent:?}");
    assert_eq!(error.request, Adu::request(unit(1).into(), &Request::write(100, 5)).as_bytes());
    assert_eq!(rig.sent(&look_up()), 1);
}

#[test]
fn what_nothing_else_could_confirm_is_not_looked_up() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    rig.read(7, 1).unwrap();
    for word in [5, 6, 5] {
        write(&rig, word, Some(100)).unwrap();
    }
    assert_eq!(rig.sent(&look_up()), 0);
}

/// Of a write that was not confirmed at all, its own failure is told.
#[test]
fn a_write_that_is_not_confirmed_and_cannot_be_looked_up_has_no_answer() {
    let rig = Rig::new(|_, request| {
        let mut answer = right(request);
        answer[4] ^= 1;
        match request {
            [1, 6, ..] => Vec::new(),
            [1, 3, 0, 100, ..] => at_once(&answer),
            _ => at_once(&right(request)),
        }
    });
    rig.read(7, 1).unwrap();
    let error = write(&rig, 5, Some(100)).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { .. }) && error.sent.is_some(), "{error}");
    assert_eq!(rig.sent(&look_up()), 1);
}

/// It is the read that decides, so that it waits where an open answer could pass for its own.
#[test]
fn what_is_read_back_waits_until_no_earlier_read_can_answer_it() {
    let words: Vec<u16> = (100..140).collect();
    let rig = Rig::new(move |_, request| match request {
        [1, 16, ..] | [1, 3, 0x10, ..] => Vec::new(),
        // It gives them all, or none of them.
        [1, 3, 0, 100..=255, _, 0..=39, ..] => {
            let refusal = Answer::exception(function::READ_HOLDING, ExceptionCode::ILLEGAL_ADDRESS);
            at_once(Adu::answer(unit(1), &refusal).as_bytes())
        }
        _ => at_once(&right(request)),
    });
    rig.read(7, 1).unwrap();
    // More than can be outvoted, of a length that no longer form helps.
    let in_doubt = CallOptions::new().in_doubt(true);
    for address in 0x1000..0x1004 {
        let read = Request::read(address, 40).unwrap();
        rig.call(unit(1).into(), &read, in_doubt, &mut || false, &mut |_| ()).unwrap_err();
    }
    let given_up = rig.now();
    let options = CallOptions::new().read_back(100);
    let write = Request::write_many(100, &words).unwrap();
    rig.call(unit(1).into(), &write, options, &mut || false, &mut |_| ()).unwrap();
    assert_eq!(rig.sent(&Request::read(100, 40).unwrap()), 1);
    assert!(rig.since(given_up) >= OVERTAKING);
}

/// A write that only time can make sure of waits for seconds, and its caller need not.
#[test]
fn who_gives_up_waits_for_no_doubt_and_sends_nothing() {
    let rig = Rig::new(|_, request| if request[1] == 6 { Vec::new() } else { at_once(&right(request)) });
    rig.read(7, 1).unwrap();
    write(&rig, 5, None).unwrap_err();
    let before = rig.now();
    let again = Request::write(100, 5);
    let error = rig.call(unit(1).into(), &again, CallOptions::default(), &mut || true, &mut |_| ()).unwrap_err();
    assert_eq!((error.failure, error.sent), (Failure::Interrupted, None));
    assert!(rig.since(before) < millis(100), "an echo, and one look whether it is still wanted");
    assert_eq!(rig.sent(&again), 1);
}

/// An errand whose caller takes it back while `is_met` is on the wire, which is answered.
fn abandoned(is_met: fn(&[u8]) -> bool) -> (Rig, Result<(), Box<CallError>>) {
    let running: Arc<Mutex<Option<Running>>> = Arc::default();
    let (meeting, mut writes) = (Arc::clone(&running), 0);
    let rig = Rig::new(move |_, request| {
        if request[1] == 6 {
            writes += 1;
            if writes == 1 {
                return Vec::new();
            }
        }
        // Held until it is known which errand that is.
        if is_met(request)
            && let Some(running) = meeting.lock().unwrap().take()
        {
            running.abandon();
        }
        at_once(&right(request))
    });
    rig.read(7, 1).unwrap();
    write(&rig, 5, None).unwrap_err();
    let (tell, told) = channel();
    let mut slot = running.lock().unwrap();
    *slot =
        rig.bus.send(Errand::new(unit(1).into(), &Request::write(200, 5), CallOptions::default(), move |outcome| {
            tell.send(outcome.map(|_| ())).unwrap();
        }));
    drop(slot);
    let outcome = told.recv().unwrap();
    (rig, outcome)
}

#[test]
fn what_is_taken_back_while_its_unit_is_probed_is_not_sent() {
    let (rig, outcome) = abandoned(|request| request[1] == 8);
    let error = outcome.unwrap_err();
    assert_eq!((error.failure, error.sent), (Failure::Interrupted, None));
    assert_eq!(rig.sent(&Request::write(200, 5)), 0);
}

#[test]
fn what_is_taken_back_on_the_wire_is_told_as_it_ends() {
    let (rig, outcome) = abandoned(|request| request[..4] == [1, 6, 0, 200]);
    outcome.unwrap();
    assert_eq!(rig.sent(&Request::write(200, 5)), 1);
}

/// Where the port is lost twice, how it was lost first tells more, unless the request went out only the second time.
#[test]
fn a_request_that_went_out_before_the_port_was_lost_again_is_said_to_be_sent() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    rig.wire.lock().unwrap().vanish_before_sending = true;
    rig.wire.lock().unwrap().vanish_after_sending = true;
    let options = CallOptions::new().retries(1).in_doubt(true);
    let read = Request::read(100, 1).unwrap();
    let error = rig.call(unit(1).into(), &read, options, &mut || false, &mut |_| ()).unwrap_err();
    assert!(matches!(&error.failure, Failure::Port(port) if port.kind == PortErrorKind::Lost), "{error}");
    assert!(error.sent.is_some(), "{error}");
    assert_eq!((rig.sent(&read), rig.wire.lock().unwrap().opened), (1, 2));
}
