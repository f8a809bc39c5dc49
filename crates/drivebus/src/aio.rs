//! The same bus for who does not wait in a thread: each call is a future, for any executor.
//!
//! Nothing is asked before a future is polled first. One that is dropped while it still waits for the line is taken back
//! and never sent; what is on the wire ends by itself, so that the line stays clean, and is not repeated.
//!
//! ```
//! use drivebus::aio;
//!
//! # #[tokio::main(flavor = "current_thread")]
//! # async fn main() -> Result<(), drivebus::Error> {
//! let bus = aio::Bus::open("sim://1=gd350,2=vfd500?clock=virtual").await?;
//! let (first, second) = tokio::join!(bus.read(1, 0x2103, 1), bus.echo(2));
//! assert_eq!(first?, [0x01A0]);
//! assert!(!second?.is_zero());
//! # Ok(())
//! # }
//! ```

mod asked;
mod bus;
mod drive;
mod halt_all;
mod poll;
mod running;
mod slot;
mod waiting;
mod watchdog;

pub use asked::Asked;
pub use bus::Bus;
pub use drive::Drive;
pub use poll::Poll;
pub use running::Running;
pub use watchdog::Watchdog;
