//! Variable-frequency drives over RS-485: one door to the protocol, the bus, the drives' meaning and the simulator.
//!
//! A [`Bus`] is one line with its owner. It is safe from any thread, takes no answer for another's, and repeats only what
//! may be repeated. A [`Profile`] says what a family of drives means by its registers, and a [`Reading`] brings values by
//! name in the fewest reads. A simulated line answers as a real one does:
//!
//! ```
//! use drivebus::{Bus, Profile, Reading};
//!
//! let bus = Bus::open("sim://gd350?clock=virtual")?; // a real line: "/dev/ttyUSB0", "COM3", "socket://host:port"
//! assert_eq!(bus.read(1, 0x2103, 1)?, [0x01A0]); // what a Goodrive350 says it is
//!
//! let gd350 = Profile::builtin("gd350")?;
//! let values = bus.values(1, &Reading::new(&gd350, ["output_current", "bus_voltage"])?)?;
//! for (name, value, unit) in values.iter() {
//!     println!("{name} = {value} {unit}");
//! }
//! # assert_eq!(values.get("output_current").unwrap().to_string(), "0.0");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Ports
//!
//! | port | what it is |
//! | --- | --- |
//! | `/dev/ttyUSB0`, `COM3` | a serial port of this machine |
//! | `socket://host:port` | a serial server that passes the bytes of RTU through |
//! | `tcp://host`, `tcp://host:502` | Modbus TCP |
//! | `sim://gd350`, `sim://1=gd350,2=vfd500?clock=virtual&seed=1` | a simulated line in this process |
//!
//! [`Bus::builder`] sets what is different: the characters, time-outs, retries, reading only, direction control.
//!
//! # After an error: did the drive take it?
//!
//! [`Error::may_have_acted`] says whether the request went out and may have been obeyed, and [`Error::kind`] says by whose
//! fault it failed. Nothing that changes something in a drive is repeated here, but a [halt](Bus::halt).
//!
//! # Without a thread that waits
//!
//! [`aio::Bus`] has the same calls as futures, for any executor. Who drops one before it was sent has taken it back.
//!
//! # Features
//!
//! All of them are on by default.
//!
//! | feature | what it brings |
//! | --- | --- |
//! | `serial` | serial ports of this machine |
//! | `tcp` | serial servers (`socket://`) and Modbus TCP (`tcp://`) |
//! | `share` | ports that programs of one user share |
//! | `sim` | simulated lines (`sim://`); it needs `builtin-profiles` |
//! | `builtin-profiles` | the shipped profiles as part of the program |
//!
//! # Limits
//!
//! - It finds out what a unit is and what it does, and [halts](Bus::halt) it. What starts a motor is in the Python package: a
//!   program that moves motors from here writes the words and confirms them itself.
//! - It is no safety function. An emergency stop is a wire.

#![forbid(unsafe_code)]

pub mod aio;
mod builder;
mod bus;
mod checks;
mod driving;
mod error;
mod halting;
mod named;
mod not_done;
mod operations;
mod options;
mod payload;
mod poll;
mod reading;
mod replies;
mod running;
#[cfg(feature = "sim")]
mod simulated;
mod status;

pub use builder::Builder;
pub use bus::Bus;
pub use driving::Drive;
pub use error::Error;
pub use halting::Halting;
pub use options::CallOptions;
pub use payload::Payload;
pub use poll::{Poll, Sample, Target};
pub use reading::{Reading, Values};
pub use running::Running;
pub use status::Status;

pub use drivebus_drive as drive;
pub use drivebus_drives as drives;
pub use drivebus_line as line;
pub use drivebus_rtu as rtu;
#[cfg(feature = "sim")]
pub use drivebus_sim as sim;

pub use drive::{Frequencies, Look, Setting, Start};
pub use drives::{Fault, Profile, State, Value};
#[cfg(feature = "serial")]
pub use line::rs485::Rs485;
pub use line::{AdapterEcho, ErrorKind, Link, Opener, Share, Stats, UnitOptions};
pub use rtu::{DataBits, Instant, Parity, SerialFormat, Silence, StopBits};
#[cfg(feature = "sim")]
pub use sim::Simulator;

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
