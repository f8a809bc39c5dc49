use drivebus_drives::State;

use super::*;
use crate::record::Record;
use crate::scripted::{Fault, Keeper, Script, call, shipped};
use crate::task::Notice;

fn status(name: &str, words: &[(u16, u16)], is_trusted: bool) -> (Result<Status, NotRead<Fault>>, Script) {
    let family = shipped(name);
    let mut script = Script::new();
    let unit = call(&family, &Record::default(), is_trusted);
    let keeper = Keeper::new(&family, words);
    let came = script.carry_out(keeper, |line| async move { unit.status(&line).await });
    (came, script)
}

/// GD350 operation manual, section 9.4.5: 2100H is 1 where it turns forward; 3000H and 3001H count hundredths of a hertz.
#[test]
fn the_status_words_come_first_and_the_frequencies_in_one_read() {
    let (status, script) = status("gd350", &[(0x2100, 1), (0x3000, 999), (0x3001, 1200)], false);
    let status = status.unwrap();
    assert_eq!((status.look.state, status.frequency, status.setpoint), (State::Forward, Some(9.99), Some(12.0)));
    assert_eq!(status.asked, status.look.asked);
    assert_eq!(script.asked.last().map(|read| (read.place.number(), read.count)), Some((0x3000, 2)));
    assert_eq!(script.told, [Notice::Saw(status.look.clone())]);
    assert_eq!(status.to_string(), format!("{}, 9.99 of 12.00", status.look));
}

/// A1000 technical manual: o1-03, at 0502H, says in what the frequencies of the bus are counted.
#[test]
fn what_decides_the_meaning_of_a_frequency_is_settled_each_time() {
    let (at, script) = status("a1000", &[(0x0502, 0), (0x0024, 1234)], true);
    assert_eq!(at.unwrap().frequency, Some(12.34));
    assert_eq!(script.places().iter().filter(|&&place| place == 0x0502).count(), 1);
    let (at, _) = status("a1000", &[(0x0502, 9)], true);
    assert!(matches!(at, Err(NotRead::NotSettled(_))));
}

#[test]
fn what_may_not_be_read_is_left_out() {
    for is_trusted in [false, true] {
        let family = shipped("vfd500");
        let unit = call(&family, &Record::default(), is_trusted);
        let may = |role| family.profile().role(role).is_some_and(|entry| unit.rule().read(entry).is_ok());
        let (status, _) = status("vfd500", &[], is_trusted);
        let status = status.unwrap();
        assert_eq!((status.frequency.is_some(), status.setpoint.is_some()), (may("frequency"), may("setpoint")));
        assert_eq!(status.frequency.is_some(), is_trusted);
    }
}

/// Altivar 71 integrated Modbus (Schneider 1755863), p. 39. rFr is at 3202 and FrH at 3203 (AAV49428, p. 96).
#[test]
fn a_frequency_that_the_drive_has_not_is_left_out() {
    let (status, _) = status("atv71", &[(3201, 0x0027), (3202, 0x8000), (3203, 125)], true);
    let status = status.unwrap();
    assert_eq!((status.frequency, status.setpoint), (None, Some(12.5)));
}
