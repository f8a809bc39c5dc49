//! Polls the monitor registers of a drive, and writes one line of CSV a second. Nothing is written to the drive.
//!
//! ```text
//! cargo run --example poll_csv                              a simulated GD350, five lines
//! cargo run --example poll_csv -- /dev/ttyUSB0 > log.csv    a real one, until it is interrupted
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::time::Duration;

use drivebus::{Bus, Profile, Reading, Target};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let port = std::env::args().nth(1);
    let lines = if port.is_some() { usize::MAX } else { 5 };
    let bus = Bus::builder().read_only(true).open(port.as_deref().unwrap_or("sim://gd350?clock=virtual"))?;
    let gd350 = Profile::builtin("gd350")?;
    let names: Vec<&str> = gd350.monitor().map(drivebus::drives::Entry::name).collect();
    let reading = Reading::new(&gd350, names.iter().copied())?;

    println!("time,{}", names.join(","));
    let begin = bus.now();
    let poll = bus.poll([Target::values(1, &reading)], Duration::from_secs(1))?;
    for sample in poll.samples().take(lines) {
        let time = sample.sent().saturating_duration_since(begin).as_secs_f64();
        match sample.values() {
            Ok(Some(values)) => {
                let cells = values.iter().map(|(_, value, _)| value.to_string());
                println!("{time:.3},{}", cells.collect::<Vec<_>>().join(","));
            }
            // The drive did not answer: a line without values, for the beat goes on.
            _ => println!("{time:.3}{}", ",".repeat(names.len())),
        }
    }
    Ok(())
}
