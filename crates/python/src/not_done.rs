//! Why something was not done to a unit, for Python: of which kind the reason is, and what of it Python words.

use drivebus_drive::{
    After, Ignores, LastLook, NotCommanded, NotLedUp, NotReady, NotSame, NotSet, NotSettled, NotTaken, NotTold,
    NotWritten, Setting, WhyNotCommanded, WhyNotLedUp,
};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::aim::not_taken;
use crate::clock::to_seconds;
use crate::errors::refuse;
use crate::same_unit::checked;
use crate::shown_look::shown;
use crate::task::{Failed, unknown};

/// A kind, and what is told of it.
pub(crate) type Told = (&'static str, Py<PyAny>);

pub(crate) fn not_commanded(py: Python<'_>, error: NotCommanded<Failed>) -> PyResult<Py<PyAny>> {
    let NotCommanded { command, found, why, .. } = error;
    let (kind, told) = why_not_commanded(py, why)?;
    let command = command.map(drivebus_drives::Command::name);
    ("not_commanded", (command, to_seconds(found), kind, told)).into_py_any(py)
}

pub(crate) fn not_set(py: Python<'_>, error: NotSet<Failed>) -> PyResult<Py<PyAny>> {
    ("not_set", set_told(py, error)?).into_py_any(py)
}

pub(crate) fn not_settled(py: Python<'_>, error: NotSettled<Failed>) -> PyResult<Py<PyAny>> {
    ("not_settled", settled_told(py, error)?).into_py_any(py)
}

pub(crate) fn not_written(py: Python<'_>, error: NotWritten<Failed>) -> PyResult<Py<PyAny>> {
    ("not_written", written_told(py, error)?).into_py_any(py)
}

pub(crate) fn raised(py: Python<'_>, error: Failed) -> PyResult<Py<PyAny>> {
    PyErr::from(error).into_value(py).into_py_any(py)
}

fn why_not_commanded(py: Python<'_>, why: WhyNotCommanded<Failed>) -> PyResult<Told> {
    use WhyNotCommanded as Why;
    Ok(match why {
        Why::NotReady(why) => ("not_ready", ready_told(py, why)?.into_py_any(py)?),
        Why::NotSet(why) => ("not_set", set_told(py, why)?.into_py_any(py)?),
        Why::NotLedUp(NotLedUp { number, why }) => ("not_led_up", (number, led_up_told(py, why)?).into_py_any(py)?),
        Why::Halted(error) => ("halted", raised(py, error)?),
        Why::HaltedBetween(error) => {
            ("halted_between", error.map(|error| raised(py, error)).transpose()?.into_py_any(py)?)
        }
        Why::HalfWritten(why) => ("half_written", written_told(py, why)?.into_py_any(py)?),
        Why::NotWritten(why) => ("not_written", written_told(py, why)?.into_py_any(py)?),
        Why::Unanswered { last, after: then } => ("unanswered", (raised(py, last)?, after(py, then)?).into_py_any(py)?),
        Why::RefusedAndTurns { last, look } => ("refused_and_turns", (raised(py, last)?, shown(look)).into_py_any(py)?),
        Why::PortLost(error) => ("port_lost", raised(py, error)?),
        Why::Unshown(last) => last_look(py, last)?,
        Why::Ignored { wrong, unshown } => {
            let wrong: Vec<_> = wrong.into_iter().map(setting).collect();
            ("ignored", (wrong, why_not_commanded(py, *unshown)?).into_py_any(py)?)
        }
        Why::Failed(error) | Why::Unseen(error) => return Err(error.into()),
        why => return Err(unknown(&why)),
    })
}

pub(crate) fn ready_told(py: Python<'_>, why: NotReady<Failed>) -> PyResult<Told> {
    Ok(match why {
        NotReady::MayNot(_) => ("may_not", py.None()),
        NotReady::Unseen(_) => ("unseen", py.None()),
        NotReady::Unstoppable { .. } => ("unstoppable", py.None()),
        NotReady::BadLink { link, lost, looks } => {
            ("bad_link", ((link.good, link.asked), lost, looks).into_py_any(py)?)
        }
        NotReady::Settings { then, wrong } => {
            let then = match then {
                Ignores::Words => "words",
                Ignores::Commands => "commands",
                Ignores::Speed => "speed",
                then => return Err(unknown(&then)),
            };
            let wrong: Vec<_> = wrong.into_iter().map(setting).collect();
            ("settings", (then, wrong).into_py_any(py)?)
        }
        NotReady::InFault(look) => ("in_fault", shown(look).into_py_any(py)?),
        NotReady::NoVoltage(look) => ("no_voltage", shown(look).into_py_any(py)?),
        NotReady::UnknownState(look) => ("unknown_state", shown(look).into_py_any(py)?),
        NotReady::OtherSource(look) => ("other_source", shown(look).into_py_any(py)?),
        NotReady::Turning(look) => ("turning", shown(look).into_py_any(py)?),
        NotReady::Failed(error) => return Err(error.into()),
        why => return Err(unknown(&why)),
    })
}

fn set_told(py: Python<'_>, why: NotSet<Failed>) -> PyResult<Told> {
    Ok(match why {
        NotSet::NoRegister => ("no_register", py.None()),
        NotSet::NotSettled(why) => ("not_settled", settled_told(py, why)?.into_py_any(py)?),
        NotSet::NotInHz(unit) => ("not_in_hz", unit.into_py_any(py)?),
        NotSet::MayNot(_) => ("may_not", py.None()),
        NotSet::Unfit(error) => return Err(refuse(error)),
        NotSet::Above { limit, highest } => ("above", (limit, highest.to_f64()).into_py_any(py)?),
        NotSet::NotWritten(why) => ("not_written", written_told(py, why)?.into_py_any(py)?),
        NotSet::Failed(error) => return Err(error.into()),
        why => return Err(unknown(&why)),
    })
}

pub(crate) fn settled_told(py: Python<'_>, why: NotSettled<Failed>) -> PyResult<Told> {
    Ok(match why {
        NotSettled::Unproved { variant, .. } => ("unproved", variant.into_py_any(py)?),
        NotSettled::Unreadable { variant, .. } => ("unreadable", variant.into_py_any(py)?),
        NotSettled::Unknown { variant, raw, .. } => ("unknown", (variant, raw).into_py_any(py)?),
        NotSettled::Failed(error) => return Err(error.into()),
        why => return Err(unknown(&why)),
    })
}

pub(crate) fn written_told(py: Python<'_>, why: NotWritten<Failed>) -> PyResult<Told> {
    Ok(match why {
        NotWritten::Failed(error) | NotWritten::NotSame(NotSame::Failed(error)) => ("failed", raised(py, error)?),
        NotWritten::NotSame(why) => ("not_same", checked(py, Err(why))?),
        NotWritten::Harm(NotTaken::NotTold(NotTold::Failed(error))) => {
            ("harm", ("failed", raised(py, error)?).into_py_any(py)?)
        }
        NotWritten::Harm(why) => ("harm", not_taken(py, why)?),
        why => return Err(unknown(&why)),
    })
}

fn led_up_told(py: Python<'_>, why: WhyNotLedUp<Failed>) -> PyResult<Told> {
    Ok(match why {
        WhyNotLedUp::HaltedBefore(why) => ("halted_before", written_told(py, why)?.into_py_any(py)?),
        WhyNotLedUp::NotWritten(why) => ("not_written", written_told(py, why)?.into_py_any(py)?),
        WhyNotLedUp::Halted => ("halted", py.None()),
        WhyNotLedUp::Tripped(look) => ("tripped", shown(look).into_py_any(py)?),
        WhyNotLedUp::PortLost(error) => ("port_lost", raised(py, error)?),
        WhyNotLedUp::Unshown(last) => last_look(py, last)?,
        why => return Err(unknown(&why)),
    })
}

/// A setting: its code, the word it must hold and the one it holds, label, note, and whether it is verified, is set by hand, and is
/// only some bits of its word.
pub(crate) fn setting(setting: Setting) -> (String, u16, Option<i64>, String, String, bool, bool, bool) {
    let actual = setting.actual.map(drivebus_drives::Value::count);
    let wanted = setting.wanted;
    (wanted.code, wanted.raw, actual, wanted.label, wanted.note, wanted.verified, wanted.by_hand, wanted.bits.is_some())
}

/// A look after something came to nothing, or the exception instead of one.
pub(crate) fn after(py: Python<'_>, after: After<Failed>) -> PyResult<Py<PyAny>> {
    match after {
        After::Seen(look) => shown(look).into_py_any(py),
        After::Unread(error) => PyErr::from(error).into_value(py).into_py_any(py),
    }
}

/// The last look at a unit: `"unshown"`, what it showed and the frequency, or `"unread"` and the exception.
pub(crate) fn last_look(py: Python<'_>, last: LastLook<Failed>) -> PyResult<(&'static str, Py<PyAny>)> {
    Ok(match last {
        LastLook::Seen { look, hz } => ("unshown", (shown(look), hz).into_py_any(py)?),
        LastLook::Unread(error) => ("unread", PyErr::from(error).into_value(py).into_py_any(py)?),
    })
}
