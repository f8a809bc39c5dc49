use drivebus_rtu::{ExceptionCode, Meaning};

use super::*;
use crate::scripted::{Fault, Script, UNIT, fails, zeros_but};

fn of(name: &str) -> Arc<Speeds> {
    Arc::new(Speeds::new(&Profile::builtin(name).unwrap(), false))
}

/// What the operation comes to where the unit has these words, and nothing but zeros elsewhere.
fn done<T, F>(operation: impl FnOnce(Mailbox<Fault>) -> F, words: &[(u16, u16)]) -> T
where
    F: Future<Output = T> + Send + 'static,
{
    Script::new().carry_out(zeros_but(words), operation)
}

/// GD350 operation manual, section 9.4.5: 3000H is the running frequency, 3001H the setpoint, both in hundredths.
#[test]
fn the_frequencies_of_a_gd350() {
    let speeds = of("gd350");
    let told = done(async move |line| speeds.frequencies(&line, UNIT, true).await, &[(0x3000, 1234), (0x3001, 5000)]);
    let frequencies = told.unwrap();
    assert_eq!(frequencies, Some(Frequencies { output: 12.34, setpoint: Some(50.0) }));
}

/// P00.03 is the highest frequency, P00.12 the time of the ramp in tenths of seconds; P00.01 = 2 and P00.02 = 0 give the
/// commands, and P00.06 = 8 the speed to Modbus. GD350 operation manual, chapter 6.
#[test]
fn the_ramp_of_a_gd350() {
    let ramp = |words: &[(u16, u16)]| {
        let speeds = of("gd350");
        done(async move |line| speeds.ramp(&line, UNIT, true).await, words).unwrap()
    };
    let by_bus = [(0x0001, 2), (0x0002, 0), (0x0006, 8), (0x0003, 5000), (0x000C, 100)];
    assert_eq!(ramp(&by_bus), Ramp { slope: Some(5.0), only_by_bus: true });
    let [_, others @ ..] = by_bus;
    assert_eq!(ramp(&others), Ramp { slope: Some(5.0), only_by_bus: false });
    assert_eq!(ramp(&by_bus[..4]), Ramp { slope: None, only_by_bus: true });
}

#[test]
fn a_drive_that_does_not_say_its_ramp_has_none_that_is_known() {
    let ends = |cause| {
        let speeds = of("gd350");
        let mut script = Script::new();
        let ramp = script.carry_out(|_| fails(cause), async move |line| speeds.ramp(&line, UNIT, true).await);
        assert_eq!(script.asked.len(), 1);
        ramp
    };
    for cause in [Cause::NoAnswer, Cause::BadAnswer, Cause::Refused(ExceptionCode(2), Meaning::NoSuch)] {
        assert_eq!(ends(cause), Ok(Ramp::default()), "{cause:?}");
    }
    for cause in [Cause::Port, Cause::Other] {
        assert_eq!(ends(cause).unwrap_err().cause, cause);
    }
}

/// The state words of an ACS355 and an Altivar 312 may say that the motor rests while it is on its ramp.
#[test]
fn where_the_state_says_rest_on_the_ramp_the_frequency_decides() {
    let turns = |name: &str, state, words: &[(u16, u16)]| {
        let speeds = of(name);
        done(async move |line| speeds.turns_in_spite_of(state, &line, UNIT, true).await, words).unwrap()
    };
    let place = Profile::builtin("atv312").unwrap().role("frequency").and_then(Entry::address).unwrap();
    assert!(turns("atv312", State::Stopped, &[(place, 100)]));
    assert!(!turns("atv312", State::Stopped, &[(place, 0)]));
    assert!(!turns("atv312", State::Forward, &[(place, 100)]));
    assert!(!turns("gd350", State::Stopped, &[(0x3000, 100)]));
}

#[test]
fn every_family_can_be_asked() {
    for name in Profile::builtin_names() {
        let (first, second) = (of(name), of(name));
        let frequencies = done(async move |line| first.frequencies(&line, UNIT, false).await, &[]);
        let ramp = done(async move |line| second.ramp(&line, UNIT, false).await, &[]);
        assert!(frequencies.unwrap().is_none_or(|it| it.output.abs() < f64::EPSILON), "{name}");
        assert_eq!(ramp.unwrap().slope, None, "{name}");
    }
}
