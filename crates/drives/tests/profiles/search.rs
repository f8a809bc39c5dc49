//! Search: what a technician types, and what has to be among the first three rows that it finds.

use std::error::Error;

use drivebus_drives::Profile;

type Outcome = Result<(), Box<dyn Error>>;

/// What is typed, and what it has to find: registers by name, parameters by code.
type Case = (&'static str, &'static [&'static str]);

const GD350: &[Case] = &[
    // What it is called.
    ("output_current", &["output_current"]),
    ("baudrate", &["P14.01"]),
    ("bus voltage", &["bus_voltage"]),
    ("address", &["P14.00"]),
    ("password", &["P07.00"]),
    // What the field calls it.
    ("ramp", &["P00.11", "P00.12"]),
    ("ramps", &["P00.11", "P00.12"]),
    ("ramp-up time", &["P00.11"]),
    ("ramp down", &["P00.12"]),
    ("speed", &["rotation_speed", "running_frequency"]),
    ("max speed", &["P00.03"]),
    ("current limit", &["motoring_torque_limit", "braking_torque_limit"]),
    ("reset", &["control_command"]),
    ("brake", &["braking_torque_limit", "P01.08"]),
    ("direction", &["control_command", "status_word_1"]),
    ("dc link", &["bus_voltage"]),
    ("overload", &["output_current", "output_torque", "status_word_2"]),
    ("amps", &["output_current"]),
    ("baud", &["P14.01"]),
    ("bit rate", &["P14.01"]),
    ("parity", &["P14.02"]),
    ("slave id", &["P14.00"]),
    ("time out", &["P14.04"]),
    ("watchdog", &["P14.04", "P14.05"]),
    ("trip", &["fault_code"]),
    ("inching", &["P08.06"]),
    ("remote", &["P00.01"]),
    ("autotune", &["P00.15"]),
    ("switching frequency", &["P00.14"]),
    ("preset speeds", &["multistep_index"]),
    // As it comes off the keyboard.
    ("p0.11", &["P00.11"]),
    ("P00-11", &["P00.11"]),
    ("p00,11", &["P00.11"]),
    ("P0011", &["P00.11"]),
    ("2103h", &["identification_code"]),
    ("0x2103", &["identification_code"]),
    ("2103", &["identification_code"]),
    ("acelleration", &["P00.11"]),
    ("output curent", &["output_current"]),
    ("output_curent", &["output_current"]),
    ("Accelaration Time", &["P00.11"]),
    ("bitrat", &["P14.01"]),
];

const VFD500: &[Case] = &[
    ("speed", &["speed_reference"]),
    ("setpoint", &["speed_reference"]),
    ("max speed", &["P01.06", "upper_frequency_limit"]),
    ("minimum speed", &["P01.14"]),
    ("current limit", &["motoring_torque_limit", "braking_torque_limit"]),
    ("reset", &["control_command"]),
    ("brake", &["braking_torque_limit"]),
    ("direction", &["P00.08", "r27.02"]),
    ("bus voltage", &["r27.03"]),
    ("dc link", &["r27.03"]),
    ("baud", &["P30.02"]),
    ("address", &["P30.01"]),
    ("station", &["P30.01"]),
    ("error", &["r25.00"]),
    ("kwh", &["r16.00"]),
    ("relay", &["P07.01"]),
    ("r25-0", &["r25.00"]),
    ("P25.00", &["r25.00"]),
    ("p30.2", &["P30.02"]),
    ("7000H", &["control_command"]),
    ("torqe", &["torque_setting"]),
    ("speeed", &["speed_reference"]),
];

fn found(profile: &Profile, text: &str, limit: usize) -> Vec<String> {
    let called = |entry: &drivebus_drives::Entry| entry.code().unwrap_or(entry.name()).to_owned();
    profile.search(text, limit).into_iter().map(called).collect()
}

#[test]
fn what_a_technician_types_finds_it() -> Outcome {
    for (family, cases) in [("gd350", GD350), ("vfd500", VFD500)] {
        let profile = Profile::builtin(family)?;
        for (text, wanted) in cases {
            let found = found(&profile, text, 3);
            for name in *wanted {
                assert!(found.iter().any(|found| found == name), "{family}, {text:?}: {found:?}");
            }
        }
    }
    Ok(())
}

#[test]
fn what_is_called_so_comes_before_what_means_the_same() -> Outcome {
    let gd350 = Profile::builtin("gd350")?;
    assert_eq!(found(&gd350, "speed", 2), ["rotation_speed", "multistep_index"]);
    assert_eq!(found(&gd350, "jog_frequency", 1), ["P08.06"]);
    // P08.07 and P08.08 are ramps too.
    assert_eq!(found(&gd350, "jog ramp", 9), ["P08.07", "P08.08"]);
    Ok(())
}

#[test]
fn what_is_not_there_stands_for_nothing_else() -> Outcome {
    let vfd500 = Profile::builtin("vfd500")?;
    for text in ["P00.11", "P00-11", "2103", "frobnicate", "", " - ", "päö", "nameplate", "P99.99"] {
        assert_eq!(found(&vfd500, text, 9), [""; 0], "{text}");
    }
    assert_eq!(found(&vfd500, "speed", 0), [""; 0]);
    // 2002H is a register, and P32.02 none.
    assert_eq!(found(&*Profile::builtin("gd350")?, "P32-02", 9), [""; 0]);
    Ok(())
}

#[test]
fn a_name_that_is_none_names_what_was_meant() -> Outcome {
    let gd350 = Profile::builtin("gd350")?;
    for (name, meant) in
        [("output_curent", "\"output_current\""), ("ramp", "\"acceleration_time_1\""), ("baud", "\"baud_rate\"")]
    {
        let error = gd350.find(name).err().map(|error| error.to_string()).unwrap_or_default();
        let first = error.split("the closest ").nth(1).and_then(|names| names.split(", ").next()).unwrap_or_default();
        assert!(first.ends_with(meant), "{name}: {error}");
    }
    Ok(())
}
