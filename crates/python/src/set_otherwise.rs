//! A setting that gives command words another meaning, for Python.

use drivebus_drive::SetOtherwise;

/// The parameter that gives words another meaning: its code, what it holds and must hold, what that is called, what the words mean
/// as it is, and a note.
pub(crate) fn set_otherwise(found: SetOtherwise) -> (String, u16, u16, String, String, String) {
    let means = found.means().to_owned();
    let SetOtherwise { wanted, raw, .. } = found;
    (wanted.code, raw, wanted.raw, wanted.label, means, wanted.note)
}
