//! How a bus is opened: what a program sets otherwise than it is usual.

use std::time::Duration;

use drivebus_line::url::{self, Known, PortOptions, PortUrl};
use drivebus_line::{AdapterEcho, Bus as Core, BusOptions, Opener, Share};
use drivebus_rtu::{DataBits, Parity, SerialFormat, Silence, StopBits};

use crate::bus::Bus;
use crate::checks;
use crate::error::Error;

/// How a bus is opened. What is not set stays as Modbus and the drives have it: 19 200 bit/s 8E1, half a second for an
/// answer, two retries of reads.
///
/// ```
/// use std::time::Duration;
///
/// use drivebus::{Bus, Parity};
///
/// let bus = Bus::builder()
///     .baudrate(9_600)
///     .parity(Parity::None)
///     .timeout(Duration::from_millis(300))
///     .read_only(true)
///     .open("sim://gd350?clock=virtual")?;
/// assert!(bus.write(1, 0x2000, 1).is_err(), "nothing was sent");
/// # Ok::<(), drivebus::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Builder {
    baudrate: u32,
    parity: Parity,
    stopbits: StopBits,
    bytesize: DataBits,
    silence: Silence,
    options: BusOptions,
    #[cfg(feature = "serial")]
    tty: drivebus_line::tty::TtyOptions,
}

impl Bus {
    /// Opens `port` with the usual settings: a path, or one of the URLs in the [crate's documentation](crate#ports).
    ///
    /// # Errors
    ///
    /// Those of [`Builder::open`].
    pub fn open(port: &str) -> Result<Self, Error> {
        Self::builder().open(port)
    }

    /// A builder for a bus with other settings than the usual ones. It opens nothing by itself.
    pub fn builder() -> Builder {
        Builder::default()
    }
}

impl Default for Builder {
    fn default() -> Self {
        let format = SerialFormat::DEFAULT;
        Self {
            baudrate: format.baud_rate(),
            parity: format.parity(),
            stopbits: format.stop_bits(),
            bytesize: format.data_bits(),
            silence: format.silence(),
            options: BusOptions::new(format),
            #[cfg(feature = "serial")]
            tty: drivebus_line::tty::TtyOptions::default(),
        }
    }
}

impl Builder {
    /// Bits per second, 50..=10 000 000; 19 200 if it is not set.
    #[must_use]
    pub fn baudrate(self, baudrate: u32) -> Self {
        Self { baudrate, ..self }
    }

    /// The parity bit; even if it is not set.
    #[must_use]
    pub fn parity(self, parity: Parity) -> Self {
        Self { parity, ..self }
    }

    /// Stop bits; one if it is not set.
    #[must_use]
    pub fn stopbits(self, stopbits: StopBits) -> Self {
        Self { stopbits, ..self }
    }

    /// Data bits; eight if it is not set.
    #[must_use]
    pub fn bytesize(self, bytesize: DataBits) -> Self {
        Self { bytesize, ..self }
    }

    /// The silence between frames; by the specification if it is not set.
    #[must_use]
    pub fn silence(self, silence: Silence) -> Self {
        Self { silence, ..self }
    }

    /// Sets baud rate, parity, bits and silence at once.
    #[must_use]
    pub fn format(self, format: SerialFormat) -> Self {
        self.baudrate(format.baud_rate())
            .parity(format.parity())
            .stopbits(format.stop_bits())
            .bytesize(format.data_bits())
            .silence(format.silence())
    }

    /// How long a unit is given to answer, an hour at most; half a second if it is not set.
    #[must_use]
    pub fn timeout(mut self, timeout: Duration) -> Self {
        self.options.timeout = timeout;
        self
    }

    /// How often a read is asked once more, 0..=100; twice if it is not set. A write is never.
    #[must_use]
    pub fn retries(mut self, retries: u32) -> Self {
        self.options.retries = retries;
        self
    }

    /// Whether whatever may change something in a unit is refused before it is sent.
    #[must_use]
    pub fn read_only(mut self, read_only: bool) -> Self {
        self.options.read_only = read_only;
        self
    }

    /// Direction control of a serial port that is wired to a bare transceiver: `"kernel".parse()?`, or more exactly an
    /// [`Rs485`](crate::Rs485). Most USB adapters switch by themselves and need none.
    #[cfg(feature = "serial")]
    #[must_use]
    pub fn rs485(mut self, rs485: drivebus_line::rs485::Rs485) -> Self {
        self.tty.rs485 = Some(rs485);
        self
    }

    /// Whether an adapter that keeps what it received for a while is told not to (Linux, FTDI's chips); it is, if this is
    /// not set.
    #[cfg(feature = "serial")]
    #[must_use]
    pub fn low_latency(mut self, low_latency: bool) -> Self {
        self.tty.low_latency = low_latency;
        self
    }

    /// What is known of the adapter handing back what it sends; it is found out if this is not set.
    #[must_use]
    pub fn echo(mut self, echo: AdapterEcho) -> Self {
        self.options.echo = echo;
        self
    }

    /// How long units are given to act on a broadcast, an hour at most; 100 ms if it is not set.
    #[must_use]
    pub fn turnaround(mut self, turnaround: Duration) -> Self {
        self.options.turnaround = turnaround;
        self
    }

    /// Whether a read waits no longer than its unit's answers have taught; never longer than the time-out.
    #[must_use]
    pub fn learn_timeout(mut self, learn_timeout: bool) -> Self {
        self.options.learn_timeout = learn_timeout;
        self
    }

    /// How many requests may wait for the line, 1..=1 000 000; 65 536 if it is not set. A stop is always let in.
    #[must_use]
    pub fn queue(mut self, queue: usize) -> Self {
        self.options.queue = queue;
        self
    }

    /// Whether other programs of the same user may use the port at the same time; [`Share::Auto`] if it is not set: who
    /// opens it first has it and serves the others.
    #[must_use]
    pub fn share(mut self, share: Share) -> Self {
        self.options.share = share;
        self
    }

    /// The number of a group of the system whose users may use the port through this program, beside its own user's: for a
    /// service. They meet in `/run/drivebus`, which this user has, or may make. Only on systems with Unix sockets.
    #[must_use]
    pub fn group(mut self, group: u32) -> Self {
        self.options.group = Some(group);
        self
    }

    /// Whether the threads of the bus's own go before all programs of the computer that did not ask for that, by
    /// `SCHED_FIFO`. Where the system refuses it, [`Bus::notes`] says so. Linux alone has it.
    #[must_use]
    pub fn realtime(mut self, realtime: bool) -> Self {
        self.options.realtime = realtime;
        self
    }

    /// Opens `port`: a path, or one of the URLs in the [crate's documentation](crate#ports).
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](crate::ErrorKind::NotAllowed): something set here or in the URL cannot be; the message names the
    /// part and what is allowed. [`Port`](crate::ErrorKind::Port): the port cannot be opened.
    pub fn open(&self, port: &str) -> Result<Bus, Error> {
        self.open_while(port, &mut || true)
    }

    /// Opens a line of your own: `opener` is called now, and again after the line was lost.
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open).
    pub fn open_with(&self, opener: Opener) -> Result<Bus, Error> {
        let options = self.checked()?;
        Ok(Bus::around(Core::open(opener, options, &mut || false)?))
    }

    /// As [`open`](Self::open), while it is `wanted`.
    pub(crate) fn open_while(&self, port: &str, wanted: &mut dyn FnMut() -> bool) -> Result<Bus, Error> {
        let options = self.checked()?;
        let ports = self.port_options(options.format)?;
        url::check_together(Some(port), self.has_rs485(), options.echo)?;
        let mut open = |opener, key| Core::open_shared(opener, key, options, &mut || !wanted());
        match parse(port)? {
            #[cfg(feature = "sim")]
            PortUrl::Simulator(url) => {
                let simulator = crate::simulated::simulator(&url, options.format)?;
                let core = open(crate::simulated::opener(&simulator), None)?;
                Ok(Bus::simulated(core, simulator))
            }
            other => {
                let key = other.key();
                let opener = other.opener(&ports);
                let opener = opener.ok_or_else(|| {
                    Error::not_allowed(format!("port {port:?}: this program was built without the feature \"sim\""))
                })?;
                Ok(Bus::around(open(opener, key)?))
            }
        }
    }

    fn checked(&self) -> Result<BusOptions, Error> {
        let format = SerialFormat::new(self.baudrate, self.bytesize, self.parity, self.stopbits, self.silence)?;
        checks::timeout(self.options.timeout)?;
        checks::within("retries", self.options.retries, 0, 100)?;
        checks::time("turnaround", self.options.turnaround)?;
        checks::within("queue", self.options.queue, 1, 1_000_000)?;
        Ok(self.options.format(format))
    }

    #[cfg(feature = "serial")]
    fn port_options(&self, format: SerialFormat) -> Result<PortOptions, Error> {
        self.tty.rs485.map(drivebus_line::rs485::Rs485::checked).transpose()?;
        Ok(PortOptions::new(format).tty(self.tty.clone()))
    }

    #[cfg(not(feature = "serial"))]
    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "with serial ports there is something to refuse")]
    fn port_options(&self, format: SerialFormat) -> Result<PortOptions, Error> {
        Ok(PortOptions::new(format))
    }

    #[cfg(feature = "serial")]
    fn has_rs485(&self) -> bool {
        self.tty.rs485.is_some()
    }

    #[cfg(not(feature = "serial"))]
    #[expect(clippy::unused_self, reason = "with serial ports there may be one")]
    fn has_rs485(&self) -> bool {
        false
    }
}

#[cfg(feature = "sim")]
fn parse(port: &str) -> Result<PortUrl, Error> {
    let families: Vec<&str> = drivebus_drives::Profile::builtin_names().collect();
    let faults = drivebus_sim::FaultKind::ALL.map(drivebus_sim::FaultKind::name);
    Ok(PortUrl::parse(port, &Known::default().families(&families).faults(&faults))?)
}

#[cfg(not(feature = "sim"))]
fn parse(port: &str) -> Result<PortUrl, Error> {
    if port.starts_with("sim://") {
        return Err(Error::not_allowed(format!("port {port:?}: this program was built without the feature \"sim\"")));
    }
    Ok(PortUrl::parse(port, &Known::default())?)
}
