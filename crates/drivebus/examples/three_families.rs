//! Runs drives of three makers on one line by the same calls, one after the other.
//!
//! ```text
//! cargo run --example three_families                    simulated ones
//! cargo run --example three_families -- /dev/ttyUSB0    real ones, units 1 to 3. THEIR MOTORS TURN.
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::time::Duration;

use drivebus::{Bus, Drive, Error, Profile, Setpoint, Store};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let simulated = "sim://1=gd350,2=vfd500,3=ms300?clock=virtual".to_owned();
    let bus = Bus::open(&std::env::args().nth(1).unwrap_or(simulated))?;
    for (unit, family) in [(1, "gd350"), (2, "vfd500"), (3, "ms300")] {
        // Of some families documents do not print all that is needed.
        let drive = bus.drive(unit, &Profile::builtin(family)?)?.unverified();
        if let Some(against) = drive.contradiction()? {
            println!("unit {unit} is no {family}: {against}");
            continue;
        }
        // It shall obey the bus: in RAM, where it is known how to write to that alone.
        let store = if drive.profile().memory().is_some() { Store::Ram } else { Store::Eeprom };
        drive.prepare_for(Setpoint::Frequency, store)?;
        match turn(&drive) {
            Ok(()) => println!("unit {unit}, {family}: {}", drive.status()?),
            Err(error) if error.may_have_acted() => println!("unit {unit} MAY TURN: {error}"),
            Err(error) => println!("unit {unit} goes on as it was: {error}"),
        }
    }
    Ok(())
}

/// Turns the motor for ten seconds.
fn turn(drive: &Drive) -> Result<(), Error> {
    let running = drive.running(10.0)?;
    drive.bus().sleep(Duration::from_secs(10));
    println!("unit {}: {}", drive.unit(), running.status()?);
    running.stop()
}
