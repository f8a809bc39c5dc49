//! Profiles against tables that Python walks as well.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod families;
mod state;
