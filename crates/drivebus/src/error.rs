//! The one error of this crate: whose fault it is, in words, and whether the drive may have acted.

use std::fmt;

use drivebus_drives::{AccessError, NameError, ProfileError, ValueError};
use drivebus_line::url::{UnitError, UrlError};
use drivebus_line::{CallError, ErrorKind, Failure, PollError, WordError};
use drivebus_rtu::{RequestError, SerialFormatError};

/// Why something was not done, or is not known to be done.
///
/// Displays as one sentence: who was asked what, and what came instead.
///
/// | [`kind`](Self::kind) | did the drive take it? |
/// | --- | --- |
/// | [`NotAllowed`](ErrorKind::NotAllowed) | no: nothing was sent |
/// | [`Refused`](ErrorKind::Refused) | no: what it was doing before, it still does; only an acknowledgement (05H) is none |
/// | [`NoAnswer`](ErrorKind::NoAnswer) | it may have: it has not heard the request, or its answer was lost |
/// | [`BadAnswer`](ErrorKind::BadAnswer), [`Crc`](ErrorKind::Crc) | it may have: only its answer is known to be bad |
/// | [`Port`](ErrorKind::Port) | if the port was lost after the request had left, it may have |
/// | [`Unconfirmed`](ErrorKind::Unconfirmed) | nobody knows from here; the message names what it shows |
///
/// [`may_have_acted`](Self::may_have_acted) knows more than the kind: whether the request ever went out.
#[derive(Clone, PartialEq, Eq)]
pub struct Error {
    kind: ErrorKind,
    message: String,
    /// What is known of the call where there was one.
    call: Option<Box<CallError>>,
    /// Whether the unit may have done what was asked, where more is known of that than the call tells.
    has_acted: Option<bool>,
}

impl Error {
    /// Nothing was sent.
    pub(crate) fn not_allowed(why: impl fmt::Display) -> Self {
        Self::of(ErrorKind::NotAllowed, why)
    }

    /// An error of this kind, of no one call.
    pub(crate) fn of(kind: ErrorKind, why: impl fmt::Display) -> Self {
        Self { kind, message: why.to_string(), call: None, has_acted: None }
    }

    /// The same, of what was asked by several calls: whether the unit may have done it.
    pub(crate) fn having_acted(self, has_acted: bool) -> Self {
        Self { has_acted: Some(has_acted), ..self }
    }

    /// What it was the cause of, in the words of that.
    pub(crate) fn retold(self, kind: ErrorKind, message: String) -> Self {
        Self { kind, message, ..self }
    }

    /// The same, which says first what was asked, where no call says that.
    pub(crate) fn saying_first(self, what: impl fmt::Display) -> Self {
        if self.call.is_some() { self } else { Self { message: format!("{what}: {}", self.message), ..self } }
    }

    /// The same, which says last what came next.
    pub(crate) fn saying_last(self, what: impl fmt::Display) -> Self {
        Self { message: format!("{}. {what}", self.message), ..self }
    }

    /// What kind of failure it is, and so by whose fault.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// Whether the unit may have done what was asked: the request went out, and the unit did not refuse it.
    pub fn may_have_acted(&self) -> bool {
        self.has_acted.unwrap_or_else(|| self.call.as_ref().is_some_and(|call| call.may_have_acted()))
    }

    /// The unit's exception code, where it refused. What it means in this family, [`Profile::exception`] knows.
    ///
    /// [`Profile::exception`]: drivebus_drives::Profile::exception
    pub fn code(&self) -> Option<u8> {
        match self.call.as_ref()?.failure {
            Failure::Refused { code, .. } => Some(code.0),
            _ => None,
        }
    }

    /// The bytes that came instead of an answer, as they came.
    pub fn raw(&self) -> &[u8] {
        self.call.as_ref().map_or(&[], |call| &call.raw)
    }

    /// All that is known of the call: the request, when it went out, and why it failed.
    pub fn call(&self) -> Option<&CallError> {
        self.call.as_deref()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl fmt::Debug for Error {
    /// What `main` prints when it ends with an error is for people too.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.kind, self.message)
    }
}

/// Without a [`source`](std::error::Error::source): its sentence says all, and a chain would say it twice. What is known
/// beside it, [`call`](Error::call) has.
impl std::error::Error for Error {}

impl From<Box<CallError>> for Error {
    fn from(call: Box<CallError>) -> Self {
        let message = match call.failure {
            Failure::Refused { code, .. } => format!("{call} ({} by the specification)", code.standard_name()),
            _ => call.to_string(),
        };
        Self { kind: call.kind(), message, call: Some(call), has_acted: None }
    }
}

impl From<Failure> for Error {
    /// A failure outside any call: the port's, or the bus was closed.
    fn from(failure: Failure) -> Self {
        Self::of(failure.kind(), failure)
    }
}

impl From<PollError> for Error {
    fn from(error: PollError) -> Self {
        match error {
            PollError::Bus(failure) => failure.into(),
            other => Self::not_allowed(other),
        }
    }
}

macro_rules! not_allowed {
    ($($error:ty),*) => {
        $(impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::not_allowed(error)
            }
        })*
    };
}

not_allowed!(
    AccessError,
    NameError,
    ProfileError,
    RequestError,
    SerialFormatError,
    UnitError,
    UrlError,
    ValueError,
    WordError
);
#[cfg(feature = "sim")]
not_allowed!(drivebus_sim::SimError);
