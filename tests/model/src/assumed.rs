//! What the search relies on.

use drivebus_rtu::Assumption;

/// What holds on every line that is searched: a frame may come twice, at once, and may be damaged, which shows.
pub const ASSUMED: &[Assumption] = &[
    Assumption::AnswersOnce,
    Assumption::AnswersWhole,
    Assumption::AnswersInTime,
    Assumption::OthersInOrder,
    Assumption::DamageShows,
];
