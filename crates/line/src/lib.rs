//! Ports, and the owner of the bus: the layer that blocks, sleeps and reads a clock.
//!
//! [`Bus`] drives the state machines of `drivebus-rtu` over any [`Line`]: a serial port, a serial server, a Modbus TCP
//! gateway, or the simulated line of `drivebus-sim`. It is safe from any thread. One caller at a time owns the line; the
//! silence of 3.5 characters is kept before every request, counted from the last byte seen or sent; an answer is handed
//! over at its last byte.
//!
//! Ports are opened by what people call them ([`url`]), or by an [`Opener`] of one's own, here of a simulated line. The crate
//! `drivebus` puts plain numbers around it, and futures.
//!
//! ```
//! use drivebus_line::{Bus, BusOptions, CallOptions};
//! use drivebus_rtu::{Answer, Destination, Request, SerialFormat, UnitAddress};
//! use drivebus_sim::{Options, Simulator};
//!
//! let simulator = Simulator::new([(1, "gd350")], Options::default())?;
//! let opener = move || Ok(Box::new(simulator.open_line()?) as _);
//! let bus = Bus::open(Box::new(opener), BusOptions::new(SerialFormat::default()), &mut || false)?;
//!
//! let unit = Destination::Unit(UnitAddress::new(1)?);
//! let mut word = None;
//! let mut take = |answer: Answer<'_>| {
//!     if let Answer::Read { words, .. } = answer {
//!         word = words.get(0);
//!     }
//! };
//! bus.call(unit, &Request::read(0x2103, 1)?, CallOptions::default(), &mut || false, &mut take)?;
//! assert_eq!(word, Some(0x01A0)); // a Goodrive350
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attempt;
mod backoff;
mod bus;
mod by_unit;
mod call;
pub mod clock;
mod course;
mod crew;
mod echo;
mod errand;
mod error;
mod exchange;
#[cfg(feature = "serial")]
mod facts;
mod hint;
mod hints;
#[cfg(feature = "serial")]
mod holder;
#[cfg(feature = "serial")]
mod identity;
mod kind;
#[cfg(feature = "serial")]
mod latency;
mod link;
mod listen;
mod longer;
mod lumps;
#[cfg(feature = "tcp")]
pub mod mbap;
#[cfg(test)]
mod nobody;
mod opener;
mod order;
mod owner;
mod poll;
mod poll_ring;
mod poll_run;
mod poll_samples;
mod poll_schedule;
mod port;
mod ports;
mod process;
mod punctual;
mod queue;
mod resync;
#[cfg(feature = "serial")]
pub mod rs485;
mod stats;
#[cfg(feature = "tcp")]
pub mod tcp;
#[cfg(feature = "serial")]
pub mod tty;
mod units;
mod words;

pub use bus::{Bus, BusOptions};
pub use call::CallOptions;
pub use echo::AdapterEcho;
pub use errand::{Errand, Reply, Running};
pub use error::{CallError, Failure};
pub use exchange::Done;
#[cfg(feature = "serial")]
pub use facts::PortFacts;
pub use hint::Hint;
#[cfg(feature = "serial")]
pub use identity::Places;
pub use kind::ErrorKind;
pub use link::Link;
pub use opener::Opener;
pub use poll::{Poll, PollCounts, PollError, PollTarget};
pub use poll_ring::{PollBatch, PollSample};
pub use port::{Line, LineClock, PortError, PortErrorKind};
pub use ports::url;
pub use queue::Priority;
pub use stats::{Counters, Latency, Stats};
pub use units::UnitOptions;
pub use words::WordError;
