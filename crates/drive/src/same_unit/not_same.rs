//! Why nothing is sent to a unit.

use thiserror::Error;

use super::Told;
use crate::contradiction::Contradiction;

/// Why what was to be sent to a unit must not be. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotSame<E> {
    /// The unit was not asked, or nobody knows whether it was.
    #[error("{0}")]
    Failed(E),
    /// What it says speaks against what it was named as.
    #[error("it was named otherwise: {0}")]
    Contradicts(Contradiction),
    /// The port was opened again, and the line failed when the unit was asked what it is.
    #[error("the port was opened again, and the unit has not identified itself since ({0})")]
    Unsaid(E),
    /// The port was opened again, and the unit refuses for the moment to say what it is.
    #[error("the port was opened again, and the unit has not identified itself since ({0})")]
    PutOff(Told),
    /// The port was opened again, and another unit answers since.
    #[error("another drive answers since the port was opened again: it told {before}, and tells {now} now")]
    Another {
        /// What was told before.
        before: Told,
        /// What is told now.
        now: Told,
    },
}
