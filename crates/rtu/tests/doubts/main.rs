//! The rules of "never a wrong answer", one by one and to the nanosecond: what is open, what that makes of the next answer, and
//! how it ends. `frames/attribution.rs` looks for a wrong answer, whatever the rules are.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

mod agreement;
mod asker;
mod beside;
mod forgotten;
mod lengths;
mod open;
mod others;
mod owed;
mod quarantine;
mod torn;
mod turns;
