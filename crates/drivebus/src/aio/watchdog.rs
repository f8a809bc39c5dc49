//! A drive that acts by itself when it hears nothing, for who awaits.

use std::time::Duration;

use drivebus_drive::OnSilence;

use super::asked::Asked;
use super::drive::Drive;
use crate::error::Error;

/// A drive's own time-out of the bus, which is set until this is closed or dropped: as [`drivebus::Watchdog`](crate::Watchdog).
///
/// The thread that keeps the line busy is its own, so an executor that hangs does not make the drive act.
///
/// Dropped, also with a future that is dropped, it gives the drive back what it had in the thread that drops it, which waits
/// until that is done, as of an executor too. Await [`close`](Self::close) to keep the thread free.
///
/// ```
/// use std::time::Duration;
///
/// use drivebus::{OnSilence, Profile, aio};
///
/// # #[cfg(feature = "sim")]
/// # #[tokio::main(flavor = "current_thread")]
/// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let bus = aio::Bus::open("sim://gd350?clock=virtual").await?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?.unverified(); // its manual prints no time-out
/// let watchdog = drive.watchdog(Duration::from_secs(2), OnSilence::Coast).await?;
/// assert!(watchdog.armed());
/// watchdog.close().await?;
/// # Ok(())
/// # }
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// ```
#[derive(Debug)]
#[must_use = "the drive is given back what it had when this is dropped"]
pub struct Watchdog {
    drive: Drive,
    guard: crate::Watchdog,
}

impl Drive {
    /// As [`Drive::watchdog`](crate::Drive::watchdog). Where this future is dropped on its way, the drive is given back what it
    /// had, as by the guard.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::watchdog`](crate::Drive::watchdog).
    pub async fn watchdog(&self, timeout: Duration, action: OnSilence) -> Result<Watchdog, Error> {
        let guard = crate::Watchdog::before(self.blocking(), timeout, action)?;
        match self.bus().carry_out(guard.set()).await {
            Ok(()) => Ok(Watchdog { drive: self.clone(), guard: guard.keeping_busy()? }),
            Err(error) => Err(guard.left(error)),
        }
    }
}

impl Watchdog {
    /// As [`Watchdog::timeout`](crate::Watchdog::timeout).
    pub fn timeout(&self) -> Duration {
        self.guard.timeout()
    }

    /// As [`Watchdog::action`](crate::Watchdog::action).
    pub fn action(&self) -> OnSilence {
        self.guard.action()
    }

    /// As [`Watchdog::armed`](crate::Watchdog::armed).
    pub fn armed(&self) -> bool {
        self.guard.armed()
    }

    /// As [`Watchdog::error`](crate::Watchdog::error).
    pub fn error(&self) -> Option<Error> {
        self.guard.error()
    }

    /// As [`Watchdog::close`](crate::Watchdog::close). Where this future is dropped, the drive is given back what it had as
    /// where this is dropped.
    ///
    /// # Errors
    ///
    /// Those of [`Watchdog::close`](crate::Watchdog::close).
    pub async fn close(self) -> Result<(), Error> {
        let Self { drive, guard } = self;
        let ended = drive.bus().carry_out(guard.end()).await;
        // Its thread may be in the middle of a question.
        let left = Asked::apart(move |_| {
            guard.leave();
            Ok(())
        });
        left.await.and(ended)
    }
}
