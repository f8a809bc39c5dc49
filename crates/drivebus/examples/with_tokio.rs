//! Asks two drives from tasks of tokio, and gives up what takes too long: it is never sent then.
//!
//! ```text
//! cargo run --example with_tokio                    two simulated drives
//! cargo run --example with_tokio -- /dev/ttyUSB0    real ones, units 1 and 2
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::time::Duration;

use drivebus::aio::Bus;
use tokio::time::timeout;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), drivebus::Error> {
    let port = std::env::args().nth(1).unwrap_or("sim://1=gd350,2=gd350?clock=virtual".to_owned());
    let bus = Bus::open(&port).await?;
    let tasks = [1, 2].map(|unit| {
        let bus = bus.clone();
        tokio::spawn(async move { (unit, bus.read(unit, 0x3000, 5).await) })
    });
    for task in tasks {
        if let Ok((unit, words)) = task.await {
            println!("unit {unit}: {:?}", words?);
        }
    }
    match timeout(Duration::from_secs(2), bus.echo(1)).await {
        Ok(round_trip) => println!("unit 1 answers within {} ms", round_trip?.as_millis()),
        Err(_) => println!("unit 1 was not heard in time; what had not been sent is not sent any more"),
    }
    bus.close().await
}
