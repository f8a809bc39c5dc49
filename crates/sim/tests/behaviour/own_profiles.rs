//! Profiles of somebody's own: a drive that is known by its profile alone does what that says.
//!
//! The drive of `tests/profiles/acme` does not exist. Frames and values are computed by hand from what its files say.

use std::path::{Path, PathBuf};
use std::time::Duration;

use drivebus_drives::Profile;
use drivebus_rtu::SerialFormat;
use drivebus_sim::{Model, Options, SimError, Simulator};

use crate::bench::{Bench, pdu, write_many_pdu};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/profiles").join(name)
}

fn profile(name: &str) -> Profile {
    Profile::load(&folder(name)).unwrap()
}

fn acme() -> Bench {
    let profile = profile("acme");
    let simulator = Simulator::new([(1, &profile)], Options::default()).unwrap();
    Bench { line: simulator.line(), simulator }
}

/// Set to obey the bus, with its speed in tenths of a hertz from there.
fn obedient() -> Bench {
    let mut bench = acme();
    for (address, value) in [(0x0001, 4), (0x0004, 1), (0x0005, 1)] {
        bench.write(address, value);
    }
    bench
}

fn word(bench: &mut Bench, address: u16) -> u16 {
    let [word] = bench.read(address);
    word
}

fn pass(bench: &Bench, seconds: f64) {
    bench.simulator.advance(Duration::from_secs_f64(seconds)).unwrap();
}

#[test]
fn its_commands_states_and_ramps_are_those_of_the_profile() {
    let mut bench = obedient();
    assert_eq!((bench.drive().profile(), bench.simulator.name()), (String::from("acme"), "sim:1=acme"));
    assert_eq!(word(&mut bench, 0xA000), 0x0301, "ready, from the bus, stopped");

    bench.write_many(0x9010, &[300]); // 30.0 Hz
    bench.write(0x9000, 0x12); // forward
    let begin = bench.taken();
    // 2.0 s to 100 Hz: 30 Hz in 0.6 s
    bench.go_to(begin, 0.3);
    assert!((bench.drive().frequency() - 15.0).abs() < 1e-6, "{}", bench.drive().frequency());
    bench.go_to(begin, 0.7);
    assert_eq!((word(&mut bench, 0xA000), word(&mut bench, 0xA004), word(&mut bench, 0xA005)), (0x0305, 300, 300));

    bench.write(0x9000, 0x22); // reverse
    // 4.00 s from 100 Hz to 0, and 0.6 s up again
    pass(&bench, 2.0);
    assert_eq!((word(&mut bench, 0xA000), word(&mut bench, 0xA004)), (0x030D, (-300_i16).cast_unsigned()));

    bench.write(0x9000, 0x01); // along the ramp: 1.2 s
    pass(&bench, 1.1);
    assert_eq!(word(&mut bench, 0xA000), 0x030D);
    pass(&bench, 0.2);
    assert_eq!((word(&mut bench, 0xA000), word(&mut bench, 0xA004)), (0x0301, 0));

    bench.write(0x9000, 0x12);
    pass(&bench, 1.0);
    bench.write(0x9000, 0x00); // coasts: no frequency at once
    assert_eq!((word(&mut bench, 0xA000), word(&mut bench, 0xA004)), (0x0301, 0));
    bench.write(0x9000, 0x40); // beeps
    assert_eq!(bench.drive().state(), "stopped");
}

#[test]
fn it_obeys_the_bus_only_where_its_control_says_so() {
    let mut bench = acme();
    bench.write(0x9000, 0x12);
    assert_eq!((bench.drive().state(), word(&mut bench, 0xA000)), ("stopped", 0x0101));
    bench.write(0x0001, 4);
    bench.write(0x9000, 0x12);
    pass(&bench, 10.0);
    assert_eq!(word(&mut bench, 0xA005), 500, "not from the bus: from its keypad");
}

#[test]
fn a_variant_decides_what_its_speed_counts() {
    let mut bench = obedient();
    bench.write(0x0005, 0); // percent of 100 Hz
    bench.write(0x9010, (-205_i16).cast_unsigned());
    bench.refuses_write(0x9010, 1_001, 0x03);
    bench.write(0x9000, 0x12);
    pass(&bench, 10.0);
    assert_eq!(word(&mut bench, 0xA004), (-205_i16).cast_unsigned());
    bench.write(0x9000, 0x00);
    bench.write(0x0005, 1);
    bench.write(0x9010, 1_001);
    bench.refuses_write(0x9010, 4_001, 0x03);
}

#[test]
fn its_words_have_the_access_range_and_memory_of_their_rows() {
    let mut bench = obedient();
    for (request, code) in [
        (pdu(0x08, &[0x0000, 1]), 0x01), // a function that it does not take
        (pdu(0x03, &[0x9000, 1]), 0x02), // to be written only
        (pdu(0x03, &[0xA00A, 1]), 0x02), // nothing there
        (pdu(0x03, &[0x4001, 1]), 0x02), // the bit is for writes
        (pdu(0x06, &[0xA000, 1]), 0x02), // to be read only
        (pdu(0x06, &[0x9000, 2]), 0x03), // no such command
        (pdu(0x06, &[0x9020, 501]), 0x03),
        (pdu(0x06, &[0x0008, 0]), 0x03),
        (pdu(0x03, &[0xA000, 21]), 0x03),
        (write_many_pdu(0x0001, &[0; 21]), 0x03),
    ] {
        assert_eq!(bench.ask(1, &request), Some(vec![request[0] | 0x80, code]), "{request:02X?}");
    }
    bench.write(0x9020, (-500_i16).cast_unsigned());
    assert_eq!((word(&mut bench, 0x9020), word(&mut bench, 0xA008), word(&mut bench, 0xA009)), (0xFE0C, 0x7007, 0));

    // Plain addresses are RAM, 4000H is EEPROM.
    bench.write(0x0002, 500);
    bench.write(0x4008, 70);
    assert_eq!((bench.drive().eeprom_writes(), bench.drive().eeprom_writes_of(0x4008)), (1, 1));
    bench.drive().power_cycle();
    assert_eq!((word(&mut bench, 0x0002), word(&mut bench, 0x0008), word(&mut bench, 0x9020)), (400, 70, 0));

    bench.write(0x0001, 4);
    bench.write(0x9000, 0x12);
    bench.refuses_write(0x0001, 0, 0x04); // not while it runs
}

#[test]
fn a_read_stays_in_its_group_where_the_family_says_so() {
    let mut bench = acme();
    assert_eq!((word(&mut bench, 0x00FF), word(&mut bench, 0x0100)), (1, 2));
    assert_eq!(bench.ask(1, &pdu(0x03, &[0x00FF, 2])), Some(vec![0x83, 0x02]));
    assert_eq!(bench.ask(1, &pdu(0x03, &[0xA000, 10])).unwrap().len(), 22);
}

#[test]
fn it_trips_shows_and_remembers_faults() {
    let mut bench = obedient();
    bench.write(0x9000, 0x12);
    bench.drive().trip(22).unwrap();
    assert_eq!([0xA000, 0xA001, 0xA002, 0xA003].map(|address| word(&mut bench, address)), [0x0380, 22, 22, 0]);
    bench.write(0x9000, 0x80);
    assert_eq!([0xA000, 0xA001, 0xA002].map(|address| word(&mut bench, address)), [0x0301, 0, 22]);

    // An overload trips with the fault that is called OL1.
    bench.drive().set_load(2.0).unwrap();
    bench.write(0x9010, 500);
    bench.write(0x9000, 0x12);
    pass(&bench, 60.0);
    assert_eq!([0xA001, 0xA002, 0xA003].map(|address| word(&mut bench, address)), [21, 21, 22]);
}

#[test]
fn a_silent_bus_coasts_or_stops_it_as_its_watchdog_says() {
    for (action, state, hertz) in [(0, "forward", 30.0), (1, "forward", 5.0), (2, "stopped", 0.0)] {
        let mut bench = obedient();
        bench.write(0x9010, 300);
        bench.write(0x9000, 0x12);
        pass(&bench, 5.0);
        bench.write(0x0007, action);
        bench.write(0x0006, 20); // 2.0 s
        let heard = bench.taken();
        bench.go_to(heard, 3.0);
        let drive = bench.drive();
        assert_eq!((drive.state(), drive.fault()), (state, 0), "{action}");
        // One second of the four in which it falls by 100 Hz.
        assert!((drive.frequency() - hertz).abs() < 1e-6, "{action}: {}", drive.frequency());
    }
}

#[test]
fn it_answers_when_its_profile_says() {
    let mut bench = acme();
    word(&mut bench, 0xA008);
    let trace = bench.simulator.wire().trace();
    let [request, answer] = &trace[trace.len() - 2..] else { panic!("{trace:?}") };
    let format = SerialFormat::DEFAULT;
    let until = format.chars(8) + format.t35() + Duration::from_millis(12);
    assert_eq!(answer.begin.saturating_duration_since(request.begin), until);
}

#[test]
fn what_a_simulation_lacks_is_named_with_its_place() {
    let bare = profile("bare");
    let error = Simulator::new([(1, &bare)], Options::default()).unwrap_err();
    assert!(matches!(error, SimError::Lacking { .. }), "{error:?}");
    assert_eq!(
        error.to_string(),
        "profile \"bare\" cannot be simulated; it lacks\n  \
         profile.toml, [commands]: no register that takes commands, or registers.csv has no address for it\n  \
         profile.toml, [commands.codes]: neither run_forward nor run_reverse\n  \
         profile.toml, [commands.codes]: neither stop nor coast\n  \
         profile.toml, [state]: no register that tells the state, or registers.csv has no address for it\n  \
         profile.toml, [setpoints.frequency]: no register that sets the frequency, or registers.csv has no address for it"
    );
}

#[test]
fn a_shipped_profile_is_taken_for_its_family_and_goes_with_others_on_one_line() {
    let (acme, gd350) = (profile("acme"), Profile::builtin("gd350").unwrap());
    let units =
        [(1, Model::from(&acme)), (2, Model::from("vfd500")), (3, Model::from(&*gd350)), (4, Model::from(&acme))];
    let simulator = Simulator::new(units, Options::default()).unwrap();
    assert_eq!(simulator.name(), "sim:1=acme,2=vfd500,3=gd350,4=acme");
    // P14.04 is known by its manuals alone.
    assert_eq!(simulator.drive(3).unwrap().register(0x2101), Ok(0x0C01));
    assert_eq!(simulator.drive(4).unwrap().register(0xA000), Ok(0x0101));
}

/// 16384 counts are what S-3 says, 60 Hz; S-3 and the current have their high word first; 0008H goes both ways.
#[test]
fn it_counts_shares_of_a_range_and_takes_commands_where_it_tells_its_state() {
    let profile = profile("share");
    let simulator = Simulator::new([(1, &profile)], Options::default()).unwrap();
    let mut bench = Bench { line: simulator.line(), simulator };
    assert_eq!(bench.read(0x0103), [0, 60_000]);
    bench.write(0x0101, 1);
    bench.write(0x0009, 8_192); // half of 60 Hz
    bench.refuses_write(0x0009, 16_385, 0x03);
    bench.refuses_write(0x0008, 3, 0x03);
    assert_eq!(word(&mut bench, 0x0008), 0);
    bench.write(0x0008, 2);
    pass(&bench, 5.0);
    // A state, and not the command.
    assert_eq!((word(&mut bench, 0x0008), word(&mut bench, 0x0010)), (1, 300));
    let [high, low] = bench.read(0x0011);
    assert!(high == 0 && low > 0, "{high} {low}");
    let [low, high] = bench.read(0x0013);
    assert!(high == 0 && low > 0, "{low} {high}");
    bench.write(0x0008, 4);
    pass(&bench, 10.0);
    assert_eq!(word(&mut bench, 0x0008), 3);
    bench.write(0x0008, 0);
    pass(&bench, 5.0);
    assert_eq!((word(&mut bench, 0x0008), word(&mut bench, 0x0010)), (2 & 1, 0));
    bench.write(0x0106, (-16_384_i16).cast_unsigned());
    bench.refuses_write(0x0106, (-16_385_i16).cast_unsigned(), 0x03);
}
