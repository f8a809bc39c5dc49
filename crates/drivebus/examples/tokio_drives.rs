//! Runs two drives at once from tasks of tokio, and gives up after a time: what is dropped then stops its motor.
//!
//! ```text
//! cargo run --example tokio_drives                    simulated ones
//! cargo run --example tokio_drives -- /dev/ttyUSB0    real GD350, units 1 and 2. THEIR MOTORS TURN.
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::time::Duration;

use drivebus::aio::{Bus, Drive};
use drivebus::{Error, Profile};
use tokio::time::timeout;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let simulated = "sim://1=gd350,2=gd350?clock=virtual".to_owned();
    let bus = Bus::open(&std::env::args().nth(1).unwrap_or(simulated)).await?;
    let gd350 = Profile::builtin("gd350")?;
    let drives = [bus.drive(1, &gd350)?, bus.drive(2, &gd350)?];
    for drive in &drives {
        drive.prepare().await?; // it obeys the bus until it is switched off
    }
    let tasks = drives.map(|drive| {
        tokio::spawn(async move {
            let turned = timeout(Duration::from_secs(60), turn(&drive)).await;
            (drive, turned)
        })
    });
    for task in tasks {
        let (drive, turned) = task.await?;
        match turned {
            Ok(turned) => turned?,
            Err(_) => println!("unit {} took too long, and was stopped", drive.unit()),
        }
        println!("unit {}: {}", drive.unit(), drive.status().await?);
    }
    Ok(())
}

/// Turns the motor for ten seconds. Where this future is dropped meanwhile, `running` is, and stops it.
async fn turn(drive: &Drive) -> Result<(), Error> {
    let running = drive.running(10.0).await?;
    drive.bus().sleep(Duration::from_secs(10)).await?;
    println!("unit {}: {}", drive.unit(), running.status().await?);
    running.stop().await
}
