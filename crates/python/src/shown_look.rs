//! What one look showed, as Python makes its own of it.

use drivebus_drive::Look;

/// A look: state, its word, the number of the fault, whether it is in it, the fields, and when that was.
pub(crate) type Shown = (&'static str, Option<u16>, Option<u16>, bool, Vec<(String, String)>, f64);

pub(crate) fn shown(look: Look) -> Shown {
    let Look { state, word, fault, is_in_fault, fields, asked, .. } = look;
    (state.name(), word, fault, is_in_fault, fields, asked.as_secs_f64())
}
