//! Refusals by which a unit decides nothing, acknowledgements, and confirmations of another value: what is asked again, what is
//! never sent twice, and what is said.
//!
//! Codes and what they mean: *Modbus Application Protocol* V1.1b3, §7.

use std::sync::{Arc, Mutex};

use drivebus_line::{CallError, CallOptions, ErrorKind, Failure};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Meaning, Meanings, Request};

use crate::scripted::{Pieces, Rig, after, at_once, millis, right, unit};

const BUSY: u8 = 0x06;
const ACKNOWLEDGE: u8 = 0x05;

/// The refusal of `request`.
fn refusal(request: &[u8], code: u8) -> Vec<u8> {
    Adu::answer(unit(request[0]), &Answer::exception(request[1], ExceptionCode(code))).as_bytes().to_vec()
}

/// A unit that answers its first requests by these exceptions, and then does as it is told.
fn refusing(codes: &[u8]) -> Rig {
    let codes = codes.to_vec();
    Rig::new(move |number, request| match codes.get(number) {
        Some(&code) => at_once(&refusal(request, code)),
        None => at_once(&right(request)),
    })
}

/// Register 100 of a unit, and what it took.
#[derive(Default)]
struct Register {
    word: u16,
    taken: Vec<u16>,
}

impl Register {
    fn take(&mut self, word: u16) {
        self.word = word;
        self.taken.push(word);
    }
}

/// A unit with one register. `write` says what it makes of the write with this number, and what it answers.
fn keeping(write: impl Fn(&mut Register, usize, &[u8]) -> Pieces + Send + 'static) -> (Rig, Arc<Mutex<Register>>) {
    let register = Arc::new(Mutex::new(Register::default()));
    let (inside, mut writes) = (Arc::clone(&register), 0);
    let rig = Rig::new(move |_, request| {
        let mut register = inside.lock().unwrap();
        if request[1] == 3 {
            let words = [register.word];
            return at_once(Adu::answer(unit(1), &Answer::read(&words).unwrap()).as_bytes());
        }
        if request[1] == 8 {
            return at_once(&right(request));
        }
        writes += 1;
        write(&mut register, writes, request)
    });
    (rig, register)
}

fn value_of(request: &[u8]) -> u16 {
    u16::from_be_bytes([request[4], request[5]])
}

fn read(rig: &Rig, retries: u32) -> Result<(), Box<CallError>> {
    let options = CallOptions::new().retries(retries);
    rig.call(unit(1).into(), &look_up(), options, &mut || false, &mut |_| ()).map(|_| ())
}

fn write(rig: &Rig, word: u16, read_back: impl Into<Option<u16>>) -> Result<(), Box<CallError>> {
    let options = CallOptions::new().read_back(read_back).retries(2);
    rig.call(unit(1).into(), &Request::write(100, word), options, &mut || false, &mut |_| ()).map(|_| ())
}

fn look_up() -> Request<'static> {
    Request::read(100, 1).unwrap()
}

fn refused(error: &CallError, by: u8) -> bool {
    matches!(error.failure, Failure::Refused { code, .. } if code.0 == by)
}

#[test]
fn a_read_that_is_refused_as_busy_is_asked_again_and_counts_half() {
    for (retries, most) in [(0, 1), (1, 3), (2, 5)] {
        let rig = refusing(&vec![BUSY; most - 1]);
        read(&rig, retries).unwrap();
        assert_eq!(rig.sent(&look_up()), most);

        let rig = refusing(&[BUSY; 20]);
        let error = read(&rig, retries).unwrap_err();
        assert!(refused(&error, BUSY) && !error.may_have_acted(), "{error}");
        assert_eq!(rig.sent(&look_up()), most);
    }
}

#[test]
fn a_decision_is_told_at_once() {
    for code in (1..=0x0B).filter(|&code| ExceptionCode(code).meaning() != Meaning::AskAgain) {
        let rig = refusing(&[code; 20]);
        assert!(refused(&read(&rig, 2).unwrap_err(), code));
        assert_eq!(rig.sent(&look_up()), 1, "{code:02X}H");
    }
}

/// An EDS300 says by 01H that the request came damaged, and by 06H that so many words may not be read.
#[test]
fn a_family_has_its_own_word_for_it() {
    let eds300 =
        Meanings::STANDARD.with(ExceptionCode(0x01), Meaning::AskAgain).with(ExceptionCode(0x06), Meaning::NoSuch);
    for (code, asked) in [(0x01, 5), (0x06, 1)] {
        let rig = refusing(&[code; 20]);
        rig.bus.set_meanings(unit(1), eds300);
        assert!(refused(&read(&rig, 2).unwrap_err(), code));
        assert_eq!(rig.sent(&look_up()), asked, "{code:02X}H");
    }
    let rig = refusing(&[BUSY; 4]);
    rig.bus.set_meanings(unit(2), eds300);
    read(&rig, 2).unwrap();
}

/// The words of a read that is verified have to come twice in a row; a refusal between them is no other answer.
#[test]
fn a_verified_read_goes_on_behind_a_refusal() {
    let rig = Rig::new(|number, request| match number {
        1 => at_once(&refusal(request, BUSY)),
        _ => at_once(&right(request)),
    });
    let mut words = Vec::new();
    let options = CallOptions::new().verify(true).retries(2);
    rig.call(unit(1).into(), &look_up(), options, &mut || false, &mut |answer| {
        if let Answer::Read { words: came, .. } = answer {
            words = came.iter().collect();
        }
    })
    .unwrap();
    assert_eq!((words, rig.sent(&look_up())), (vec![100], 3));
}

#[test]
fn a_value_that_is_refused_as_busy_is_written_again_once_the_unit_shows_another() {
    let (rig, register) = keeping(|register, number, request| {
        if number <= 4 {
            return at_once(&refusal(request, BUSY));
        }
        register.take(value_of(request));
        at_once(&right(request))
    });
    write(&rig, 5, 100).unwrap();
    assert_eq!(register.lock().unwrap().taken, [5]);
    assert_eq!((rig.sent(&Request::write(100, 5)), rig.sent(&look_up())), (5, 4));

    let (rig, register) = keeping(|_, _, request| at_once(&refusal(request, BUSY)));
    let error = write(&rig, 5, 100).unwrap_err();
    assert!(refused(&error, BUSY) && !error.may_have_acted(), "{error}");
    assert!(register.lock().unwrap().taken.is_empty());
    assert_eq!(rig.sent(&Request::write(100, 5)), 5);
}

#[test]
fn what_cannot_be_read_back_is_never_sent_again() {
    for code in 1..=0x0B {
        let (rig, _) = keeping(move |_, _, request| at_once(&refusal(request, code)));
        let error = write(&rig, 1, None).unwrap_err();
        // 0BH is a gateway's word for silence.
        assert_eq!(matches!(error.failure, Failure::Unreached), code == 0x0B, "{error}");
        assert_eq!((rig.sent(&Request::write(100, 1)), rig.sent(&look_up())), (1, 0), "{code:02X}H");
    }
}

#[test]
fn what_is_acknowledged_is_looked_up_and_never_sent_again() {
    // It is there with the third look.
    let looks = Arc::new(Mutex::new(0));
    let counted = Arc::clone(&looks);
    let rig = Rig::new(move |_, request| {
        if request[1] != 3 {
            return at_once(&refusal(request, ACKNOWLEDGE));
        }
        let mut looks = counted.lock().unwrap();
        *looks += 1;
        let words = [if *looks < 3 { 0 } else { 5 }];
        at_once(Adu::answer(unit(1), &Answer::read(&words).unwrap()).as_bytes())
    });
    write(&rig, 5, 100).unwrap();
    assert_eq!((*looks.lock().unwrap(), rig.sent(&Request::write(100, 5))), (3, 1));

    let (rig, _) = keeping(|_, _, request| at_once(&refusal(request, ACKNOWLEDGE)));
    let before = rig.now();
    let error = write(&rig, 5, 100).unwrap_err();
    assert_eq!(error.failure, Failure::Acknowledged { code: ExceptionCode(ACKNOWLEDGE), shows: vec![0] });
    assert_eq!((error.kind(), rig.sent(&Request::write(100, 5))), (ErrorKind::Unconfirmed, 1));
    assert!(error.may_have_acted());
    assert!((millis(1_000)..millis(2_000)).contains(&rig.since(before)), "the time of the call, and no longer");
}

#[test]
fn an_acknowledgement_that_cannot_be_looked_up_is_not_said_to_be_a_refusal_of_it() {
    let (rig, _) = keeping(|_, _, request| at_once(&refusal(request, ACKNOWLEDGE)));
    let error = write(&rig, 5, None).unwrap_err();
    assert!(refused(&error, ACKNOWLEDGE) && error.may_have_acted());
    assert!(error.to_string().contains("it took the request"), "{error}");
    // Where the family means something else, nothing is looked up: that is a decision.
    rig.bus.set_meanings(unit(1), Meanings::STANDARD.with(ExceptionCode(ACKNOWLEDGE), Meaning::NotNow));
    assert!(refused(&write(&rig, 5, 100).unwrap_err(), ACKNOWLEDGE));
    assert_eq!(rig.sent(&look_up()), 0);
}

/// A confirmation of `word` at register 100.
fn confirmed(word: u16) -> Vec<u8> {
    Adu::answer(unit(1), &Answer::confirming(&Request::write(100, word)).unwrap()).as_bytes().to_vec()
}

#[test]
fn a_value_that_the_unit_limits_is_written_once_and_told() {
    let (rig, register) = keeping(|register, _, _| {
        register.take(100);
        at_once(&confirmed(100))
    });
    let error = write(&rig, 200, 100).unwrap_err();
    assert_eq!(error.failure, Failure::Limited { took: 100, shows: 100 });
    assert_eq!(error.kind(), ErrorKind::Unconfirmed);
    assert_eq!(error.to_string(), "unit 1, write 200 (00C8H) to 0064H: the unit says that it took 100 (0064H) instead");
    assert_eq!(register.lock().unwrap().taken, [100]);
    assert_eq!((rig.sent(&Request::write(100, 200)), rig.sent(&look_up())), (1, 1));
}

/// What it shows decides, and whatever that is, a second write to EEPROM is none of it.
#[test]
fn what_a_unit_shows_counts_more_than_what_it_confirms() {
    let (rig, _) = keeping(|register, _, request| {
        register.take(value_of(request));
        at_once(&confirmed(100))
    });
    write(&rig, 200, 100).unwrap();

    let (rig, _) = keeping(|register, _, _| {
        register.take(7);
        at_once(&confirmed(100))
    });
    let error = write(&rig, 200, 100).unwrap_err();
    assert_eq!(error.failure, Failure::Limited { took: 100, shows: 7 });
    assert_eq!(rig.sent(&Request::write(100, 200)), 1);
}

/// The confirmation of an earlier write comes late, in the place of this one's: it states the older value, and is no limit.
#[test]
fn a_late_confirmation_of_an_earlier_value_is_no_limit() {
    let (rig, register) = keeping(|register, number, request| {
        register.take(value_of(request));
        match number {
            1 => after(millis(700), &right(request)),
            _ => after(millis(250), &right(request)),
        }
    });
    write(&rig, 100, None).unwrap_err();
    let in_doubt = CallOptions::new().in_doubt(true).read_back(100);
    rig.call(unit(1).into(), &Request::write(100, 200), in_doubt, &mut || false, &mut |_| ()).unwrap();
    assert_eq!(register.lock().unwrap().taken, [100, 200]);
}
