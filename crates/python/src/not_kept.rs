//! Why values were not written to a unit, for Python: of which kind the reason is, and what of it Python words.

use drivebus_drive::{
    Beyond, Held, InForce, NotGiven, NotKept, NotPlanned, NotPrepared, NotSetBits, WhyNotKept, WhyNotPlanned,
    WhyNotStored,
};
use drivebus_drives::Value;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::errors::refuse;
use crate::not_done::{Told, not_commanded, raised, ready_told, setting, settled_told, written_told};
use crate::task::{Failed, unknown};

pub(crate) fn not_kept(py: Python<'_>, error: NotKept<Failed>) -> PyResult<Py<PyAny>> {
    ("not_kept", not_kept_told(py, error)?).into_py_any(py)
}

pub(crate) fn not_prepared(py: Python<'_>, why: NotPrepared<Failed>) -> PyResult<Py<PyAny>> {
    let told: Told = match why {
        NotPrepared::NoSetpoint => ("no_setpoint", py.None()),
        NotPrepared::ByHand(left) => ("by_hand", setting(*left).into_py_any(py)?),
        NotPrepared::MayNot { setting: wanted, .. } => ("may_not", setting(*wanted).into_py_any(py)?),
        NotPrepared::Failed(error) | NotPrepared::Unread(error) => return Err(error.into()),
        NotPrepared::NotKept(error) => ("not_kept", not_kept_told(py, error)?),
        NotPrepared::Unshown(settings) => {
            ("unshown", settings.into_iter().map(setting).collect::<Vec<_>>().into_py_any(py)?)
        }
        why => return Err(unknown(&why)),
    };
    ("not_prepared", told).into_py_any(py)
}

pub(crate) fn not_given(py: Python<'_>, why: NotGiven<Failed>) -> PyResult<Py<PyAny>> {
    let told: Told = match why {
        NotGiven::NoRegister => ("no_register", py.None()),
        NotGiven::Ignored(settings) => {
            ("ignored", settings.into_iter().map(setting).collect::<Vec<_>>().into_py_any(py)?)
        }
        NotGiven::Failed(error) => return Err(error.into()),
        NotGiven::NotKept(why) => ("not_kept", kept_told(py, *why)?.into_py_any(py)?),
        why => return Err(unknown(&why)),
    };
    ("not_given", told).into_py_any(py)
}

pub(crate) fn not_set_bits(py: Python<'_>, why: NotSetBits<Failed>) -> PyResult<Py<PyAny>> {
    let told: Told = match why {
        NotSetBits::NoRegister => ("no_register", py.None()),
        NotSetBits::MayNot(_) => ("may_not", py.None()),
        NotSetBits::NothingNamed => ("nothing_named", py.None()),
        NotSetBits::NoField { name, known } => ("no_field", (name, known).into_py_any(py)?),
        NotSetBits::Unfit { name, choices } => ("unfit", (name, choices).into_py_any(py)?),
        NotSetBits::Unproved { name, .. } => ("unproved", name.into_py_any(py)?),
        NotSetBits::NotReady(why) => ("not_ready", ready_told(py, why)?.into_py_any(py)?),
        NotSetBits::Ignored(settings) => {
            ("ignored", settings.into_iter().map(setting).collect::<Vec<_>>().into_py_any(py)?)
        }
        NotSetBits::Unreadable(_) => ("unreadable", py.None()),
        NotSetBits::Failed(error) => return Err(error.into()),
        NotSetBits::NotCommanded(error) => return not_commanded(py, *error),
        NotSetBits::NotWritten(why) => ("not_written", written_told(py, why)?.into_py_any(py)?),
        why => return Err(unknown(&why)),
    };
    ("not_set_bits", told).into_py_any(py)
}

/// What was written before, and of which kind the reason is.
pub(crate) fn not_kept_told(py: Python<'_>, error: NotKept<Failed>) -> PyResult<Py<PyAny>> {
    let (kind, told) = kept_told(py, *error.why)?;
    (error.done, kind, told).into_py_any(py)
}

fn kept_told(py: Python<'_>, why: WhyNotKept<Failed>) -> PyResult<Told> {
    use WhyNotKept as Why;
    Ok(match why {
        Why::NotPlanned(NotPlanned { name, why, .. }) => {
            let (kind, word) = planned_told(*why)?;
            ("not_planned", (name, kind, word).into_py_any(py)?)
        }
        Why::Decides { name, other } => ("decides", (name, other).into_py_any(py)?),
        Why::Unsays { name, variant, choice } => ("unsays", (name, variant, choice).into_py_any(py)?),
        Why::NotSettled(why) => ("not_settled", settled_told(py, why)?.into_py_any(py)?),
        Why::Running { names, state } => ("running", (names, state.name()).into_py_any(py)?),
        Why::Beyond(beyond) => {
            let Beyond { wanted, limit, is_below, .. } = *beyond;
            ("beyond", (held(wanted), held(limit), is_below).into_py_any(py)?)
        }
        // What was written before it has to be said with it.
        Why::Failed(error) => ("failed", raised(py, error)?),
        Why::NotWritten { names, why, in_force } => {
            let in_force = in_force.map(|told| in_force_told(py, told)).transpose()?;
            ("not_written", (names, written_told(py, why)?, in_force).into_py_any(py)?)
        }
        Why::NotStored { why, .. } => ("not_stored", stored_told(py, why)?.into_py_any(py)?),
        why => return Err(unknown(&why)),
    })
}

pub(crate) fn not_stored(py: Python<'_>, why: WhyNotStored<Failed>) -> PyResult<Py<PyAny>> {
    ("not_stored", stored_told(py, why)?).into_py_any(py)
}

fn stored_told(py: Python<'_>, why: WhyNotStored<Failed>) -> PyResult<Told> {
    Ok(match why {
        WhyNotStored::MayNot(why) => ("may_not", why.into_py_any(py)?),
        WhyNotStored::Unread(error) => ("unread", raised(py, error)?),
        WhyNotStored::NotIdle { found, idle, .. } => ("not_idle", (found, idle).into_py_any(py)?),
        WhyNotStored::NotWritten(why) => ("not_written", written_told(py, why)?.into_py_any(py)?),
        WhyNotStored::Unseen(error) => ("unseen", raised(py, error)?),
        WhyNotStored::Late(found) => ("late", found.into_py_any(py)?),
        why => return Err(unknown(&why)),
    })
}

/// The kind, and the word whose range is not printed.
fn planned_told(why: WhyNotPlanned) -> PyResult<(&'static str, Option<u32>)> {
    Ok(match why {
        WhyNotPlanned::Unknown(error) => return Err(refuse(error)),
        WhyNotPlanned::ReadOnly => ("read_only", None),
        WhyNotPlanned::Moves => ("moves", None),
        WhyNotPlanned::Stores => ("stores", None),
        WhyNotPlanned::MayNot(_) => ("may_not", None),
        WhyNotPlanned::OnlyStored => ("only_stored", None),
        WhyNotPlanned::Unfit(error) => return Err(refuse(error)),
        WhyNotPlanned::NoRange(word) => ("no_range", Some(word)),
        WhyNotPlanned::NoPlace(error) => return Err(refuse(error)),
        WhyNotPlanned::MayNotKeep(_) => ("may_not_keep", None),
        why => return Err(unknown(&why)),
    })
}

fn in_force_told(py: Python<'_>, told: InForce<Failed>) -> PyResult<Told> {
    Ok(match told {
        InForce::Shown(all) => ("shown", all.into_iter().map(held).collect::<Vec<_>>().into_py_any(py)?),
        InForce::Unread(error) => ("unread", raised(py, error)?),
        told => return Err(unknown(&told)),
    })
}

/// A name, a value and its unit.
pub(crate) fn held(held: Held) -> (String, f64, String) {
    (held.name, Value::to_f64(held.value), held.unit)
}
