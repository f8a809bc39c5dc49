//! One call from its first thought to its end, on paper: what is asked of a scripted unit, in which order, and what the caller
//! is told. Each test holds one rule that `src/conversation/` states.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

mod among_others;
mod among_others_in_doubt;
mod anything;
mod coming_in;
mod dead_units;
mod echo;
mod first_contact;
mod longer_reads;
mod looks;
mod misuse;
mod port;
mod probes;
mod retries;
mod rig;
mod two_parts;
mod verified;
mod watching;
mod write_back;
