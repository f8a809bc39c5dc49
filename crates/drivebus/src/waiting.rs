//! Waiting until a motor has its speed, or stands.

use std::time::Duration;

use crate::driving::Drive;
use crate::error::Error;
use crate::status::Status;

impl Drive {
    /// Waits until the motor runs at `hz`, 0 or more, or no more than `tolerance` Hz off it; `None` is the setpoint in force.
    /// Where the drive tells which way it turns, that is the way in which it was started last from here: a motor that is reversed runs
    /// through its new speed before it turns round. For `within` at most, 0 to 3600 s on the line's clock; 0 looks once.
    ///
    /// Only reads, every 20 ms: whatever comes of it, the motor goes on as it was. What the last look showed is returned.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use drivebus::{Bus, ErrorKind, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// drive.prepare()?;
    /// let running = drive.running(10.0)?; // it has begun to turn
    /// let status = running.wait_for_speed(None, 0.1, Duration::from_secs(30))?;
    /// assert!(status.hz.is_some_and(|hz| hz >= 9.9));
    /// running.stop()?;
    ///
    /// drive.wait_until_stopped(Duration::from_secs(30))?;
    /// let error = drive.wait_for_speed(10.0, 0.1, Duration::from_secs(1)).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Unconfirmed);
    /// let says = "speed of unit 1: the time is over, and it is stopped, 0.00 of 10.00";
    /// assert_eq!(error.to_string(), says);
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// The drive has not acted on it.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | a number is out of range, or the family does not tell its state or its speed, or not in Hz |
    /// | [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | the time is over, or the drive is in fault |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer), [`Refused`](crate::ErrorKind::Refused) | it could not be looked at |
    pub fn wait_for_speed(
        &self,
        hz: impl Into<Option<f64>>,
        tolerance: f64,
        within: Duration,
    ) -> Result<Status, Error> {
        self.bus().carry_out(self.named().wait_for_speed(hz.into(), tolerance, within)?)
    }

    /// Waits until the drive is at rest, and its output frequency is zero where it tells that. For `within` at most, 0 to
    /// 3600 s on the line's clock; 0 looks once. It stops nothing: as [`wait_for_speed`](Self::wait_for_speed).
    ///
    /// A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.
    ///
    /// # Errors
    ///
    /// Those of [`wait_for_speed`](Self::wait_for_speed).
    pub fn wait_until_stopped(&self, within: Duration) -> Result<Status, Error> {
        self.bus().carry_out(self.named().wait_until_stopped(within)?)
    }
}
