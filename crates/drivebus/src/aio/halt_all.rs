//! Several drives of one line are halted side by side, for who awaits.

use super::bus::Bus;
use super::drive::Drive;
use crate::halt_all::{NotAllHalted, Told};
use crate::halting::Halting;

impl Bus {
    /// Halts `drives` of this line side by side, and proves each: as [`Bus::halt_all`](crate::Bus::halt_all). Where this
    /// future is dropped, nobody is told any more, and nothing is proved.
    ///
    /// ```
    /// use drivebus::{Halting, Profile, aio};
    ///
    /// # #[cfg(feature = "sim")]
    /// # #[tokio::main(flavor = "current_thread")]
    /// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let bus = aio::Bus::open("sim://1=gd350,2=acs355?clock=virtual").await?;
    /// let first = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// let second = bus.drive(2, &Profile::builtin("acs355")?)?;
    /// bus.halt_all([&first, &second], &Halting::stop()).await?;
    /// # Ok(())
    /// # }
    /// # #[cfg(not(feature = "sim"))]
    /// # fn main() {}
    /// ```
    ///
    /// # Errors
    ///
    /// [`NotAllHalted`], as [`Bus::halt_all`](crate::Bus::halt_all) has it.
    pub async fn halt_all(
        &self,
        drives: impl IntoIterator<Item = &Drive>,
        halting: &Halting,
    ) -> Result<(), NotAllHalted> {
        let (told, work) = Told::of(self.blocking(), drives.into_iter().map(Drive::blocking), halting);
        let came = match work {
            Ok(work) => self.carry_out(work).await,
            Err(error) => Err(error),
        };
        told.came_to(came)
    }
}
