//! The motor: commands, ramps, jog, coast, load, overload, faults.
//!
//! From the factory P00.03 is 50.00 Hz and the ramps take 10.0 s for it, so frequencies change by 5 Hz/s.

use drivebus_line::Line;

use crate::bench::{Bench, framed, pdu};

#[track_caller]
fn assert_near(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
}

#[test]
fn ten_hertz_takes_two_seconds() {
    let mut bench = Bench::obedient();
    let begin = bench.run(1_000);
    for (seconds, hz) in [(1.0, 5.0), (1.9, 9.5), (2.0, 10.0), (9.0, 10.0)] {
        bench.go_to(begin, seconds);
        assert_near(bench.drive().frequency(), hz);
    }
    assert_eq!(bench.read::<2>(0x3000), [1_000, 1_000]);
    assert_eq!(bench.read::<1>(0x2100), [1]);

    bench.write(0x2000, 5);
    let begin = bench.taken();
    bench.go_to(begin, 1.0);
    assert_near(bench.drive().frequency(), 5.0);
    assert_eq!(bench.drive().state(), "forward", "still turning");
    bench.go_to(begin, 2.0);
    assert_eq!(bench.drive().state(), "stopped");
    assert_eq!(bench.read::<1>(0x2100), [3]);
}

#[test]
fn ramps_follow_their_parameters_while_they_run() {
    let mut bench = Bench::obedient();
    bench.write_many(0x000B, &[50, 20]); // 10 Hz/s up, 25 Hz/s down
    let begin = bench.run(3_000);
    bench.go_to(begin, 1.0);
    assert_near(bench.drive().frequency(), 10.0);
    bench.write(0x800B, 100); // from here on 5 Hz/s
    let changed = bench.taken();
    let already = bench.drive().frequency();
    let since = changed.saturating_duration_since(begin).as_secs_f64();
    assert!(already > 10.0 * since, "the answer took its time too");
    bench.go_to(changed, 1.0);
    assert_near(bench.drive().frequency(), 10.0 * since + 5.0);
    bench.write(0x2001, 0);
    let begin = bench.taken();
    bench.go_to(begin, 2.0);
    assert_near(bench.drive().frequency(), 0.0);
    assert_eq!(bench.drive().state(), "forward", "0 Hz is a setpoint like any other");
}

#[test]
fn a_ramp_of_no_time_is_there_at_once() {
    let mut bench = Bench::obedient();
    bench.write(0x000B, 0);
    let begin = bench.run(4_200);
    bench.go_to(begin, 1.0);
    assert_near(bench.drive().frequency(), 42.0);
}

#[test]
fn reverse_passes_through_standstill() {
    let mut bench = Bench::obedient();
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    bench.write(0x2000, 2);
    let begin = bench.taken();
    for (seconds, hz, state) in [(1.0, 5.0, "forward"), (3.0, -5.0, "reverse"), (4.0, -10.0, "reverse")] {
        bench.go_to(begin, seconds);
        assert_near(bench.drive().frequency(), hz);
        assert_eq!(bench.drive().state(), state);
    }
    assert_eq!(bench.read::<1>(0x3000), [1_000], "the register has no sign");
    assert_eq!(bench.read::<1>(0x2100), [2]);
    assert!(bench.drive().speed() < 0.0);
}

#[test]
fn commands_act_only_under_bus_control() {
    for (channel, bus, moves) in [(0, 0, false), (1, 0, false), (2, 1, false), (2, 0, true)] {
        let mut bench = Bench::new();
        bench.write_many(0x0001, &[channel, bus]);
        bench.write(0x0006, 8);
        let begin = bench.run(1_000);
        bench.go_to(begin, 5.0);
        assert_near(bench.drive().frequency(), if moves { 10.0 } else { 0.0 });
        assert_eq!(bench.read::<1>(0x2000), [1], "taken as a word either way");
        assert_eq!(bench.read::<1>(0x2101)[0] >> 5 & 0b11, channel, "the channel shows in state word 2");
    }
}

#[test]
fn the_setpoint_comes_from_where_it_is_set_to_come_from() {
    let mut bench = Bench::obedient();
    bench.write(0x0006, 0);
    bench.write(0x000A, 2_000);
    let begin = bench.run(1_000);
    bench.go_to(begin, 10.0);
    assert_eq!(bench.read::<2>(0x3000), [2_000, 2_000], "P00.10, not 2001H");
    bench.write(0x0006, 8);
    let begin = bench.taken();
    bench.go_to(begin, 10.0);
    assert_eq!(bench.read::<2>(0x3000), [1_000, 1_000]);
    bench.write(0x0004, 800);
    let begin = bench.taken();
    bench.go_to(begin, 10.0);
    assert_eq!(bench.read::<2>(0x3000), [800, 800], "P00.04 limits it");
}

#[test]
fn a_jog_has_its_own_frequency_and_ends_with_its_own_command() {
    let mut bench = Bench::obedient();
    bench.write(0x2000, 4);
    let begin = bench.taken();
    bench.go_to(begin, 0.5);
    assert_near(bench.drive().frequency(), -2.5);
    bench.go_to(begin, 1.0);
    assert_near(bench.drive().frequency(), -5.0);
    bench.write(0x2000, 1);
    bench.go_to(begin, 2.0);
    assert_near(bench.drive().frequency(), -5.0);
    bench.write(0x2000, 8);
    let begin = bench.taken();
    bench.go_to(begin, 1.0);
    assert_eq!((bench.drive().state(), bench.read::<1>(0x3000)), ("stopped", [0]));

    let begin = bench.run(1_000);
    bench.go_to(begin, 2.0);
    bench.write(0x2000, 8);
    bench.write(0x2000, 3);
    bench.go_to(begin, 3.0);
    assert_near(bench.drive().frequency(), 10.0);
}

#[test]
fn coasting_takes_the_output_away_at_once_and_the_speed_slowly() {
    let mut bench = Bench::obedient();
    bench.drive().set_load(0.5).unwrap();
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    // 300 rpm less half the slip of 60 rpm.
    assert_near(bench.drive().speed(), 270.0);
    bench.write(0x2000, 6);
    let begin = bench.taken();
    assert_eq!(bench.read::<5>(0x3000), [0, 1_000, 5_370, 0, 0], "no frequency, voltage, current");
    assert_eq!(bench.drive().state(), "stopped");
    // Half of rated torque on an inertia of 2 s: 0.25 × 1440 rpm every second.
    bench.go_to(begin, 0.5);
    assert_near(bench.drive().speed(), 90.0);
    bench.go_to(begin, 0.75);
    assert_near(bench.drive().speed(), 0.0);
}

#[test]
fn a_run_command_catches_a_shaft_that_still_turns() {
    let mut bench = Bench::obedient();
    bench.drive().set_load(0.0).unwrap();
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    bench.write(0x2000, 6);
    bench.write(0x2000, 1);
    let caught = bench.drive().frequency();
    assert!(caught > 9.0 && caught <= 10.0, "{caught} Hz");
}

#[test]
fn stopping_can_be_set_to_coast() {
    let mut bench = Bench::obedient();
    bench.write(0x0108, 1);
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    bench.write(0x2000, 5);
    assert_eq!(bench.drive().state(), "stopped");
    assert!(bench.drive().speed() > 0.0);
}

#[test]
fn the_monitor_shows_the_motor_at_its_working_point() {
    let mut bench = Bench::obedient();
    assert_eq!(bench.read::<16>(0x3000), [0, 0, 5_370, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let begin = bench.run(1_000);
    // While it accelerates: load 0.3 + inertia 2 s × 5 Hz/s ÷ 50 Hz = 0.5.
    bench.go_to(begin, 1.0);
    assert_eq!(bench.drive().register(0x3007), Ok(500));

    bench.drive().set_load(1.0).unwrap();
    bench.drive().set_inputs(0b10_0001).unwrap();
    bench.drive().set_analog(1, 500).unwrap();
    bench.drive().set_analog(3, 0xFC18).unwrap();
    bench.go_to(begin, 4.0);
    // 10 Hz: 76 V; rated torque: 9.0 A; 300 rpm less 60 rpm of slip; 240/1440 of rated power; 537 V less 16 V × that.
    assert_eq!(bench.read::<8>(0x3000), [1_000, 1_000, 5_343, 76, 90, 240, 167, 1_000]);
    assert_eq!(bench.read::<6>(0x300A), [0b10_0001, 0b0100, 500, 0, 0xFC18, 0]);
    assert_eq!(bench.read::<1>(0x3016), [0x01A0]);

    // Stopping in 0.5 s instead of 10: 100 Hz/s, torque 1.0 - 4.0; power flows back and lifts the bus.
    bench.write(0x000C, 5);
    bench.write(0x2000, 5);
    let [_, _, bus, _, _, _, power, torque] = bench.read::<8>(0x3000);
    assert_eq!(torque.cast_signed(), -2_500, "the register ends at -250.0 %");
    assert!(power.cast_signed() < 0 && bus > 5_370, "{power} {bus}");
}

#[test]
fn special_words_are_kept_and_shown() {
    let mut bench = Bench::new();
    bench.write_many(0x2009, &[0b10, 0x3, 0b1001]);
    assert_eq!(bench.read::<3>(0x2009), [0b10, 0x3, 0b1001]);
    assert_eq!(bench.read::<1>(0x2101)[0] & 0b111, 0b101, "ready, motor 3");
    assert_eq!(bench.read::<2>(0x300A), [0x3, 0b1001]);
    bench.write(0x2004, 0xFFF6);
    assert_eq!(bench.read::<1>(0x3015), [0xFFF6], "the torque setpoint");
    bench.write_many(0x2002, &[500, 250]);
    assert_eq!(bench.read::<2>(0x3008), [0, 0]);
    bench.write(0x0900, 6);
    bench.write(0x0902, 4);
    assert_eq!(bench.read::<2>(0x3008), [500, 250], "the PID values once the bus gives them");
}

/// Current at 150 % load: (3.6² + 1.5² × (9² - 3.6²)) ÷ 9² = 2.05 of rated current squared. 2.05 - 1.1² = 0.84 a second
/// reach 5 in 5.952 s.
#[test]
fn an_overload_trips_after_its_time() {
    let mut bench = Bench::obedient();
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    let begin = bench.line.now();
    bench.drive().set_load(1.5).unwrap();
    bench.go_to(begin, 5.951);
    assert_eq!((bench.drive().fault(), bench.drive().state()), (0, "forward"));
    assert_eq!(bench.drive().register(0x2101).unwrap() >> 4 & 1, 1, "the pre-alarm");
    bench.go_to(begin, 5.953);
    assert_eq!((bench.drive().fault(), bench.drive().state()), (11, "fault"));
    assert_eq!(bench.read::<3>(0x2100), [4, 0x0C00 | 0b10 << 5 | 1 << 4, 11]);
    assert_eq!(bench.read::<1>(0x5000), [11]);
    assert_eq!(bench.read::<2>(0x071B), [11, 0]);
    assert_eq!(bench.read::<1>(0x3000), [0]);

    bench.run(1_000);
    assert_eq!(bench.drive().state(), "fault", "a run command does not clear a fault");
    bench.write(0x2000, 7);
    assert_eq!((bench.read::<1>(0x2100), bench.read::<1>(0x2102)), ([3], [0]));
    assert_eq!(bench.read::<1>(0x071B), [11], "the history remembers");
    bench.drive().set_load(0.3).unwrap();
    let begin = bench.run(1_000);
    bench.go_to(begin, 5.0);
    assert_near(bench.drive().frequency(), 10.0);
}

#[test]
fn looking_changes_nothing() {
    let trip_time = |look: bool| {
        let mut bench = Bench::obedient();
        bench.drive().set_load(1.4).unwrap();
        let begin = bench.run(5_000);
        let mut step = 0;
        loop {
            step += 1;
            bench.go_to(begin, f64::from(step) / 10.0);
            if look {
                let _ = (bench.drive().frequency(), bench.drive().register(0x3004));
            }
            if (look || step % 50 == 0) && bench.drive().fault() == 11 {
                break;
            }
        }
        bench.go_to(begin, 100.0);
        bench.drive().speed().to_bits()
    };
    assert_eq!(trip_time(true), trip_time(false));
}

#[test]
fn a_fault_is_reset_once_its_cause_is_gone() {
    let mut bench = Bench::obedient();
    let begin = bench.run(1_000);
    bench.go_to(begin, 3.0);
    bench.drive().hold_fault(17).unwrap();
    assert!(bench.drive().speed() > 0.0, "the motor coasts");
    bench.write(0x2000, 7);
    assert_eq!(bench.drive().fault(), 17);
    bench.drive().release_fault();
    assert_eq!(bench.drive().fault(), 17, "nobody has reset it yet");
    bench.write(0x2000, 7);
    assert_eq!((bench.drive().fault(), bench.drive().state()), (0, "stopped"));
    assert!(bench.drive().trip(0).is_err());
}

#[test]
fn a_silent_bus_trips_the_drive_that_watches_it() {
    for (action, state, fault) in [(0, "fault", 18), (1, "forward", 0), (2, "stopped", 0), (3, "stopped", 0)] {
        let mut bench = Bench::obedient();
        bench.write_many(0x0E04, &[10, action]); // 1.0 s
        bench.run(1_000);
        let last = bench.line.now();
        // Half a second later a frame for the neighbour changes nothing.
        bench.go_to(last, 0.5);
        bench.exchange(&framed(3, &pdu(0x03, &[0x2100, 1])));
        bench.go_to(last, 0.9);
        assert_eq!(bench.drive().state(), "forward");
        bench.go_to(last, 5.0);
        assert_eq!((bench.drive().state(), bench.drive().fault()), (state, fault), "action {action}");
    }
}

#[test]
fn settings_of_the_bench_are_checked() {
    let bench = Bench::new();
    for load in [-0.1, 4.1, f64::NAN] {
        assert!(bench.drive().set_load(load).is_err(), "{load}");
    }
    assert!(bench.drive().set_inputs(0x40).is_err());
    assert!(bench.drive().set_analog(0, 0).is_err());
    assert!(bench.drive().set_analog(5, 0).is_err());
}
