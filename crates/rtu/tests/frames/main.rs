//! Frames on a line: their bytes, where they begin and end, whose they are, and what the two ends of the line do with them.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

mod attribution;
mod common;
mod crc;
mod extreme_moments;
mod framer;
mod huanyang;
mod lumps;
mod master;
mod pdu;
mod seldom;
mod slave;
mod sniffer;
