//! Runs a motor for ten seconds, and stops it: also after Ctrl-C, an error, or a panic.
//!
//! ```text
//! cargo run --example run_and_stop                            a simulated GD350
//! cargo run --example run_and_stop -- /dev/ttyUSB0 gd350 1    a real one. ITS MOTOR TURNS.
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::env;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use drivebus::{Bus, Profile};

const RUNS: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut given = env::args().skip(1);
    let port = given.next().unwrap_or("sim://gd350?clock=virtual".to_owned());
    let family = given.next().unwrap_or("gd350".to_owned());
    let unit = given.next().map_or(Ok(1), |unit| unit.parse())?;

    // By itself Ctrl-C ends the process at once, and the motor turns on.
    let is_over = Arc::new(AtomicBool::new(false));
    let ends = Arc::clone(&is_over);
    ctrlc::set_handler(move || ends.store(true, Ordering::Release))?;

    let bus = Bus::open(&port)?;
    let drive = bus.drive(unit, &Profile::builtin(&family)?)?;
    println!("{}", drive.identify()?);
    drive.prepare()?; // it obeys the bus until it is switched off

    let running = drive.running(10.0)?;
    let until = bus.now() + RUNS;
    while !is_over.load(Ordering::Acquire) && bus.now() < until {
        println!("{}", running.status()?); // an error ends `running`, and so the motor
        bus.sleep(Duration::from_secs(1));
    }
    running.stop()?; // an error: the motor may still turn
    println!("told to stop: {}", drive.status()?);
    Ok(())
}
