//! What the search relies on.

use drivebus_rtu::Assumption;

/// What holds on every line that is searched: a frame may come twice, at once, and may be damaged, which shows.
/// On one of them a unit gives other numbers of words than it is asked for, and has done so before.
pub const ASSUMED: &[Assumption] = &[
    Assumption::AnswersOnce,
    Assumption::AnswersWhole,
    Assumption::AnswersInTime,
    Assumption::OthersInOrder,
    Assumption::DamageShows,
];
