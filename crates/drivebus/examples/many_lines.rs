//! Watches several lines at once, each in a thread of its own, and stops what should not run. One line is dead.
//!
//! ```text
//! cargo run --example many_lines                                a few simulated lines
//! cargo run --example many_lines -- /dev/ttyUSB0 /dev/ttyUSB1   real ones, units 1 and 2. MOTORS THAT RUN ARE STOPPED.
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::thread;

use drivebus::drives::{Command, State};
use drivebus::{Bus, CallOptions, Error, Profile};

/// Where a Goodrive350 says what its motor does.
const STATE_WORD: u16 = 0x2100;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut ports: Vec<String> = std::env::args().skip(1).collect();
    if ports.is_empty() {
        ports = ["sim://1=gd350,2=gd350?clock=virtual", "sim://1=gd350?clock=virtual", "/dev/is-not-here"]
            .map(str::to_owned)
            .to_vec();
    }
    let gd350 = Profile::builtin("gd350")?;
    thread::scope(|scope| {
        for port in &ports {
            let gd350 = &gd350;
            scope.spawn(move || match Bus::open(port) {
                Ok(bus) => {
                    for unit in [1, 2] {
                        match settle(&bus, unit, gd350) {
                            Ok(state) => println!("{port}, unit {unit}: {state:?}"),
                            Err(error) => println!("{port}, unit {unit}: {error}"),
                        }
                    }
                }
                Err(error) => println!("{error}"),
            });
        }
    });
    Ok(())
}

/// Stops the motor of `unit` if it runs, before anything else that waits for the line, and tells its state.
fn settle(bus: &Bus, unit: u8, profile: &Profile) -> Result<State, Error> {
    let sure = CallOptions::new().urgent().verify();
    let words = bus.read_with(unit, STATE_WORD, 1, sure)?;
    let state = words.first().map_or(State::Unknown, |&word| profile.state(word));
    if matches!(state, State::Forward | State::Reverse)
        && let Some((address, stop)) = profile.command(Command::Stop)
    {
        bus.write_with(unit, address, stop, CallOptions::new().urgent())?;
    }
    Ok(state)
}
