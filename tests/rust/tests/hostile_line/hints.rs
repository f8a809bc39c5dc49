//! What the bus makes of a line with one fault: the hint that names it, and no other.

use drivebus_line::{CallOptions, Hint};
use drivebus_rtu::Request;

use crate::scripted::{Pieces, Rig, after, at_once, millis, right, unit};

/// Asks units 1 and 2 in turn, 100 times each, on a line that `script` spoils.
fn hints(script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static) -> Vec<Hint> {
    hints_of(&Rig::new(script))
}

fn hints_of(rig: &Rig) -> Vec<Hint> {
    for round in 0..200 {
        let request = Request::read(100 + round, 2).unwrap();
        let to = unit(if round % 2 == 0 { 1 } else { 2 }).into();
        let _ = rig.call(to, &request, CallOptions::default(), &mut || false, &mut |_| ());
    }
    rig.bus.stats().hints()
}

fn flipped(mut frame: Vec<u8>) -> Vec<u8> {
    frame[4] ^= 0x10;
    frame
}

#[test]
fn a_sound_line() {
    assert_eq!(hints(|_, request| at_once(&right(request))), []);
}

#[test]
fn a_line_without_bias() {
    let found = hints(|number, request| {
        let noise = [0x00, 0xFF][number % 2];
        at_once(&[&[noise], &right(request)[..]].concat())
    });
    assert!(matches!(found[..], [Hint::NoBias { noise, idle }] if noise == idle && noise >= 200), "{found:?}");
}

#[test]
fn interference() {
    let found = hints(|_, request| at_once(&[&[0x5A], &right(request)[..]].concat()));
    assert!(matches!(found[..], [Hint::Interference { noise }] if noise >= 200), "{found:?}");
}

#[test]
fn answers_that_are_damaged() {
    // Two words in ten from 100 on, an even one of unit 1 and an odd one of unit 2.
    let found = hints(|_, request| {
        let answer = right(request);
        at_once(&if request[1] == 3 && request[3] >= 100 && request[3] % 10 < 2 { flipped(answer) } else { answer })
    });
    assert!(matches!(found[..], [Hint::Damaged { unit: None, damaged, .. }] if damaged >= 20), "{found:?}");
}

#[test]
fn one_unit_that_is_connected_badly() {
    let found = hints(|number, request| {
        let answer = right(request);
        at_once(&if request[0] == 2 && number % 7 == 3 { flipped(answer) } else { answer })
    });
    let bad = Some(unit(2));
    assert!(matches!(found[..], [Hint::Damaged { unit, damaged, .. }] if unit == bad && damaged >= 3), "{found:?}");
}

#[test]
fn a_wrong_baud_rate() {
    let found = hints(|_, _| at_once(&[0xE3, 0x1C, 0x78, 0x9F, 0xF8, 0x63]));
    assert!(matches!(found[..], [Hint::WrongFormat { noise, .. }] if noise >= 200), "{found:?}");
}

#[test]
fn nobody_on_the_line() {
    let found = hints(|_, _| Vec::new());
    assert!(matches!(found[..], [Hint::NobodyAnswers { requests }] if requests >= 3), "{found:?}");
}

#[test]
fn an_adapter_that_echoes() {
    let rig =
        Rig::echoing(|_, request| vec![(millis(0), request.to_vec())], |_, request| after(millis(5), &right(request)));
    let found = hints_of(&rig);
    assert!(matches!(found[..], [Hint::AdapterEcho { echoes }] if echoes >= 200), "{found:?}");
}

#[test]
fn another_master() {
    let found = hints(|number, request| {
        let others = [&[9], &request[1..6]].concat();
        let others = [&others[..], &drivebus_rtu::crc16(&others).to_le_bytes()].concat();
        let others = if number % 10 == 0 { at_once(&right(&others)) } else { Vec::new() };
        [others, after(millis(20), &right(request))].concat()
    });
    assert!(matches!(found[..], [Hint::OtherMaster { frames }] if frames >= 15), "{found:?}");
}

#[test]
fn a_unit_that_needs_more_time() {
    // In the order it was asked: also an echo comes after what the unit still owes.
    let found = hints(|number, request| {
        let delay = match request {
            [2, 3, ..] if number % 9 == 0 => 520,
            [2, 8, ..] => 100,
            _ => 0,
        };
        after(millis(delay), &right(request))
    });
    let slow = unit(2);
    assert!(matches!(found[..], [Hint::TimeoutTooShort { unit, late, .. }] if unit == slow && late >= 2), "{found:?}");
}

#[test]
fn a_unit_that_is_not_there() {
    let found = hints(|_, request| if request[0] == 2 { Vec::new() } else { at_once(&right(request)) });
    let absent = unit(2);
    assert!(matches!(found[..], [Hint::SilentUnit { unit, .. }] if unit == absent), "{found:?}");
}
