//! RS-485 mode of a serial port: the driver switches the transceiver's direction by RTS.
//!
//! Most USB adapters switch by themselves and need none of this. Ports that are wired to a bare transceiver need it,
//! and the kernel does it at the right bit where a program would be late. Linux only (`TIOCSRS485`).

use serial2::SerialPort;

use crate::{PortError, PortErrorKind};

/// Longest delay that Linux drivers take, in milliseconds. Source: `RS485_MAX_RTS_DELAY` in the kernel.
pub const MAX_DELAY_MS: u32 = 100;

/// How the driver moves RTS around each transmission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rs485 {
    /// Whether the driver switches the direction at all; `false` turns off what another program turned on.
    pub enabled: bool,
    /// The level of RTS while sending: `true` is high, as almost every transceiver needs.
    pub rts_on_send: bool,
    /// From RTS to the first bit, 0..=100 ms.
    pub delay_before_ms: u32,
    /// From the last bit to RTS back, 0..=100 ms. A drive that answers earlier loses its first bytes.
    pub delay_after_ms: u32,
}

impl Default for Rs485 {
    /// Enabled, RTS high while sending, no delays.
    fn default() -> Self {
        Self { enabled: true, rts_on_send: true, delay_before_ms: 0, delay_after_ms: 0 }
    }
}

impl Rs485 {
    /// Asks the driver of `port`, called `name` for people, and checks what it took.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::Unsupported`]: a delay above 100 ms, a system or driver without this mode, or a driver that
    /// takes only part of it.
    pub(crate) fn apply(self, port: &SerialPort, name: &str) -> Result<(), PortError> {
        for (which, delay) in [("before", self.delay_before_ms), ("after", self.delay_after_ms)] {
            if delay > MAX_DELAY_MS {
                let message =
                    format!("the RS-485 delay {which} sending is {delay} ms; drivers take 0..={MAX_DELAY_MS} ms");
                return Err(PortError::new(PortErrorKind::Unsupported, name, message));
            }
        }
        self.ask(port).map_err(|reason| {
            let message = format!(
                "the driver does not do RS-485 direction control as asked ({reason}); leave the `rs485` option out if \
                 the adapter switches by itself, as most USB adapters do"
            );
            PortError::new(PortErrorKind::Unsupported, name, message)
        })
    }

    #[cfg(target_os = "linux")]
    fn ask(self, port: &SerialPort) -> Result<(), String> {
        use std::time::Duration;

        use serial2::rs4xx::{Rs485Config, TransceiverMode};

        let mode = if self.enabled {
            let mut config = Rs485Config::new();
            config.set_invert_rts(!self.rts_on_send);
            config.set_delay_before_send(Duration::from_millis(self.delay_before_ms.into()));
            config.set_delay_after_send(Duration::from_millis(self.delay_after_ms.into()));
            TransceiverMode::Rs485(config)
        } else {
            TransceiverMode::Default
        };
        port.set_rs4xx_mode(mode).map_err(|error| error.to_string())?;

        // Drivers drop what they cannot do without a word; a wrong RTS level keeps the line driven for ever.
        match port.get_rs4xx_mode().map_err(|error| error.to_string())? {
            TransceiverMode::Rs485(taken) if self.enabled => {
                let taken = Self {
                    enabled: true,
                    rts_on_send: !taken.get_invert_rts(),
                    delay_before_ms: u32::try_from(taken.get_delay_before_send().as_millis()).unwrap_or(u32::MAX),
                    delay_after_ms: u32::try_from(taken.get_delay_after_send().as_millis()).unwrap_or(u32::MAX),
                };
                if taken == self { Ok(()) } else { Err(format!("asked {self:?}, it took {taken:?}")) }
            }
            TransceiverMode::Default if !self.enabled => Ok(()),
            other => Err(format!("asked {self:?}, it took {other:?}")),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn ask(self, _port: &SerialPort) -> Result<(), String> {
        if self.enabled { Err("this system has no such mode; Linux has".to_owned()) } else { Ok(()) }
    }
}
