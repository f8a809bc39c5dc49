//! A motor that runs, for who awaits.

use std::ops::Deref;

use drivebus_drive::Start;

use super::drive::Drive;
use crate::error::Error;

/// A motor that runs, and is stopped when this is dropped: as [`drivebus::Running`](crate::Running). It is its [`Drive`] as
/// well.
///
/// Dropped, also with a future that is dropped, it stops the motor in the thread that drops it, which waits until that is
/// proved, as of an executor too: nothing can be awaited any more there, and a thread beside it might end with the program
/// before the stop was sent. Await [`stop`](Self::stop) to keep the thread free.
///
/// ```
/// use drivebus::{Profile, aio};
///
/// # #[cfg(feature = "sim")]
/// # #[tokio::main(flavor = "current_thread")]
/// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let bus = aio::Bus::open("sim://gd350?clock=virtual").await?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
/// drive.prepare().await?;
/// let running = drive.running(10.0).await?;
/// println!("{}", running.status().await?);
/// running.stop().await?;
/// # Ok(())
/// # }
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// ```
#[derive(Debug)]
#[must_use = "the motor is stopped when this is dropped"]
pub struct Running {
    drive: Drive,
    guard: crate::Running,
}

impl Drive {
    /// As [`Drive::running`](crate::Drive::running). Where this future is dropped while it starts the motor, the motor is
    /// stopped as by the guard.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::running`](crate::Drive::running).
    pub async fn running(&self, hz: impl Into<Option<f64>>) -> Result<Running, Error> {
        self.running_with(&Start::run(false, hz.into())).await
    }

    /// As [`Drive::running_with`](crate::Drive::running_with).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::running`](crate::Drive::running).
    pub async fn running_with(&self, start: &Start) -> Result<Running, Error> {
        let running = Running::before(self, start);
        match self.run_with(start).await {
            Ok(()) => Ok(running),
            Err(error) if error.may_have_acted() => Err(crate::Running::after(error, running.stop().await)),
            Err(error) => {
                running.leave();
                Err(error)
            }
        }
    }
}

impl Running {
    fn before(drive: &Drive, start: &Start) -> Self {
        Self { drive: drive.clone(), guard: crate::Running::before(drive.blocking(), start) }
    }

    /// Stops the motor, and proves it. Where this future is dropped, the motor is stopped as where this is dropped.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::halt`](crate::Drive::halt): the motor may still turn. It is not told again when this is dropped.
    pub async fn stop(self) -> Result<(), Error> {
        let end = self.guard.named().end(self.guard.end_command());
        let ended = self.drive.bus().carry_out(end).await;
        self.leave();
        ended
    }

    /// Lets the motor do what it does.
    fn leave(self) {
        self.guard.leave();
    }
}

impl Deref for Running {
    type Target = Drive;

    fn deref(&self) -> &Drive {
        &self.drive
    }
}
