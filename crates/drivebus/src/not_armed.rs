//! Why a drive's own time-out of the bus is not set: of which kind that is, and whether the unit may have some of it.

use drivebus_drive::{NotArmed, NotRead, WhyNotArmed};
use drivebus_line::ErrorKind;

use crate::error::Error;

impl From<NotArmed<Self>> for Error {
    /// Of the kind of what failed, also where the unit was given back what it had.
    fn from(error: NotArmed<Self>) -> Self {
        let (message, has_acted) = (error.to_string(), error.may_be_set());
        let cause = match *error.why {
            WhyNotArmed::Unread(why) | WhyNotArmed::Unshown(why) => unread(why),
            WhyNotArmed::NotKept(why) => why.into(),
            why => Self::of(ErrorKind::Unconfirmed, why),
        };
        let kind = cause.kind();
        cause.retold(kind, message).having_acted(has_acted)
    }
}

fn unread(why: NotRead<Error>) -> Error {
    match why {
        NotRead::Failed(error) => error,
        NotRead::NotSettled(why) => why.into(),
        why @ NotRead::Absent(_) => Error::of(ErrorKind::BadAnswer, why),
        why => Error::not_allowed(why),
    }
}
