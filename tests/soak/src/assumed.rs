//! What the soak relies on.

use drivebus_rtu::Assumption;

/// What holds on its line, whatever faults there are: answers come late, but within four time-outs; they come shorter and longer,
/// so that nothing is assumed of their length. Nobody else asks.
pub const ASSUMED: &[Assumption] = &[Assumption::AnswersOnce, Assumption::AnswersInTime, Assumption::DamageShows];
