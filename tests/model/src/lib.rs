//! The state machines of `drivebus-rtu` under every line that is assumed: searched exhaustively, within bounds.
//!
//! The conversation and what is known of the line are the real ones, cloned as part of each state. Around them stand a program
//! that calls ([`program`]), and units, a line and an adapter that do whatever is assumed of them ([`world`]). An answer under
//! way knows the request that it was given to, which the wire does not say; so an answer that is attributed to another one shows.
//! [`scenario`] has the lines and how far each is searched, [`before`] what came before, [`search`] what can happen and what must hold, [`ends`] when each
//! doubt must be over, and [`trace`] tells a run in words.

mod assumed;
pub mod before;
pub mod ends;
pub mod fingerprint;
pub mod frames;
pub mod judge;
pub mod program;
pub mod scenario;
pub mod search;
pub mod trace;
pub mod world;

pub use assumed::ASSUMED;
pub use scenario::{Budget, SCENARIOS, Scenario};
pub use search::{Finding, Order, Search};
