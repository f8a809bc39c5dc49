//! The halts of several units, side by side.

use drivebus_drive::task::Task;
use drivebus_drive::{self as drive, Families, Order};

use super::{Named, Work};
use crate::error::Error;

/// What came of each of several halts, in their order.
pub(crate) type Each = Vec<Result<(), Error>>;

impl Named {
    /// Halts `all` of these, which are on one line. What came of each, in their order.
    pub(crate) fn halt_all(all: Vec<Self>, order: Order) -> Work<Each> {
        Task::new(async move |line| {
            let halts = all.iter().map(|named| named.halt_by(&line, &order)).collect();
            let done = drive::halt_all(&line, Families::shipped(), halts).await;
            Ok(done.into_iter().map(|came| came.map_err(Error::from)).collect())
        })
    }
}
