//! The words of a read plan, asked for one span after the other.

use std::time::Duration;

use drivebus_drives::ReadPlan;
use drivebus_rtu::UnitAddress;

use crate::task::{Mailbox, Read};

/// The words that all reads of a plan brought, one behind the other, and when, in Unix time.
#[derive(Debug, Default)]
pub(crate) struct Came {
    pub(crate) words: Vec<u16>,
    /// When the first was asked for; zero where nothing was.
    pub(crate) asked: Duration,
    /// When the last answer was complete.
    pub(crate) answered: Duration,
}

/// Reads all of `plan`, before all who wait for the line where that `is_urgent`; nothing where there is none.
pub(crate) async fn read_planned<E>(
    plan: Option<&ReadPlan>,
    line: &Mailbox<E>,
    unit: UnitAddress,
    is_urgent: bool,
) -> Result<Came, E> {
    let mut came = Came::default();
    let mut asked = None;
    for span in plan.into_iter().flat_map(ReadPlan::reads) {
        let read = Read::words(unit, span.place(), span.count).urgent(is_urgent);
        let stamped = line.read_stamped(read).await?;
        came.asked = *asked.get_or_insert(stamped.asked);
        came.answered = stamped.answered;
        came.words.extend(stamped.words);
    }
    Ok(came)
}
