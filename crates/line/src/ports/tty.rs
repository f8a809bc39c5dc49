//! A serial port of this machine: `/dev/ttyUSB0`, `COM3`, or the pseudo-terminal of a simulator.
//!
//! Built on the crate `serial2`. `serialport` was looked at beside it: it is MPL-2.0 where this project is MIT or
//! Apache-2.0 (`serial2` is BSD-2-Clause or Apache-2.0), it has no RS-485 mode of the kernel, and it does its own
//! reading and writing with time-outs in milliseconds, where a silence here is counted in microseconds. `serial2` gives
//! out the descriptor, takes any baud rate, and reads back what the driver made of the settings.

mod adapter;
mod low_latency;
#[cfg(not(unix))]
mod plain;
#[cfg(unix)]
mod posix;
#[cfg(unix)]
mod settings;
mod speed;
mod transceiver;

use std::io;
use std::path::Path;

use drivebus_rtu::{DataBits, Duration, Instant, Parity, SerialFormat, StopBits};
use serial2::SerialPort;

#[cfg(not(unix))]
use plain as system;
#[cfg(unix)]
use posix as system;

pub use adapter::Adapter;

use crate::line::{Line, PortError, PortErrorKind};
use crate::ports::adapters::holder;
use crate::ports::adapters::identity::{DeviceNumber, Places};
use crate::ports::adapters::latency::LatencyTimer;
use crate::ports::rs485::{self, InForce, Rs485, Wire};
use crate::system::clock::{monotonic, sleep_until};
use crate::system::inherited::Kept;
use crate::system::process::Process;
use transceiver::Transmission;

/// How long a driver may take no byte of what it is given before the port counts as lost.
///
/// Frames are far smaller than any driver's buffer, so this is reached only when nothing moves any more.
const STALL: Duration = Duration::from_millis(80);

/// What can be asked of a serial port beside its format.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct TtyOptions {
    /// Direction control by the driver; `None` leaves the driver as it is.
    pub rs485: Option<Rs485>,
    /// Whether other programs are kept out. Two masters on one line corrupt each other's frames.
    pub exclusive: bool,
    /// Whether an adapter that keeps what it received for a while is told to keep it as short as it can, until the port is
    /// closed. Linux and FTDI's chips, from 16 ms to 1 ms.
    pub low_latency: bool,
}

impl Default for TtyOptions {
    /// No direction control, the port to ourselves, and as little delay as can be had.
    fn default() -> Self {
        Self { rs485: None, exclusive: true, low_latency: true }
    }
}

impl TtyOptions {
    /// Sets [`rs485`](Self#structfield.rs485).
    #[must_use]
    pub fn rs485(self, rs485: impl Into<Option<Rs485>>) -> Self {
        Self { rs485: rs485.into(), ..self }
    }

    /// Sets [`exclusive`](Self#structfield.exclusive).
    #[must_use]
    pub fn exclusive(self, exclusive: bool) -> Self {
        Self { exclusive, ..self }
    }

    /// Sets [`low_latency`](Self#structfield.low_latency).
    #[must_use]
    pub fn low_latency(self, low_latency: bool) -> Self {
        Self { low_latency, ..self }
    }
}

/// An open serial port.
#[derive(Debug)]
pub struct Tty {
    port: Kept<SerialPort>,
    name: String,
    format: SerialFormat,
    /// Who switches the direction, and how long that takes: it belongs to the time a frame takes.
    direction: InForce,
    latency: LatencyTimer,
    /// When the last character handed over will have left the wire.
    wire_free: Instant,
    exclusive: bool,
    opened_by: Process,
    notes: Vec<String>,
    /// As the driver has them; `None` where it does not tell.
    settings: Option<system::Settings>,
    /// What was set again and nobody has asked for yet.
    set_again: Option<String>,
}

impl Tty {
    /// Opens `path`, locks it, sets `format`, and discards what the driver has queued.
    ///
    /// A pseudo-terminal carries bytes and no bits: parity and seven data bits cannot be set on it. It is opened all
    /// the same, keeps the timing of `format`, and [`notes`](Line::notes) says so.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::NotFound`], [`Denied`](PortErrorKind::Denied), [`Busy`](PortErrorKind::Busy) when another
    /// program holds the lock, [`Unsupported`](PortErrorKind::Unsupported) when it is no serial port or its driver
    /// does not take the format or the RS-485 mode.
    pub fn open(path: &str, format: &SerialFormat, options: &TtyOptions) -> Result<Self, PortError> {
        Self::open_within(path, format, options, &Places::default())
    }

    /// As [`open`](Self::open), with what is known of adapters looked up in `places`.
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open).
    pub fn open_within(
        path: &str,
        format: &SerialFormat,
        options: &TtyOptions,
        places: &Places,
    ) -> Result<Self, PortError> {
        let port = Kept::opened(|| system::open(path)).map_err(|error| open_error(path, &error))?;
        let pseudo_terminal = system::is_pseudo_terminal(&port, path);
        if options.exclusive {
            system::lock(&port, pseudo_terminal).map_err(|error| open_error(path, &error))?;
        }
        // Whatever fails from here on, dropping this unlocks the port.
        let mut tty = Self {
            port,
            name: path.to_owned(),
            format: *format,
            direction: InForce::default(),
            latency: LatencyTimer::default(),
            wire_free: Instant::ZERO,
            exclusive: options.exclusive,
            opened_by: Process::current(),
            notes: Vec::new(),
            settings: None,
            set_again: None,
        };
        let (mut parity, mut data_bits) = (format.parity(), format.data_bits());
        if pseudo_terminal {
            if parity != Parity::None {
                tty.notes.push(format!("parity is not on the wire: {path} is a pseudo-terminal; timed as {format}"));
                parity = Parity::None;
            }
            if data_bits != DataBits::Eight {
                tty.notes.push(format!("eight data bits, not seven: {path} is a pseudo-terminal; timed as {format}"));
                data_bits = DataBits::Eight;
            }
        }
        let configured = configure(&mut tty.port, format, parity, data_bits);
        let made = speed::made(&tty.port);
        configured.map_err(|error| format_error(path, format, made, &error))?;
        tty.notes.extend(made.and_then(|made| speed::note(format.baud_rate(), made)));
        tty.direction = match options.rs485 {
            Some(rs485) => rs485.apply(&*tty.port, path)?,
            None => rs485::found(&*tty.port),
        };
        tty.notes.extend(tty.direction.note.take());
        if options.low_latency
            && let Some(entry) = tty.device_number().and_then(|number| places.entry_of(number))
        {
            tty.latency = LatencyTimer::lower(&entry, &*tty.port);
            tty.notes.extend(tty.latency.note().map(str::to_owned));
        }
        tty.port.discard_buffers().map_err(|error| open_error(path, &error))?;
        tty.settings = system::Settings::of(&tty.port);
        Ok(tty)
    }

    /// The number the system gives this port for as long as it is open.
    pub(crate) fn device_number(&self) -> Option<DeviceNumber> {
        system::device_number(&self.port)
    }

    /// Whether it is the user's side of a pseudo-terminal.
    pub(crate) fn is_pseudo_terminal(&self) -> bool {
        system::is_pseudo_terminal(&self.port, &self.name)
    }

    /// Whether another program had changed the settings, which are set again.
    fn was_changed(&mut self) -> bool {
        let told = self.settings.as_mut().and_then(|settings| settings.set_again(&self.port));
        let is_news = told.is_some();
        self.set_again = told.or_else(|| self.set_again.take());
        is_news
    }

    fn lost(&mut self, error: &io::Error) -> PortError {
        self.was_changed();
        let changed = self.set_again.take().map_or_else(String::new, |told| format!("; {told}"));
        let message = format!(
            "the port is gone ({error}); plug the adapter in again; a bus opens the port again at its next call{changed}"
        );
        PortError::new(PortErrorKind::Lost, &self.name, message)
    }
}

impl Line for Tty {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut transmission = Transmission {
            port: &mut self.port,
            format: self.format,
            wire_free: self.wire_free,
            delay_before: self.direction.driver_before,
        };
        let sent = match self.direction.by_program {
            Some(by_program) => by_program.send(&mut transmission, bytes),
            None => transmission.write(bytes),
        };
        self.wire_free = sent.map_err(|error| self.lost(&error))?;
        Ok(self.wire_free)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        loop {
            match system::receive(&mut self.port, buffer, until) {
                // A port of which somebody said that a read shall not wait (VMIN 0) seems to have ended, too.
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof && self.was_changed() => {}
                received => return received.map_err(|error| self.lost(&error)),
            }
        }
    }

    fn sleep(&mut self, until: Instant) {
        sleep_until(until);
    }

    /// None of an adapter that collects what it receives: what it hands over first may be all there is.
    fn char_time(&self) -> Option<Duration> {
        self.latency.latency().is_zero().then(|| self.format.chars(1))
    }

    fn name(&self) -> String {
        self.name.clone()
    }

    /// Also behind a pseudo-terminal: the simulator's line has an adapter too.
    fn may_echo(&self) -> bool {
        true
    }

    fn latency(&self) -> Duration {
        self.latency.latency()
    }

    fn set_again(&mut self) -> Option<String> {
        self.was_changed();
        self.set_again.take()
    }

    fn notes(&self) -> Vec<String> {
        let changed = self.settings.as_ref().and_then(system::Settings::note);
        self.notes.iter().cloned().chain(changed).collect()
    }
}

impl Drop for Tty {
    fn drop(&mut self) {
        // A child that was forked shares the adapter with its parent, who still wants it fast.
        if self.opened_by.is_current() {
            self.latency.put_back(&*self.port);
        }
        // A child that ends must not take the lock from its parent.
        if self.exclusive && self.opened_by.is_current() {
            system::unlock(&self.port);
        }
    }
}

/// Raw mode and the line's format, read back.
fn configure(port: &mut SerialPort, format: &SerialFormat, parity: Parity, data_bits: DataBits) -> io::Result<()> {
    system::make_raw(port)?;
    // Setting a format waits for what is being sent, which may be another program's, to a peer that takes nothing.
    port.discard_buffers()?;
    let mut settings = port.get_configuration()?;
    settings.set_baud_rate(format.baud_rate())?;
    settings.set_char_size(match data_bits {
        DataBits::Seven => serial2::CharSize::Bits7,
        DataBits::Eight => serial2::CharSize::Bits8,
    });
    settings.set_parity(match parity {
        Parity::None => serial2::Parity::None,
        Parity::Even => serial2::Parity::Even,
        Parity::Odd => serial2::Parity::Odd,
    });
    settings.set_stop_bits(match format.stop_bits() {
        StopBits::One => serial2::StopBits::One,
        StopBits::Two => serial2::StopBits::Two,
    });
    settings.set_flow_control(serial2::FlowControl::None);
    port.set_configuration(&settings)
}

/// Why `path` did not open, and what to do about it.
fn open_error(path: &str, error: &io::Error) -> PortError {
    let kind = system::open_error_kind(error);
    let message = match kind {
        PortErrorKind::NotFound => format!("there is no such port; {}", present_ports()),
        PortErrorKind::Busy => holder::advice(Path::new(path)),
        PortErrorKind::Denied => format!(
            "this user may not open it ({error}); join the group that owns it, usually `sudo usermod -aG dialout \
             $USER`, and log in again"
        ),
        PortErrorKind::Unsupported => format!("it is not a serial port ({error}); {}", present_ports()),
        _ => format!("it does not open: {error}"),
    };
    PortError::new(kind, path, message)
}

/// Why the settings were refused: the port is no terminal, has no hardware, or does not know the format. `made` is the
/// speed that the driver is at now.
fn format_error(path: &str, format: &SerialFormat, made: Option<u32>, error: &io::Error) -> PortError {
    match system::open_error_kind(error) {
        PortErrorKind::Other => {
            let message = made
                .and_then(|made| speed::refusal(format.baud_rate(), made))
                .unwrap_or_else(|| format!("the driver does not take {format} ({error}); try another speed or format"));
            PortError::new(PortErrorKind::Unsupported, path, message)
        }
        _ => open_error(path, error),
    }
}

/// Which ports there are, for someone who mistyped one.
fn present_ports() -> String {
    let mut ports: Vec<String> =
        SerialPort::available_ports().unwrap_or_default().iter().map(|port| port.display().to_string()).collect();
    ports.sort();
    if ports.is_empty() {
        "this machine has no serial port now; is the adapter plugged in?".to_owned()
    } else {
        format!("this machine has {}", ports.join(", "))
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use rustix::io::Errno;

    #[test]
    fn what_the_system_says_becomes_a_kind_and_an_advice() {
        for (errno, kind, advice) in [
            (Errno::NOENT, PortErrorKind::NotFound, "no such port"),
            (Errno::NXIO, PortErrorKind::NotFound, "no such port"),
            (Errno::BUSY, PortErrorKind::Busy, "another program has it"),
            (Errno::WOULDBLOCK, PortErrorKind::Busy, "another program has it"),
            (Errno::ACCESS, PortErrorKind::Denied, "dialout"),
            (Errno::PERM, PortErrorKind::Denied, "dialout"),
            (Errno::NOTTY, PortErrorKind::Unsupported, "not a serial port"),
            (Errno::MFILE, PortErrorKind::Other, "does not open"),
        ] {
            let error = open_error("/dev/ttyX", &errno.into());
            assert_eq!(error.kind, kind, "{errno}");
            assert!(error.to_string().starts_with("/dev/ttyX: "), "{error}");
            assert!(error.to_string().contains(advice), "{error}");
            assert!(!error.to_string().contains("os error"), "{error}");
        }
    }

    #[test]
    fn a_refused_format_is_named() {
        let error = format_error("/dev/ttyX", &SerialFormat::DEFAULT, None, &Errno::INVAL.into());
        assert_eq!(error.kind, PortErrorKind::Unsupported);
        assert!(error.to_string().contains("19200 8E1"), "{error}");
        let error = format_error("/dev/ttyX", &SerialFormat::DEFAULT, Some(9_600), &io::Error::other("not all"));
        assert!(error.to_string().contains("9600"), "{error}");
    }
}
