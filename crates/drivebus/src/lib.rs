//! Variable-frequency drives over RS-485: one door to the protocol, the bus, the drives' meaning and the simulator.
//!
//! A [`Bus`] is one line with its owner, a [`Drive`] one drive on it, and a [`Profile`] what its family means by its
//! registers. A simulated line answers as a real one does:
//!
//! ```
//! use std::time::Duration;
//!
//! use drivebus::{Bus, Profile};
//!
//! let bus = Bus::open("sim://gd350?clock=virtual")?; // a real line: "/dev/ttyUSB0", "COM3", "socket://host:port"
//! let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
//! drive.prepare()?; // it obeys the bus until it is switched off
//! let running = drive.running(10.0)?; // at 10 Hz; what `running` is dropped by stops the motor: `?`, a panic
//! bus.sleep(Duration::from_secs(5)); // on the line's clock
//! assert_eq!(running.status()?.to_string(), "forward, 10.00 of 10.00 Hz");
//! println!("{} A", running.read("output_current")?);
//! running.stop()?; // an error: the motor may still turn
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What is checked before a motor starts: that the drive is what it was named as, obeys the bus, is in no fault, and is
//! reached so well that its stop would be. [`Drive::run`] has the list, [`Drive::control`] tells how a drive is set, and
//! [`Drive::prepare`] sets it. [`Drive::write`] writes values by name, parameters to RAM so that no EEPROM wears out.
//! A start is sent once. A halt is sent until the drive takes it, before all that wait for the line, and returns when the
//! drive shows it; [`Bus::halt_all`] halts several drives side by side. [`Drive::wait_for_speed`] waits for a motor.
//!
//! The bus is safe from any thread, takes no answer for another's, and repeats only what may be repeated. A [`Reading`] brings
//! values by name in the fewest reads, and [`Bus::poll`] again and again.
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
//! fault it failed. Nothing that changes something in a drive is repeated here, but a [halt](Drive::halt).
//!
//! # Without a thread that waits
//!
//! [`aio::Bus`] and [`aio::Drive`] have the same calls as futures, for any executor. Who drops one before it was sent has
//! taken it back.
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
//! - Backups are in the Python package.
//! - A process that is killed stops no motor. Whoever needs that sets the drive's [watchdog](Drive::watchdog).
//! - It is no safety function. An emergency stop is a wire.

#![forbid(unsafe_code)]

pub mod aio;
mod builder;
mod bus;
mod checks;
mod driving;
mod error;
mod given;
mod halt_all;
mod halting;
mod named;
mod not_armed;
mod not_done;
mod not_kept;
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
mod waiting;
mod watchdog;
mod writes;

pub use builder::Builder;
pub use bus::Bus;
pub use driving::Drive;
pub use error::Error;
pub use halt_all::NotAllHalted;
pub use halting::Halting;
pub use options::CallOptions;
pub use payload::Payload;
pub use poll::{Poll, Sample, Target};
pub use reading::{Reading, Values};
pub use running::Running;
pub use status::Status;
pub use watchdog::Watchdog;

pub use drivebus_drive as drive;
pub use drivebus_drives as drives;
pub use drivebus_line as line;
pub use drivebus_rtu as rtu;
#[cfg(feature = "sim")]
pub use drivebus_sim as sim;

pub use drive::{FieldInput, Frequencies, Look, OnSilence, Setting, Start};
pub use drives::{Fault, Input, Profile, Setpoint, State, Store, Value};
#[cfg(feature = "serial")]
pub use line::rs485::Rs485;
pub use line::{AdapterEcho, DeviceIdentification, ErrorKind, Link, Opener, Share, Stats, UnitOptions};
pub use rtu::{DataBits, Instant, Parity, SerialFormat, Silence, StopBits};
#[cfg(feature = "sim")]
pub use sim::Simulator;

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
