//! Waiting until a motor has its speed, or stands, for who awaits.

use std::time::Duration;

use super::drive::Drive;
use crate::error::Error;
use crate::status::Status;

impl Drive {
    /// As [`Drive::wait_for_speed`](crate::Drive::wait_for_speed). Where this future is dropped, nobody looks any more.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::wait_for_speed`](crate::Drive::wait_for_speed).
    pub async fn wait_for_speed(
        &self,
        hz: impl Into<Option<f64>>,
        tolerance: f64,
        within: Duration,
    ) -> Result<Status, Error> {
        self.bus().carry_out(self.blocking().named().wait_for_speed(hz.into(), tolerance, within)?).await
    }

    /// As [`Drive::wait_until_stopped`](crate::Drive::wait_until_stopped). Where this future is dropped, nobody looks any
    /// more.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::wait_for_speed`](crate::Drive::wait_for_speed).
    pub async fn wait_until_stopped(&self, within: Duration) -> Result<Status, Error> {
        self.bus().carry_out(self.blocking().named().wait_until_stopped(within)?).await
    }
}
