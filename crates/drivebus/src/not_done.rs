//! Why something was not done to a unit: of which kind that is, in the core's words, and whether the unit may have acted.

use drivebus_drive::{
    NotCommanded, NotHalted, NotReached, NotRead, NotReady, NotSame, NotSet, NotSettled, NotTaken, NotWritten, Why,
    WhyNotCommanded,
};
use drivebus_line::ErrorKind;

use crate::error::Error;

impl From<NotHalted<Self>> for Error {
    fn from(error: NotHalted<Self>) -> Self {
        let kind = match &error.why {
            Why::MayNot(_) | Why::Undecided { .. } | Why::SetOtherwise { .. } => ErrorKind::NotAllowed,
            Why::NotSent(line) | Why::Failed(line) => line.kind(),
            Why::Refused { .. } => ErrorKind::Refused,
            _ => ErrorKind::Unconfirmed,
        };
        Self::of(kind, &error).having_acted(error.was_sent)
    }
}

impl From<NotCommanded<Self>> for Error {
    fn from(error: NotCommanded<Self>) -> Self {
        // Whatever failed after the unit took a part may have failed after it took all.
        let is_half_done = error.parts > 0 && matches!(error.why, WhyNotCommanded::Failed(_));
        let has_acted = is_half_done || error.why.may_have_acted();
        let message = error.to_string();
        let (kind, cause) = match error.why {
            WhyNotCommanded::NotReady(why) => of_its_own_kind(why.into()),
            WhyNotCommanded::NotSet(why) => of_its_own_kind(why.into()),
            WhyNotCommanded::NotWritten(why) => of_its_own_kind(why.into()),
            WhyNotCommanded::HalfWritten(why) => (ErrorKind::Unconfirmed, why.into()),
            WhyNotCommanded::Failed(error) if is_half_done => (ErrorKind::Unconfirmed, error),
            WhyNotCommanded::Failed(error) | WhyNotCommanded::Halted(error) => of_its_own_kind(error),
            WhyNotCommanded::Unanswered { last, .. } | WhyNotCommanded::RefusedAndTurns { last, .. } => {
                (ErrorKind::Unconfirmed, last)
            }
            _ => (ErrorKind::Unconfirmed, Self::of(ErrorKind::Unconfirmed, "")),
        };
        cause.retold(kind, message).having_acted(has_acted)
    }
}

fn of_its_own_kind(cause: Error) -> (ErrorKind, Error) {
    (cause.kind(), cause)
}

impl From<NotReady<Self>> for Error {
    fn from(why: NotReady<Self>) -> Self {
        match why {
            NotReady::Failed(error) => error.having_acted(false),
            why => Self::not_allowed(why),
        }
    }
}

impl From<NotSet<Self>> for Error {
    fn from(why: NotSet<Self>) -> Self {
        match why {
            NotSet::Failed(error) => error.having_acted(false),
            NotSet::NotSettled(why) => why.into(),
            NotSet::NotWritten(why) => why.into(),
            why => Self::not_allowed(why),
        }
    }
}

impl From<NotSettled<Self>> for Error {
    fn from(why: NotSettled<Self>) -> Self {
        match why {
            NotSettled::Failed(error) => error.having_acted(false),
            why => Self::not_allowed(why),
        }
    }
}

impl From<NotReached<Self>> for Error {
    fn from(why: NotReached<Self>) -> Self {
        match why {
            NotReached::NotRead(NotRead::Failed(error)) => error.having_acted(false),
            NotReached::NotRead(NotRead::NotSettled(why)) => why.into(),
            NotReached::Tripped { .. } | NotReached::Late(_) => Self::of(ErrorKind::Unconfirmed, why),
            why => Self::not_allowed(why),
        }
    }
}

impl From<NotWritten<Self>> for Error {
    fn from(why: NotWritten<Self>) -> Self {
        let message = why.to_string();
        let cause = match why {
            NotWritten::Failed(error) => return error,
            NotWritten::NotSame(NotSame::Failed(error) | NotSame::Unsaid(error)) => error,
            NotWritten::Harm(NotTaken::NotTold(why)) => why.into(),
            why => Self::not_allowed(why),
        };
        let kind = cause.kind();
        cause.retold(kind, message).having_acted(false)
    }
}
