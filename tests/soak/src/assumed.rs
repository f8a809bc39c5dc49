//! What the soak relies on.

use drivebus_rtu::Assumption;

/// What holds on its line, whatever faults there are: answers come late, but within four time-outs; they come shorter and longer,
/// but each unit has shown that before, in its turn. Nobody else asks.
pub const ASSUMED: &[Assumption] =
    &[Assumption::AnswersOnce, Assumption::AnswersWhole, Assumption::AnswersInTime, Assumption::DamageShows];
