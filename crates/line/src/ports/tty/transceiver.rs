//! The transceiver of a real port, as `serial2` reaches it: the driver's RS-485 mode and RTS.

use std::io;

use drivebus_rtu::{Duration, Instant, SerialFormat};
use serial2::SerialPort;

use super::{STALL, system};
use crate::ports::rs485::{Taken, Transceiver, Wire};
use crate::system::clock::{monotonic, sleep_until};

impl Transceiver for SerialPort {
    #[cfg(target_os = "linux")]
    fn ask(&self, wanted: Option<Taken>) -> io::Result<()> {
        use serial2::rs4xx::{Rs485Config, TransceiverMode};

        self.set_rs4xx_mode(wanted.map_or(TransceiverMode::Default, |wanted| {
            let mut config = Rs485Config::new();
            config.set_invert_rts(!wanted.rts_on_send);
            config.set_delay_before_send(Duration::from_millis(wanted.before_ms.into()));
            config.set_delay_after_send(Duration::from_millis(wanted.after_ms.into()));
            TransceiverMode::Rs485(config)
        }))
    }

    #[cfg(target_os = "linux")]
    fn taken(&self) -> io::Result<Option<Taken>> {
        use serial2::rs4xx::TransceiverMode;

        let millis = |time: Duration| u32::try_from(time.as_millis()).unwrap_or(u32::MAX);
        Ok(match self.get_rs4xx_mode()? {
            TransceiverMode::Rs485(config) => Some(Taken {
                rts_on_send: !config.get_invert_rts(),
                before_ms: millis(config.get_delay_before_send()),
                after_ms: millis(config.get_delay_after_send()),
            }),
            _ => None,
        })
    }

    #[cfg(not(target_os = "linux"))]
    fn ask(&self, wanted: Option<Taken>) -> io::Result<()> {
        match wanted {
            Some(_) => Err(io::Error::new(io::ErrorKind::Unsupported, "this system has no such mode; Linux has")),
            None => Ok(()),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn taken(&self) -> io::Result<Option<Taken>> {
        Ok(None)
    }

    fn set_rts(&self, high: bool) -> io::Result<()> {
        SerialPort::set_rts(self, high)
    }
}

/// One transmission of a real port.
pub(super) struct Transmission<'a> {
    pub(super) port: &'a mut SerialPort,
    pub(super) format: SerialFormat,
    /// When the last transmission will have left.
    pub(super) wire_free: Instant,
    /// From RTS to the first bit, where the driver waits that long.
    pub(super) delay_before: Duration,
}

impl Wire for Transmission<'_> {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn sleep_until(&mut self, until: Instant) {
        sleep_until(until);
    }

    fn set_rts(&mut self, high: bool) -> io::Result<()> {
        SerialPort::set_rts(self.port, high)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<Instant> {
        system::send(self.port, bytes, STALL)?;
        // Read after the write: the frame may have left later than it was handed over, never earlier.
        let starts = self.wire_free.max(monotonic()) + self.delay_before;
        Ok(starts + self.format.chars(u32::try_from(bytes.len()).unwrap_or(u32::MAX)))
    }
}
