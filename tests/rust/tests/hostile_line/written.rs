//! Writes whose confirmation is missing: what may be written again, and what is told otherwise.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use drivebus_line::{CallError, CallOptions, Failure};
use drivebus_rtu::Request;

use crate::scripted::{Pieces, Rig, after, at_once, millis, right, unit};

/// A unit that keeps what is written to it.
#[derive(Default)]
struct Unit {
    words: BTreeMap<u16, u16>,
    /// Every write it took.
    log: Vec<(u16, u16)>,
}

impl Unit {
    fn take(&mut self, address: u16, word: u16) {
        self.words.insert(address, word);
        self.log.push((address, word));
    }

    fn answer(&mut self, request: &[u8]) -> Vec<u8> {
        let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
        match request[1] {
            6 => self.take(word(2), word(4)),
            16 => (0..word(4)).for_each(|index| self.take(word(2) + index, word(7 + 2 * usize::from(index)))),
            3 => {
                let words: Vec<u16> =
                    (word(2)..word(2) + word(4)).map(|a| self.words.get(&a).copied().unwrap_or(a)).collect();
                let answer = drivebus_rtu::Answer::read(&words).unwrap();
                return drivebus_rtu::Adu::answer(unit(1), &answer).as_bytes().to_vec();
            }
            _ => {}
        }
        right(request)
    }
}

/// What becomes of the write number `n`.
#[derive(Clone, Copy)]
enum Fate {
    Fine,
    /// The unit does not hear it.
    Unheard,
    /// The unit takes it, and is not heard.
    Unconfirmed,
    /// The unit takes something else.
    Clamped,
}

fn rig(fates: &'static [Fate]) -> (Rig, Arc<Mutex<Unit>>) {
    let unit = Arc::new(Mutex::new(Unit::default()));
    let inside = Arc::clone(&unit);
    let mut writes = 0;
    let rig = Rig::new(move |_, request| -> Pieces {
        let mut unit = inside.lock().unwrap();
        if !matches!(request[1], 6 | 16) {
            return at_once(&unit.answer(request));
        }
        let fate = fates.get(writes).copied().unwrap_or(Fate::Fine);
        writes += 1;
        match fate {
            Fate::Fine => at_once(&unit.answer(request)),
            Fate::Unheard => Vec::new(),
            Fate::Unconfirmed => {
                unit.answer(request);
                Vec::new()
            }
            Fate::Clamped => {
                unit.take(u16::from_be_bytes([request[2], request[3]]), 0x1111);
                Vec::new()
            }
        }
    });
    (rig, unit)
}

fn write(rig: &Rig, request: &Request<'_>, read_back: Option<u16>) -> Result<(), Box<CallError>> {
    let options = CallOptions::new().read_back(read_back).retries(2);
    rig.call(unit(1).into(), request, options, &mut || false, &mut |_| ()).map(|_| ())
}

#[test]
fn a_lost_confirmation_is_found_by_reading_and_the_write_is_not_repeated() {
    let (rig, unit) = rig(&[Fate::Unconfirmed, Fate::Unconfirmed]);
    write(&rig, &Request::write(100, 5), Some(100)).unwrap();
    assert_eq!(unit.lock().unwrap().log, [(100, 5)]);
    let words = [1, 2, 3];
    write(&rig, &Request::write_many(200, &words).unwrap(), Some(200)).unwrap();
    assert_eq!(unit.lock().unwrap().log.len(), 4);
}

#[test]
fn a_lost_write_is_repeated_once_the_unit_shows_another_value() {
    let (rig, unit) = rig(&[Fate::Unheard, Fate::Unheard]);
    write(&rig, &Request::write(100, 5), Some(100)).unwrap();
    assert_eq!(unit.lock().unwrap().log, [(100, 5)]);
    assert_eq!(rig.sent(&Request::write(100, 5)), 3);
}

#[test]
fn a_value_that_the_unit_does_not_keep_is_told() {
    let (rig, _unit) = rig(&[Fate::Clamped, Fate::Clamped, Fate::Clamped]);
    let error = write(&rig, &Request::write(100, 5), Some(100)).unwrap_err();
    assert_eq!(error.failure, Failure::NotTaken { times: 3, shows: vec![0x1111] });
    assert!(error.to_string().contains("the unit shows 1111H"), "{error}");
}

#[test]
fn without_a_place_to_read_it_back_a_write_is_sent_once() {
    let (rig, unit) = rig(&[Fate::Unheard]);
    let error = write(&rig, &Request::write(0x2000, 1), None).unwrap_err();
    assert!(matches!(error.failure, Failure::NoAnswer { .. }) && error.sent.is_some(), "{error}");
    assert_eq!(rig.sent(&Request::write(0x2000, 1)), 1);
    assert!(unit.lock().unwrap().log.is_empty());
}

/// Only what is read can be compared; sent twice, a command would be obeyed twice.
#[test]
fn to_verify_never_sends_a_write_or_an_echo_twice() {
    let verify = CallOptions::new().verify(true);
    for request in [Request::write(0x2000, 1), Request::write_many(0x2000, &[1, 5]).unwrap(), Request::echo(7)] {
        let rig = Rig::new(|_, request| at_once(&right(request)));
        rig.call(unit(1).into(), &request, verify, &mut || false, &mut |_| ()).unwrap();
        assert_eq!(rig.sent(&request), 1, "{request:?}");
    }
}

/// A write may be in doubt, what is read back never: the late answer to an earlier read would decide.
#[test]
fn a_write_in_doubt_is_not_confirmed_by_the_late_answer_to_an_earlier_read() {
    let rig = Rig::new(|number, request| match number {
        // The look at the adapter, and then a read whose answer comes a good second late: 500 ms for itself, 500 ms for
        // the write, and then it is there in the place of what was read back.
        1 => after(millis(1_020), &right(request)),
        2 => Vec::new(), // the write, which the unit does not hear
        _ => after(millis(30), &right(request)),
    });
    rig.read(7, 1).unwrap();
    rig.read(5, 1).unwrap_err();
    // Register 100 shows 100, whatever is written to it.
    let options = CallOptions::new().in_doubt(true).read_back(100);
    let error = rig.call(unit(1).into(), &Request::write(100, 5), options, &mut || false, &mut |_| ()).unwrap_err();
    assert_eq!(error.failure, Failure::NotTaken { times: 1, shows: vec![100] });
}

#[test]
fn nothing_is_written_over_another_connection_than_the_caller_knows() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    let write = Request::write(100, 5);
    let known = CallOptions::new().connection(rig.bus.stats().reconnects);
    let call = |options| rig.call(unit(1).into(), &write, options, &mut || false, &mut |_| ());
    call(known).unwrap();
    rig.wire.lock().unwrap().vanish_after_sending = true;
    rig.read(7, 1).unwrap_err();
    let error = call(known).unwrap_err();
    assert_eq!((error.failure, error.sent, rig.sent(&write)), (Failure::Reopened, None, 1));
    call(known.connection(1)).unwrap();
}
