//! Reads values by their names, in engineering units. Nothing is written to the drive.
//!
//! ```text
//! cargo run --example read_by_name                    a simulated GD350
//! cargo run --example read_by_name -- /dev/ttyUSB0    a real one, unit 1, 19200 8E1
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use drivebus::{Bus, Profile, Reading};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let port = std::env::args().nth(1).unwrap_or("sim://gd350?clock=virtual".to_owned());
    let bus = Bus::builder().read_only(true).open(&port)?;
    let gd350 = Profile::builtin("gd350")?;
    let values = bus.values(1, &Reading::new(&gd350, ["output_current", "bus_voltage", "P00.03"])?)?;
    for (name, value, unit) in values.iter() {
        println!("{name} = {value} {unit}");
    }
    Ok(())
}
