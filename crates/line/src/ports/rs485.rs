//! RS-485 mode of a serial port: who switches the transceiver's direction by RTS, and when.
//!
//! Most USB adapters switch by themselves and need none of this. Ports that are wired to a bare transceiver need it. The
//! kernel's driver does it at the right bit (Linux, `TIOCSRS485`). Where the driver has no such mode, RTS can be moved
//! from here, around each transmission: later than the bit, by as much as the system lets this program wait.

use std::io;

use drivebus_rtu::{Duration, Instant};

use crate::line::{PortError, PortErrorKind};

/// Longest delay that Linux drivers take, in milliseconds. Source: `RS485_MAX_RTS_DELAY` in the kernel.
pub const MAX_DELAY_MS: u32 = 100;

/// How long RTS is held after the computed end of a transmission where this program moves it, unless asked otherwise.
///
/// A USB adapter begins to send up to one USB frame, 1 ms, after it was given the bytes.
pub const RTS_MARGIN_MS: u32 = 1;

/// Who moves RTS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Switch {
    /// The driver, at the right bit; an error where it cannot.
    #[default]
    Driver,
    /// This program, before and after it sends.
    Program,
    /// The driver; where it cannot, this program, and a note says so.
    Either,
}

/// How RTS moves around each transmission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Rs485 {
    /// Whether the direction is switched at all; `false` turns off what another program turned on.
    pub enabled: bool,
    /// Who does it.
    pub switch: Switch,
    /// The level of RTS while sending: `true` is high, as almost every transceiver needs.
    pub rts_on_send: bool,
    /// From RTS to the first bit, 0..=100 ms.
    pub delay_before_ms: u32,
    /// From the last bit to RTS back, 0..=100 ms. A drive that answers earlier loses its first bytes.
    pub delay_after_ms: u32,
}

impl Default for Rs485 {
    /// By the driver, RTS high while sending, no delays.
    fn default() -> Self {
        Self { enabled: true, switch: Switch::Driver, rts_on_send: true, delay_before_ms: 0, delay_after_ms: 0 }
    }
}

impl Rs485 {
    /// Sets [`enabled`](Self#structfield.enabled).
    #[must_use]
    pub fn enabled(self, enabled: bool) -> Self {
        Self { enabled, ..self }
    }

    /// Sets [`switch`](Self#structfield.switch).
    #[must_use]
    pub fn switch(self, switch: Switch) -> Self {
        Self { switch, ..self }
    }

    /// Sets [`rts_on_send`](Self#structfield.rts_on_send).
    #[must_use]
    pub fn rts_on_send(self, rts_on_send: bool) -> Self {
        Self { rts_on_send, ..self }
    }

    /// Sets [`delay_before_ms`](Self#structfield.delay_before_ms).
    #[must_use]
    pub fn delay_before_ms(self, delay_before_ms: u32) -> Self {
        Self { delay_before_ms, ..self }
    }

    /// Sets [`delay_after_ms`](Self#structfield.delay_after_ms).
    #[must_use]
    pub fn delay_after_ms(self, delay_after_ms: u32) -> Self {
        Self { delay_after_ms, ..self }
    }
}

/// The part of the settings that a driver takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Taken {
    pub(crate) rts_on_send: bool,
    pub(crate) before_ms: u32,
    pub(crate) after_ms: u32,
}

impl Taken {
    fn in_words(self) -> String {
        let level = if self.rts_on_send { "high" } else { "low" };
        format!("RTS {level} while sending, {} ms before and {} ms after", self.before_ms, self.after_ms)
    }
}

/// What a port offers for this; a test has one of its own.
pub(crate) trait Transceiver {
    /// Asks the driver to switch as told, or (`None`) not to.
    fn ask(&self, wanted: Option<Taken>) -> io::Result<()>;

    /// What the driver made of it; `None`: it does not switch.
    fn taken(&self) -> io::Result<Option<Taken>>;

    /// Moves RTS now.
    fn set_rts(&self, high: bool) -> io::Result<()>;
}

/// What came of it.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct InForce {
    /// What this program has to do around each transmission.
    pub(crate) by_program: Option<ByProgram>,
    /// How long the driver waits between RTS and the first bit; what this program waits is not in it.
    pub(crate) driver_before: Duration,
    pub(crate) note: Option<String>,
}

impl Rs485 {
    /// Asks for it at `port`, called `name` for people, and checks what the driver took.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::Unsupported`]: a delay above 100 ms; a system or driver without this mode, or one that drives the
    /// line at the wrong level; a port without RTS.
    pub(crate) fn apply(self, port: &dyn Transceiver, name: &str) -> Result<InForce, PortError> {
        let unsupported = |message| PortError::new(PortErrorKind::Unsupported, name, message);
        for (which, delay) in [("before", self.delay_before_ms), ("after", self.delay_after_ms)] {
            if delay > MAX_DELAY_MS {
                return Err(unsupported(format!(
                    "the RS-485 delay {which} sending is {delay} ms; 0 to {MAX_DELAY_MS} ms can be kept"
                )));
            }
        }
        if !self.enabled {
            // A driver without the mode has it off.
            return match port.ask(None).and_then(|()| port.taken()) {
                Ok(Some(_)) => Err(unsupported("the driver does not leave its RS-485 mode".to_owned())),
                Ok(None) | Err(_) => Ok(InForce::default()),
            };
        }
        let reason = match self.switch {
            Switch::Program => None,
            Switch::Driver | Switch::Either => match self.ask(port) {
                Ok(in_force) => return Ok(in_force),
                Err(reason) => Some(reason),
            },
        };
        match (self.switch, reason) {
            (Switch::Driver, Some(reason)) => Err(unsupported(format!(
                "the driver does not do RS-485 direction control as asked ({reason}); leave the `rs485` option out if \
                 the adapter switches by itself, as most USB adapters do, or ask for mode \"rts\" if its RTS is wired to \
                 the transceiver"
            ))),
            (_, reason) => self.take_over(port, reason).map_err(|error| {
                unsupported(format!(
                    "its RTS cannot be moved ({error}), so nothing here can switch the direction; leave the `rs485` \
                     option out if the adapter switches by itself"
                ))
            }),
        }
    }

    /// By the driver.
    fn ask(self, port: &dyn Transceiver) -> Result<InForce, String> {
        let wanted =
            Taken { rts_on_send: self.rts_on_send, before_ms: self.delay_before_ms, after_ms: self.delay_after_ms };
        port.ask(Some(wanted)).map_err(|error| error.to_string())?;
        // Drivers change what they cannot do without a word; a wrong RTS level keeps the line driven for ever.
        let taken = match port.taken().map_err(|error| error.to_string())? {
            Some(taken) if taken.rts_on_send == wanted.rts_on_send => taken,
            other => {
                let _ = port.ask(None);
                let took = other.map_or_else(|| "nothing".to_owned(), Taken::in_words);
                return Err(format!("asked for {}, it took {took}", wanted.in_words()));
            }
        };
        let note = (taken != wanted).then(|| {
            format!(
                "RS-485: the driver waits {} ms before and {} ms after sending; asked for were {} and {} ms",
                taken.before_ms, taken.after_ms, wanted.before_ms, wanted.after_ms
            )
        });
        Ok(InForce { by_program: None, driver_before: Duration::from_millis(taken.before_ms.into()), note })
    }

    /// By this program. `reason`: why the driver does not.
    fn take_over(self, port: &dyn Transceiver, reason: Option<String>) -> io::Result<InForce> {
        // Whatever mode another program left the driver in; most that come here have none.
        let _ = port.ask(None);
        port.set_rts(!self.rts_on_send)?;
        let after_ms = if reason.is_some() { self.delay_after_ms.max(RTS_MARGIN_MS) } else { self.delay_after_ms };
        let by_program = ByProgram {
            rts_on_send: self.rts_on_send,
            before: Duration::from_millis(self.delay_before_ms.into()),
            after: Duration::from_millis(after_ms.into()),
        };
        let note = reason.map(|reason| {
            format!(
                "RS-485: the driver does not switch the direction ({reason}); this program moves RTS, and holds it \
                 {after_ms} ms after the last bit: units that answer sooner lose their first bytes"
            )
        });
        Ok(InForce { by_program: Some(by_program), driver_before: Duration::ZERO, note })
    }
}

/// What the driver does unasked, because another program or the board's description said so; `port` is left as it is.
pub(crate) fn found(port: &dyn Transceiver) -> InForce {
    let Ok(Some(Taken { before_ms, after_ms, .. })) = port.taken() else { return InForce::default() };
    let note = format!(
        "RS-485: the driver switches the direction unasked, {before_ms} ms before and {after_ms} ms after sending"
    );
    InForce { by_program: None, driver_before: Duration::from_millis(before_ms.into()), note: Some(note) }
}

/// Direction control by this program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ByProgram {
    rts_on_send: bool,
    before: Duration,
    after: Duration,
}

/// What moving RTS around a transmission takes; a test has one that takes no time.
pub(crate) trait Wire {
    fn now(&self) -> Instant;
    fn sleep_until(&mut self, until: Instant);
    fn set_rts(&mut self, high: bool) -> io::Result<()>;

    /// Hands over the bytes, and returns when the last of them will have left.
    fn write(&mut self, bytes: &[u8]) -> io::Result<Instant>;
}

impl ByProgram {
    /// Sends `bytes` between raising and dropping RTS, and returns when the last of them has left.
    ///
    /// Blocks for as long as that takes: nothing else may come between the last bit and RTS.
    pub(crate) fn send(self, wire: &mut dyn Wire, bytes: &[u8]) -> io::Result<Instant> {
        wire.set_rts(self.rts_on_send)?;
        if !self.before.is_zero() {
            let until = wire.now() + self.before;
            wire.sleep_until(until);
        }
        let sent = wire.write(bytes);
        if let Ok(end) = sent {
            wire.sleep_until(end + self.after);
        }
        // A line that stays driven silences everybody, so this comes first, whatever became of the bytes.
        wire.set_rts(!self.rts_on_send)?;
        sent
    }
}

#[cfg(test)]
mod tests;
