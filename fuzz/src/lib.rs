//! Fuzz targets: each states an invariant in its first sentence and compares with an oracle.
//!
//! A target is a function of bytes. libFuzzer calls it (`make fuzz`), and so do ordinary tests, with every file of the
//! corpus (`tests/replay.rs`). Here stands all but libFuzzer's main functions, which are in `targets/`.

#![allow(clippy::missing_panics_doc, reason = "to panic is how a target says that its invariant does not hold")]

mod bus;
mod conversation;
mod doubts;
mod frame;
mod framer;
mod gateway;
mod guest;
mod listener;
mod master;
mod operation;
mod oracle;
mod profile;
mod slave;
mod sniffer;
mod stream;
mod told;

pub use bus::bus;
pub use conversation::conversation;
pub use frame::frame;
pub use framer::framer;
pub use gateway::gateway;
pub use guest::guest;
pub use listener::listener;
pub use master::master;
pub use operation::operation;
pub use profile::profile;
pub use slave::slave;
pub use sniffer::sniffer;

/// A target: panics when its invariant does not hold.
pub type Target = fn(&[u8]);

/// Every target by the name of its corpus and of its program.
pub const TARGETS: [(&str, Target); 12] = [
    ("frame", frame),
    ("framer", framer),
    ("listener", listener),
    ("slave", slave),
    ("master", master),
    ("profile", profile),
    ("bus", bus),
    ("conversation", conversation),
    ("guest", guest),
    ("gateway", gateway),
    ("sniffer", sniffer),
    ("operation", operation),
];
