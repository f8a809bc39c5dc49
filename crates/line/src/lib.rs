//! Ports, and the owner of the bus: the layer that blocks, sleeps and reads a clock.
//!
//! [`Bus`] drives the state machines of `drivebus-rtu` over any [`Line`]: a serial port, a serial server, a Modbus TCP
//! gateway, or the simulated line of `drivebus-sim`. It is safe from any thread. One caller at a time owns the line; the
//! silence of 3.5 characters is kept before every request, counted from the last byte seen or sent; an answer is handed
//! over at its last byte.
//!
//! Ports are opened by what people call them ([`url`]), or by an [`Opener`] of one's own. The crate `drivebus` puts plain
//! numbers around it, simulated lines, and futures.
//!
//! ```no_run
//! use drivebus_line::url::{Known, PortOptions, PortUrl};
//! use drivebus_line::{Bus, BusOptions, CallOptions};
//! use drivebus_rtu::{Answer, Destination, Request, SerialFormat, UnitAddress};
//!
//! let format = SerialFormat::default();
//! let port = PortUrl::parse("/dev/ttyUSB0", &Known::default())?;
//! let opener = port.opener(&PortOptions::new(format)).ok_or("a port that this crate opens")?;
//! let bus = Bus::open(opener, BusOptions::new(format).retries(1), &mut || false)?;
//!
//! let unit = Destination::Unit(UnitAddress::new(1)?);
//! let mut word = None;
//! let mut take = |answer: Answer<'_>| {
//!     if let Answer::Read { words, .. } = answer {
//!         word = words.get(0);
//!     }
//! };
//! bus.call(unit, &Request::read(0x2103, 1)?, CallOptions::new(), &mut || false, &mut take)?;
//! println!("unit 1 says what it is: {word:04X?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//!
//! All on by default; `default-features = false` leaves a bus over any [`Line`] of your own.
//!
//! | feature | what it brings |
//! | --- | --- |
//! | `serial` | serial ports of this machine |
//! | `tcp` | serial servers (`socket://`), Modbus TCP (`tcp://`), and a server for it |
//! | `share` | ports that programs of one user share |
//!
//! # Limits
//!
//! - It is tested on Linux. RS-485 by the kernel's driver, the low latency of USB adapters and their identity are Linux's alone.
//! - A silence is as exact as the system's clock and its scheduler: never shorter than it must be, often some tens of
//!   microseconds longer.
//! - One request at a time on a line, also over Modbus TCP.
//! - Nothing here is a safety function, and nothing knows what a word means: that is `drivebus-drives`.
//!
//! # Rooms
//!
//! Each rests on those before it.
//!
//!
//! | room | what is in it |
//! | --- | --- |
//! | `line`, `error` | what every kind of line promises; what can become of a call |
//! | `by_unit` | what is kept of each unit |
//! | `device` | who made a unit, by its own words |
//! | `system` | what is asked of the machine: the time, waits that end on time, whose process this is, forked children |
//! | `turns` | whose turn it is: the order of those who wait, their queue, and the crew for work without a thread |
//! | `trace` | the frames on a line, for whoever watches it |
//! | `options`, `ask` | what a bus, a unit and a call may be told to do otherwise; one request as it goes to the line |
//! | `ports` | the lines that a machine has: serial ports and their adapters, serial servers, Modbus TCP |
//! | `health` | what is counted, how well each unit is reached, and what the figures most likely mean |
//! | `share` | one port, several programs: what they say to each other, and where they meet |
//! | `owner` | who has the turn: what is known of the line and its units, and one exchange at a time |
//! | `bus` | the bus as its callers see it: calls, errands, listening |
//! | `poll` | what a bus asks again and again by itself |
//! | `gateway` | a server for Modbus TCP before a bus |

mod ask;
mod bus;
mod by_unit;
mod device;
mod error;
#[cfg(feature = "tcp")]
pub mod gateway;
mod health;
mod line;
#[cfg(test)]
mod nobody;
mod options;
mod owner;
mod poll;
mod ports;
#[cfg(all(any(unix, windows), feature = "share"))]
mod share;
mod system;
mod trace;
mod turns;

pub use ask::Done;
pub use bus::Bus;
pub use bus::errand::{Errand, Reply};
pub use bus::workers::Running;
pub use device::{DeviceIdentification, DeviceQuestion};
pub use error::kind::ErrorKind;
pub use error::{CallError, Failure};
pub use health::hint::{By, Hint};
pub use health::link::Link;
pub use health::stats::{Counters, Latency, Program, Stats};
pub use line::{Line, LineClock, Opener, PortError, PortErrorKind};
pub use options::{
    AdapterEcho, BusOptions, CallOptions, HaltLine, Halted, Halter, LastWill, Named, Share, UnitOptions,
};
pub use poll::Poll;
pub use poll::ring::{PollBatch, PollSample};
pub use poll::samples::PollCounts;
pub use poll::target::{PollError, PollTarget};
#[cfg(feature = "serial")]
pub use ports::adapters::facts::PortFacts;
#[cfg(feature = "serial")]
pub use ports::adapters::identity::Places;
pub use ports::key::PortKey;
#[cfg(target_os = "linux")]
pub use ports::pty;
pub use ports::set_again::SetAgain;
pub use ports::url;
pub use ports::words::WordError;
#[cfg(feature = "tcp")]
pub use ports::{mbap, tcp};
#[cfg(feature = "serial")]
pub use ports::{rs485, tty};
#[cfg(all(unix, feature = "share"))]
pub use share::folder::run_time_folder;
pub use system::clock;
pub use trace::{Direction, Overheard, Traced, Watch};
pub use turns::order::Priority;
