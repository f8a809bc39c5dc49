//! A simulated RS-485 line with simulated drives on it: everything runs and is tested with no hardware.
//!
//! The [`Simulator`] holds one half-duplex wire, on which every character takes its time, and a [`SimulatedDrive`] for
//! each unit: of a family that is typed here from its manuals, or of a profile of one's own ([`Model`]). Masters reach it three ways:
//!
//! - [`SimLine`], in process, for everything that drives a [`Line`](drivebus_line::Line); in virtual time, where the
//!   clock jumps to what happens next, or in real time;
//! - a pseudo-terminal ([`Simulator::serve_pty`], on Linux), for every program that opens a serial port;
//! - RTU over TCP on 127.0.0.1 ([`Simulator::serve_tcp`], on Unix).
//!
//! [`Simulator::serve_ear`] (on Linux) lets another program overhear what they say.
//!
//! [`SimulatedLine`] is the wire as a test bench sees it: counters, trace, faults on demand.
//!
//! ```
//! use std::time::Duration;
//!
//! use drivebus_line::Line;
//! use drivebus_rtu::{Adu, Destination, Request, UnitAddress};
//! use drivebus_sim::{Options, Simulator};
//!
//! let simulator = Simulator::new([(1, "gd350")], Options::default())?;
//! let mut line = simulator.line();
//!
//! let request = Adu::request(Destination::Unit(UnitAddress::new(1)?), &Request::read(0x2103, 1)?);
//! let sent = line.send(request.as_bytes())?;
//! assert_eq!(sent.as_nanos(), 4_583_334); // 8 characters of 11 bits at 19 200 bit/s
//!
//! let mut answer = Vec::new();
//! let mut buffer = [0; 256];
//! let until = sent + Duration::from_millis(100);
//! while let count @ 1.. = line.receive(&mut buffer, until)? {
//!     answer.extend_from_slice(&buffer[..count]);
//! }
//! assert_eq!(answer[..5], [0x01, 0x03, 0x02, 0x01, 0xA0]); // a Goodrive350
//! assert_eq!(line.now(), until); // and nobody has waited for it
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`Bus`](drivebus_line::Bus) over it asks as it does over a serial port: it keeps the silence, repeats reads, and takes
//! no late answer. What the words mean says a `Profile` of `drivebus-drives`.
//!
//! ```
//! use drivebus_line::{Bus, BusOptions, CallOptions};
//! use drivebus_rtu::{Answer, Destination, Request, SerialFormat, UnitAddress};
//! use drivebus_sim::{Options, Simulator};
//!
//! let simulator = Simulator::new([(1, "gd350"), (2, "vfd500")], Options::default())?;
//! let opener = move || Ok(Box::new(simulator.open_line()?) as _);
//! let bus = Bus::open(Box::new(opener), BusOptions::new(SerialFormat::default()), &mut || false)?;
//!
//! let unit = Destination::Unit(UnitAddress::new(1)?);
//! let mut words = Vec::new();
//! let mut take = |answer: Answer<'_>| {
//!     if let Answer::Read { words: read, .. } = answer {
//!         words.extend(read.iter());
//!     }
//! };
//! bus.call(unit, &Request::read(0x2103, 1)?, CallOptions::default(), &mut || false, &mut take)?;
//! assert_eq!(words, [0x01A0]); // a Goodrive350
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//!
//! None. Pseudo-terminals and the ear are Linux's, RTU over TCP is Unix's; the line in process runs everywhere.
//!
//! # Limits
//!
//! It is a line and drives as manuals describe them, typed with the assumptions below. That a program works here proves nothing
//! about a motor.
//!
//! # Where it differs from hardware
//!
//! - Assumption: a unit takes a request as it is after exactly 3.5 characters of silence. A gap of more than 1.5
//!   characters inside a frame does not spoil it: behind a pseudo-terminal or TCP the gaps are the operating system's.
//! - Assumption: where both sides speak at once, each hears the other's characters spoilt by chance (from the seed), and
//!   nobody hears the third side's.
//! - Assumption: two units never speak at once; the later one waits.
//! - Assumption: a unit answers in the order it was asked, unless [`FaultKind::Overtaken`] says otherwise.
//! - Assumption: whoever speaks in pieces ([`FaultKind::Split`]) holds the line in the pauses too.
//! - Bits and noise levels are not simulated: a character arrives, or it arrives spoilt. Of a port whose speed, parity or
//!   data bits are not those of the units, they understand nothing.
//! - What a drive does that its manual does not say is marked "Assumption:" in the source, beside the code that does it.

#![forbid(unsafe_code)]

mod clock;
mod drive;
#[cfg(target_os = "linux")]
mod ear;
#[cfg(target_os = "linux")]
mod ears;
mod error;
mod faults;
mod handles;
mod heard;
#[cfg(unix)]
mod lateness;
mod line;
mod model;
mod motor;
mod outlet;
#[cfg(unix)]
mod pacer;
#[cfg(unix)]
mod port;
#[cfg(target_os = "linux")]
mod pty;
mod ramp;
mod random;
mod shared;
mod simulator;
mod spoil;
#[cfg(unix)]
mod tcp;
mod trace;
#[cfg(unix)]
mod watch;
mod wire;
mod wire_handle;
mod world;

pub use drive::{Asked, Refusals, WriteRecord};
#[cfg(target_os = "linux")]
pub use ear::EarServer;
pub use error::SimError;
pub use faults::FaultKind;
pub use handles::SimulatedDrive;
pub use line::SimLine;
pub use model::Model;
#[cfg(target_os = "linux")]
pub use pty::PtyServer;
pub use simulator::{Options, Simulator};
#[cfg(unix)]
pub use tcp::TcpServer;
pub use trace::{Side, Transmission};
pub use wire_handle::SimulatedLine;
