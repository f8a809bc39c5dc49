//! Why values, settings and bits were not written to a unit: of which kind that is, and whether the unit may have taken some.

use drivebus_drive::{NotGiven, NotKept, NotPrepared, NotSetBits, WhyNotKept};
use drivebus_line::ErrorKind;

use crate::error::Error;

impl From<NotKept<Self>> for Error {
    /// Of the kind of what failed, also where the unit took others before.
    fn from(error: NotKept<Self>) -> Self {
        let (message, is_half_done) = (error.to_string(), error.parts > 0);
        let cause = Self::from(*error.why);
        let (kind, has_acted) = (cause.kind(), is_half_done || cause.may_have_acted());
        cause.retold(kind, message).having_acted(has_acted)
    }
}

impl From<WhyNotKept<Self>> for Error {
    fn from(why: WhyNotKept<Self>) -> Self {
        let message = why.to_string();
        let (cause, has_acted) = match why {
            WhyNotKept::NotSettled(why) => (why.into(), false),
            WhyNotKept::Failed(error) => (error, false),
            WhyNotKept::NotWritten { why, in_force, .. } => {
                let cause = Self::from(why);
                // Of several that shared a request which was refused, it may have taken some.
                let has_acted = in_force.is_some() || cause.may_have_acted();
                (cause, has_acted)
            }
            // It has the values, whatever came of storing them.
            WhyNotKept::NotStored { .. } => (Self::of(ErrorKind::Unconfirmed, &message), true),
            why => (Self::not_allowed(why), false),
        };
        let kind = cause.kind();
        cause.retold(kind, message).having_acted(has_acted)
    }
}

impl From<NotPrepared<Self>> for Error {
    fn from(why: NotPrepared<Self>) -> Self {
        let message = why.to_string();
        match why {
            NotPrepared::Failed(error) => error.having_acted(false),
            NotPrepared::NotKept(why) => why.into(),
            NotPrepared::Unread(error) => error.retold(ErrorKind::Unconfirmed, message).having_acted(true),
            NotPrepared::Unshown(_) => Self::of(ErrorKind::Unconfirmed, message).having_acted(true),
            _ => Self::not_allowed(message),
        }
    }
}

impl From<NotGiven<Self>> for Error {
    fn from(why: NotGiven<Self>) -> Self {
        match why {
            NotGiven::Failed(error) => error.having_acted(false),
            NotGiven::NotKept(why) => Self::from(*why),
            why => Self::not_allowed(why),
        }
    }
}

impl From<NotSetBits<Self>> for Error {
    fn from(why: NotSetBits<Self>) -> Self {
        match why {
            NotSetBits::Failed(error) => error.having_acted(false),
            NotSetBits::NotReady(why) => why.into(),
            NotSetBits::NotCommanded(why) => (*why).into(),
            NotSetBits::NotWritten(why) => why.into(),
            why => Self::not_allowed(why),
        }
    }
}
