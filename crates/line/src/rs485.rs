//! RS-485 mode of a serial port: who switches the transceiver's direction by RTS, and when.
//!
//! Most USB adapters switch by themselves and need none of this. Ports that are wired to a bare transceiver need it. The
//! kernel's driver does it at the right bit (Linux, `TIOCSRS485`). Where the driver has no such mode, RTS can be moved
//! from here, around each transmission: later than the bit, by as much as the system lets this program wait.

use std::io;

use drivebus_rtu::{Duration, Instant};

use crate::{PortError, PortErrorKind};

/// Longest delay that Linux drivers take, in milliseconds. Source: `RS485_MAX_RTS_DELAY` in the kernel.
pub const MAX_DELAY_MS: u32 = 100;

/// How long RTS is held after the computed end of a transmission where this program moves it, unless asked otherwise.
///
/// A USB adapter begins to send up to one USB frame, 1 ms, after it was given the bytes.
pub const RTS_MARGIN_MS: u32 = 1;

/// Who moves RTS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
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

/// The part of the settings that a driver takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Taken {
    pub(crate) rts_on_send: bool,
    pub(crate) before_ms: u32,
    pub(crate) after_ms: u32,
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
                    "the RS-485 delay {which} sending is {delay} ms; 0..={MAX_DELAY_MS} ms can be kept"
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
                return Err(format!("asked for {wanted:?}, it took {other:?}"));
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
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// A driver on paper: what it makes of what it is asked, and what RTS was told.
    struct Driver {
        make: fn(Taken) -> Option<Taken>,
        mode: RefCell<Option<Taken>>,
        rts: RefCell<Vec<bool>>,
        has: (bool, bool),
    }

    impl Driver {
        fn new(has_mode: bool, has_rts: bool, make: fn(Taken) -> Option<Taken>) -> Self {
            Self { make, mode: RefCell::default(), rts: RefCell::default(), has: (has_mode, has_rts) }
        }
    }

    impl Transceiver for Driver {
        fn ask(&self, wanted: Option<Taken>) -> io::Result<()> {
            if !self.has.0 {
                return Err(io::Error::other("no such mode"));
            }
            *self.mode.borrow_mut() = wanted.and_then(self.make);
            Ok(())
        }

        fn taken(&self) -> io::Result<Option<Taken>> {
            if self.has.0 { Ok(*self.mode.borrow()) } else { Err(io::Error::other("no such mode")) }
        }

        fn set_rts(&self, high: bool) -> io::Result<()> {
            if !self.has.1 {
                return Err(io::Error::other("no such line"));
            }
            self.rts.borrow_mut().push(high);
            Ok(())
        }
    }

    const ASKED: Rs485 =
        Rs485 { enabled: true, switch: Switch::Driver, rts_on_send: true, delay_before_ms: 2, delay_after_ms: 3 };

    #[test]
    fn a_driver_that_does_as_asked_leaves_nothing_to_say() {
        let driver = Driver::new(true, true, Some);
        let in_force = ASKED.apply(&driver, "port").unwrap();
        assert_eq!(in_force.driver_before, Duration::from_millis(2));
        assert_eq!((in_force.by_program, in_force.note), (None, None));
        assert!(driver.rts.borrow().is_empty(), "RTS is the driver's");
    }

    #[test]
    fn what_the_driver_made_of_the_delays_counts() {
        let driver = Driver::new(true, true, |asked| Some(Taken { before_ms: 1, after_ms: 0, ..asked }));
        let in_force = ASKED.apply(&driver, "port").unwrap();
        assert_eq!(in_force.driver_before, Duration::from_millis(1));
        let note = in_force.note.unwrap();
        assert!(note.contains("1 ms before and 0 ms after") && note.contains("asked for were 2 and 3 ms"), "{note}");
    }

    #[test]
    fn a_wrong_level_is_no_half_success() {
        let driver = Driver::new(true, true, |asked| Some(Taken { rts_on_send: false, ..asked }));
        let error = ASKED.apply(&driver, "port").unwrap_err();
        assert_eq!(error.kind, PortErrorKind::Unsupported);
        assert_eq!(*driver.mode.borrow(), None, "the driver is not left holding the line");
        // A driver that takes the request and does nothing.
        let driver = Driver::new(true, true, |_| None);
        assert!(ASKED.apply(&driver, "port").is_err());
    }

    #[test]
    fn without_the_mode_this_program_may_take_over() {
        let driver = Driver::new(false, true, Some);
        let error = ASKED.apply(&driver, "port").unwrap_err().to_string();
        assert!(error.contains("no such mode") && error.contains("mode \"rts\""), "{error}");

        let either = Rs485 { switch: Switch::Either, delay_after_ms: 0, ..ASKED };
        let in_force = either.apply(&driver, "port").unwrap();
        assert_eq!(*driver.rts.borrow(), [false], "the line is let go first");
        let by_program = in_force.by_program.unwrap();
        assert_eq!((by_program.before, by_program.after), (Duration::from_millis(2), Duration::from_millis(1)));
        assert!(in_force.note.unwrap().contains("no such mode"));

        let low = Rs485 { switch: Switch::Program, rts_on_send: false, ..ASKED };
        let in_force = low.apply(&driver, "port").unwrap();
        assert_eq!(*driver.rts.borrow(), [false, true]);
        assert_eq!((in_force.by_program.unwrap().after, in_force.note), (Duration::from_millis(3), None));
    }

    #[test]
    fn a_port_without_rts_is_refused() {
        let driver = Driver::new(false, false, Some);
        for switch in [Switch::Program, Switch::Either] {
            let error = Rs485 { switch, ..ASKED }.apply(&driver, "port").unwrap_err();
            assert_eq!(error.kind, PortErrorKind::Unsupported);
            assert!(error.to_string().contains("RTS cannot be moved (no such line)"), "{error}");
        }
    }

    #[test]
    fn turned_off_is_off_with_or_without_the_mode() {
        let off = Rs485 { enabled: false, ..ASKED };
        for has_mode in [true, false] {
            assert_eq!(off.apply(&Driver::new(has_mode, true, Some), "port").unwrap(), InForce::default());
        }
    }

    #[test]
    fn a_mode_that_nobody_here_asked_for_is_left_and_counted() {
        let driver = Driver::new(true, true, Some);
        assert_eq!(found(&driver), InForce::default());
        driver.ask(Some(Taken { rts_on_send: true, before_ms: 4, after_ms: 1 })).unwrap();
        let in_force = found(&driver);
        assert_eq!(in_force.driver_before, Duration::from_millis(4));
        assert!(in_force.note.unwrap().contains("4 ms before and 1 ms after"));
        assert!(driver.mode.borrow().is_some());
        assert_eq!(found(&Driver::new(false, true, Some)), InForce::default());
    }

    /// A wire that takes a millisecond for a byte, and a diary.
    #[derive(Default)]
    struct Paper {
        now: Instant,
        diary: Vec<(u64, String)>,
        breaks: bool,
    }

    impl Paper {
        fn note(&mut self, what: String) {
            let millis = self.now.saturating_duration_since(Instant::ZERO).as_millis();
            self.diary.push((u64::try_from(millis).unwrap(), what));
        }
    }

    impl Wire for Paper {
        fn now(&self) -> Instant {
            self.now
        }

        fn sleep_until(&mut self, until: Instant) {
            self.now = self.now.max(until);
        }

        fn set_rts(&mut self, high: bool) -> io::Result<()> {
            self.note(format!("rts {high}"));
            Ok(())
        }

        fn write(&mut self, bytes: &[u8]) -> io::Result<Instant> {
            self.note(format!("write {}", bytes.len()));
            if self.breaks {
                return Err(io::Error::other("unplugged"));
            }
            Ok(self.now + Duration::from_millis(u64::try_from(bytes.len()).unwrap()))
        }
    }

    #[test]
    fn rts_rises_before_the_first_bit_and_falls_after_the_last() {
        let (before, after) = (Duration::from_millis(2), Duration::from_millis(3));
        for rts_on_send in [true, false] {
            let mut wire = Paper::default();
            let end = ByProgram { rts_on_send, before, after }.send(&mut wire, &[0; 8]).unwrap();
            assert_eq!(end, Instant::ZERO + Duration::from_millis(10));
            let expected =
                [(0, format!("rts {rts_on_send}")), (2, "write 8".to_owned()), (13, format!("rts {}", !rts_on_send))];
            assert_eq!(wire.diary, expected);
        }
    }

    #[test]
    fn a_write_that_fails_lets_go_of_the_line() {
        let mut wire = Paper { breaks: true, ..Paper::default() };
        let by_program = ByProgram { rts_on_send: true, before: Duration::ZERO, after: Duration::from_millis(3) };
        assert!(by_program.send(&mut wire, &[0; 8]).is_err());
        assert_eq!(wire.diary.last().unwrap(), &(0, "rts false".to_owned()));
    }
}
