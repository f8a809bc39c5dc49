//! Watches several lines at once, each in a thread of its own, and stops what should not run. One line is dead.
//!
//! ```text
//! cargo run --example many_lines                                a few simulated lines
//! cargo run --example many_lines -- /dev/ttyUSB0 /dev/ttyUSB1   real ones, units 1 and 2. MOTORS THAT RUN ARE STOPPED.
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::sync::Arc;
use std::thread;

use drivebus::{Bus, Error, Profile, State};

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
fn settle(bus: &Bus, unit: u8, profile: &Arc<Profile>) -> Result<State, Error> {
    let drive = bus.drive(unit, profile)?;
    if drive.look()?.state.is_running() {
        drive.stop()?;
    }
    Ok(drive.look()?.state)
}
