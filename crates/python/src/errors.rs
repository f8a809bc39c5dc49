//! Rust's errors as the exceptions of `drivebus.errors`, which are written in Python so that they have docs and two
//! bases where it helps.

use drivebus_line::{CallError, ErrorKind, Failure, PortError, PortErrorKind};
use drivebus_rtu::{AnswerError, Destination, ExceptionCode, FrameError, Instant};
use drivebus_sim::SimError;
use pyo3::exceptions::PySystemExit;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyType};

use crate::clock::UnixClock;
use crate::ending::Inside;

/// The classes of `drivebus.errors`.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Class {
    Port,
    NoAnswer,
    BadAnswer,
    Crc,
    Refused,
    NotAllowed,
    BadArgument,
    NotReady,
    QueueFull,
    Unconfirmed,
}

impl Class {
    pub(crate) fn get(self, py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
        static CLASSES: [PyOnceLock<Py<PyType>>; 10] = [const { PyOnceLock::new() }; 10];
        let (index, name) = match self {
            Self::Port => (0, "PortError"),
            Self::NoAnswer => (1, "NoAnswer"),
            Self::BadAnswer => (2, "BadAnswer"),
            Self::Crc => (3, "CrcError"),
            Self::Refused => (4, "Refused"),
            Self::NotAllowed => (5, "NotAllowed"),
            Self::Unconfirmed => (6, "Unconfirmed"),
            Self::BadArgument => (7, "BadArgument"),
            Self::NotReady => (8, "NotReady"),
            Self::QueueFull => (9, "QueueFull"),
        };
        CLASSES[index].import(py, "drivebus.errors", name)
    }

    /// An exception of this class with `message` and whatever `details` puts among its keyword arguments.
    ///
    /// Where it is too late to call the class, which is written in Python, `SystemExit`: it ends a thread without a word.
    pub(crate) fn raise(
        self,
        message: String,
        details: impl for<'py> FnOnce(&Bound<'py, PyDict>) -> PyResult<()>,
    ) -> PyErr {
        let build = |py: Python<'_>| {
            let keywords = PyDict::new(py);
            details(&keywords)?;
            Ok(PyErr::from_value(self.get(py)?.call((message,), Some(&keywords))?))
        };
        match Inside::enter().and_then(|_inside| Python::try_attach(build)) {
            Some(Ok(error) | Err(error)) => error,
            None => PyErr::new::<PySystemExit, _>(()),
        }
    }
}

/// `BadArgument`: nothing was sent.
pub(crate) fn bad_argument(message: String) -> PyErr {
    Class::BadArgument.raise(message, |_| Ok(()))
}

/// `BadArgument` with an error's own words.
pub(crate) fn refuse(error: impl std::fmt::Display) -> PyErr {
    bad_argument(error.to_string())
}

/// `PortError`: the port cannot be opened or was lost.
pub(crate) fn port_error(error: &PortError) -> PyErr {
    Class::Port.raise(error.to_string(), |keywords| keywords.set_item("errno", number_of(error.kind)))
}

/// The number that errors of the system have for `kind`: `ENOENT` and the like, which are the same on all systems.
const fn number_of(kind: PortErrorKind) -> i32 {
    match kind {
        PortErrorKind::NotFound => 2,
        PortErrorKind::Busy => 16,
        PortErrorKind::Denied => 13,
        PortErrorKind::Lost => 19,
        PortErrorKind::Closed => 9,
        PortErrorKind::Unsupported => 22,
        _ => 5,
    }
}

/// What the system refused is the port's trouble, anything else was asked for wrongly.
pub(crate) fn sim_error(what: &str, error: SimError) -> PyErr {
    match error {
        SimError::Io(error) => port_error(&PortError::new(PortErrorKind::Other, what, error.to_string())),
        error => refuse(error),
    }
}

/// `CrcError` or `BadAnswer` for bytes that are no frame.
pub(crate) fn frame_error(error: FrameError, raw: &[u8]) -> PyErr {
    let class = if matches!(error, FrameError::Crc { .. }) { Class::Crc } else { Class::BadAnswer };
    class.raise(error.to_string(), |keywords| keywords.set_item("raw", PyBytes::new(keywords.py(), raw)))
}

/// `BadAnswer` for a whole frame that does not answer what was asked.
pub(crate) fn answer_error(error: AnswerError, request: &[u8], raw: &[u8]) -> PyErr {
    Class::BadAnswer.raise(error.to_string(), |keywords| {
        keywords.set_item("request", PyBytes::new(keywords.py(), request))?;
        keywords.set_item("raw", PyBytes::new(keywords.py(), raw))
    })
}

/// `Refused`: the unit answered with exception `code`. What the code means, only a profile can say.
pub(crate) fn refused(
    message: &str,
    code: ExceptionCode,
    details: impl for<'py> FnOnce(&Bound<'py, PyDict>) -> PyResult<()>,
) -> PyErr {
    let name = code.standard_name();
    Class::Refused.raise(format!("{message} ({name} by the specification)"), |keywords| {
        details(keywords)?;
        keywords.set_item("code", code.0)?;
        keywords.set_item("name", name)?;
        keywords.set_item("meaning", "")?;
        keywords.set_item("means", code.meaning().name())
    })
}

/// A call that brought no answer; its beginning and end by `clock`.
pub(crate) fn call_error(error: &CallError, clock: UnixClock) -> PyErr {
    let at = |moment: Option<Instant>| moment.map(|moment| clock.at(moment));
    let (started, ended) = (at(error.sent), at(error.ended));
    let unit = match error.destination {
        Destination::Unit(unit) => unit.get(),
        Destination::Broadcast => 0,
    };
    let details = |keywords: &Bound<'_, PyDict>| {
        let py = keywords.py();
        keywords.set_item("unit", unit)?;
        keywords.set_item("request", PyBytes::new(py, &error.request))?;
        keywords.set_item("raw", PyBytes::new(py, &error.raw))?;
        keywords.set_item("started", started)?;
        keywords.set_item("ended", ended)
    };
    let message = error.to_string();
    let class = match error.kind() {
        ErrorKind::Port => Class::Port,
        ErrorKind::NoAnswer => Class::NoAnswer,
        ErrorKind::Crc => Class::Crc,
        ErrorKind::Unconfirmed => Class::Unconfirmed,
        ErrorKind::NotAllowed => match error.failure {
            Failure::NotBegun(_) => Class::BadArgument,
            Failure::QueueFull { .. } => Class::QueueFull,
            _ => Class::NotAllowed,
        },
        _ => Class::BadAnswer,
    };
    let not_ready = |why| {
        Class::NotReady.raise(message.clone(), |keywords| {
            details(keywords)?;
            keywords.set_item("why", why)
        })
    };
    let kind = match &error.failure {
        Failure::Refused { code, .. } => return refused(&message, *code, details),
        Failure::ReadOnly { .. } | Failure::NotARead { .. } => return not_ready("read_only"),
        Failure::BeingStopped { .. } => return not_ready("being_stopped"),
        Failure::Halted { .. } => return not_ready("halted"),
        Failure::Port(error) => error.kind,
        Failure::Closed | Failure::Forked => PortErrorKind::Closed,
        _ if matches!(class, Class::Port) => PortErrorKind::Lost,
        _ => return class.raise(message, details),
    };
    class.raise(message, |keywords| {
        details(keywords)?;
        keywords.set_item("errno", number_of(kind))
    })
}
