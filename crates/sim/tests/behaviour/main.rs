//! How the simulated line and the simulated drive behave, seen from the bus and from the shaft.
//!
//! Times and values are computed by hand from the character time, the parameters and the motor's figures; frames come
//! from the manuals. Nothing waits: all but `ears` and `ports` runs in virtual time.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod anything;
mod bench;
mod deltas;
#[cfg(target_os = "linux")]
mod ears;
mod eaton;
mod families;
mod faults;
mod fc51;
mod fuji;
mod goodrives;
mod hitachi;
mod inovance;
mod invertek;
mod lenze;
mod ls;
mod memory;
mod mitsubishi;
mod own_profiles;
mod ports;
mod refusals;
mod running;
mod spindles;
mod teco;
mod toshiba;
mod vfd500;
mod weg;
mod wire;
mod yaskawa;
