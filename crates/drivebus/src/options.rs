//! What one call wants otherwise than its bus.

use std::time::Duration;

use drivebus_line::CallOptions as LineOptions;
use drivebus_rtu::Request;

use crate::checks;
use crate::error::Error;

/// What one call wants otherwise than its bus; what is not said stays as the bus has it.
///
/// ```
/// use drivebus::{Bus, CallOptions};
///
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// bus.write_with(1, 0x2000, 5, CallOptions::new().urgent())?; // a stop overtakes all who wait
/// let state = bus.read_with(1, 0x2100, 1, CallOptions::new().urgent().verify())?;
/// assert_eq!(state, [3]); // stopped
/// # Ok::<(), drivebus::Error>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CallOptions {
    timeout: Option<Duration>,
    retries: Option<u32>,
    urgent: bool,
    verify: bool,
    read_back: Option<u16>,
    connection: Option<u64>,
    halts: Option<u64>,
}

impl CallOptions {
    /// Options that leave everything as the bus has it.
    pub fn new() -> Self {
        Self::default()
    }

    /// The longest wait for the answer to each request. A call may take longer: after an answer was lost, the unit is asked for
    /// an echo, or for another number of words, before anything is asked again, so that a late answer is never taken for
    /// the new one.
    #[must_use]
    pub fn timeout(self, timeout: Duration) -> Self {
        Self { timeout: Some(timeout), ..self }
    }

    /// How often a read is asked once more, 0..=100.
    #[must_use]
    pub fn retries(self, retries: u32) -> Self {
        Self { retries: Some(retries), ..self }
    }

    /// The call overtakes all who wait: for a stop, and for confirming it.
    ///
    /// An urgent write goes out at once also where the unit may still owe another answer, for a drive may hear a stop
    /// although nothing is heard of it. Its confirmation may belong to the very same write, sent before.
    #[must_use]
    pub fn urgent(self) -> Self {
        Self { urgent: true, ..self }
    }

    /// A read is asked until the same words came twice in a row: against noise that happens to match its CRC, as one
    /// damaged answer in 65 536 does.
    #[must_use]
    pub fn verify(self) -> Self {
        Self { verify: true, ..self }
    }

    /// The address at which the words of a write can be read. A confirmation that is missing is looked for there, and the
    /// write is repeated only while the unit shows other words.
    ///
    /// That is for absolute values such as a setpoint; what a command did, nobody can read back.
    #[must_use]
    pub fn read_back(self, address: u16) -> Self {
        Self { read_back: Some(address), ..self }
    }

    /// Sends nothing where the port was opened again since you saw who answers: another unit may have the address now.
    /// `reconnects` is the [count](drivebus_line::Stats::reconnects) of that moment.
    #[must_use]
    pub fn connection(self, reconnects: u64) -> Self {
        Self { connection: Some(reconnects), ..self }
    }

    /// Sends nothing where the unit was told to halt since you decided on this call, by any [urgent](Self::urgent) write over
    /// this line, of this program or another: `halts` is [`Bus::halts`](crate::Bus::halts) of that moment. Without it, a start
    /// that waits for its turn goes out behind a stop that overtakes it.
    ///
    /// ```
    /// use drivebus::{Bus, CallOptions};
    ///
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let decided = bus.halts(1)?;
    /// bus.write_with(1, 0x2000, 5, CallOptions::new().urgent())?; // somebody stops it
    /// let start = bus.write_with(1, 0x2000, 1, CallOptions::new().halts(decided));
    /// assert!(!start.unwrap_err().may_have_acted());
    /// # Ok::<(), drivebus::Error>(())
    /// ```
    #[must_use]
    pub fn halts(self, halts: u64) -> Self {
        Self { halts: Some(halts), ..self }
    }

    /// As the line takes it, for `request`.
    pub(crate) fn of(self, request: &Request<'_>) -> Result<LineOptions, Error> {
        self.timeout.map_or(Ok(()), checks::timeout)?;
        self.retries.map_or(Ok(()), |retries| checks::within("retries", retries, 0, 100))?;
        let options = LineOptions::new().timeout(self.timeout).retries(self.retries).verify(self.verify);
        let options = options.read_back(self.read_back).connection(self.connection).halts(self.halts);
        Ok(if self.urgent { options.urgent(request) } else { options })
    }
}
