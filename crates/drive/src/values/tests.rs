use super::*;
use crate::record::Record;
use crate::scripted::{Fault, Keeper, Script, call, refuses, shipped};
use crate::task::Read;

fn read(
    name: &str,
    words: &[(u16, u16)],
    names: &'static [&'static str],
    is_trusted: bool,
) -> (Result<Values, NotRead<Fault>>, Script) {
    let family = shipped(name);
    let mut script = Script::new();
    let unit = call(&family, &Record::default(), is_trusted);
    let came =
        script.carry_out(Keeper::new(&family, words), |line| async move { unit.read_values(&line, names).await });
    (came, script)
}

fn shown(values: &Values) -> Vec<String> {
    values.values.iter().map(ToString::to_string).collect()
}

/// GD350 operation manual, section 9.4.5: 3000H counts hundredths of a hertz, 3004H tenths of an ampere.
#[test]
fn several_values_come_by_the_fewest_reads_in_the_order_of_their_names() {
    let words = [(0x3000, 4999), (0x3004, 57), (0x000B, 50)];
    let (values, script) = read("gd350", &words, &["output_current", "P00.11", "running_frequency"], false);
    let values = values.unwrap();
    assert_eq!(shown(&values), ["5.7", "5.0", "49.99"]);
    assert_eq!(script.asked.len(), 2);
    assert_eq!((values.asked.as_millis(), values.answered.as_millis()), (0, 2));
    assert_eq!(read("gd350", &[], &[], false).0.unwrap().values, []);
}

/// A1000 technical manual: o1-03, at 0502H, says in what the frequencies of the bus are counted; 0024H is that of the output.
#[test]
fn what_the_drive_decides_is_settled_first() {
    for (word, unit, value) in [(0, "Hz", "12.34"), (1, "%", "12.34"), (2, "rpm", "1234")] {
        let (values, script) = read("a1000", &[(0x0502, word), (0x0024, 1234)], &["running_frequency"], true);
        let values = values.unwrap();
        assert_eq!(shown(&values), [value]);
        assert_eq!(values.profile.find("running_frequency").unwrap().quantity().unit(), unit);
        assert_eq!(script.places(), [0x0502, 0x0024]);
    }
    let (values, _) = read("a1000", &[(0x0502, 9)], &["running_frequency"], true);
    assert!(matches!(values, Err(NotRead::NotSettled(_))));
}

#[test]
fn what_may_not_be_read_is_not_asked_for() {
    let (values, script) = read("vfd500", &[], &["r25.00", "running_frequency"], false);
    assert!(matches!(values, Err(NotRead::MayNot { ref name, .. }) if name == "running_frequency"));
    assert_eq!(script.asked, []);
    let (values, script) = read("gd350", &[], &["output_current", "no_such_name"], false);
    assert!(matches!(values, Err(NotRead::Unknown(_))));
    assert_eq!(script.asked, []);
}

#[test]
fn a_refusal_is_told() {
    let family = shipped("gd350");
    let unit = call(&family, &Record::default(), false);
    let refusing = |_: Read| refuses(0x06);
    let came = Script::new().carry_out(refusing, |line| async move { unit.read_values(&line, &["P00.11"]).await });
    assert!(matches!(came, Err(NotRead::Failed(_))));
}

/// Altivar 71 integrated Modbus (Schneider 1755863), p. 39: 8000H is where the drive has nothing. LCR counts 0.1 A and Otr 0.1 %
/// (AAV49428, pp. 96 and 97); ETA, of bits, is whatever it says.
#[test]
fn the_word_of_a_family_for_nothing_is_no_value() {
    let names = &["output_current", "output_torque"];
    let (values, _) = read("atv71", &[(3204, 57), (3205, 0x8001)], names, true);
    assert_eq!(shown(&values.unwrap()), ["5.7", "-3276.7"]);
    let (values, script) = read("atv71", &[(3204, 57), (3205, 0x8000)], names, true);
    let why = values.unwrap_err();
    assert_eq!(
        why.to_string(),
        "the drive has no output_torque: it answered 8000H, which says so; leave output_torque out"
    );
    assert_eq!(script.asked.len(), 1);
    let (values, _) = read("atv71", &[(3201, 0x8000)], &["status_word"], true);
    assert_eq!(shown(&values.unwrap()), ["32768"]);
    // A GD350 has no such word.
    assert_eq!(shown(&read("gd350", &[(0x3004, 0x8000)], &["output_current"], false).0.unwrap()), ["3276.8"]);
}
