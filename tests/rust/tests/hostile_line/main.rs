//! The bus on a hostile line: what other masters were seen to get wrong, and what this one must do instead.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

mod broken;
mod device;
mod doubts;
mod echoing;
mod first_contact;
mod hints;
mod masters_table;
mod odd;
mod probes;
mod refused;
mod repeated;
mod scripted;
mod silent;
mod unproven;
mod written;
