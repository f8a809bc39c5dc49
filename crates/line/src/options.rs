//! What a bus, one of its units and one call may be told to do otherwise.

mod halter;

use std::time::Duration;

use drivebus_rtu::{OwnEcho, Request, SerialFormat, TURNAROUND, UnitAddress};

use crate::error::Failure;
pub use crate::options::halter::{HaltLine, Halted, Halter};
use crate::turns::order::Priority;
use crate::turns::queue::DEFAULT_QUEUE;

/// How a bus behaves.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct BusOptions {
    /// Characters and silence.
    pub format: SerialFormat,
    /// The longest wait from the end of a request to the end of its answer.
    pub timeout: Duration,
    /// How often a read is asked once more. A damaged answer, which took no time-out, counts half. A write is never.
    pub retries: u32,
    /// Whether every request that may change something in a unit is refused before it is sent; also bytes that have not the
    /// form of a read, by which a unit that speaks no Modbus may be told something.
    pub read_only: bool,
    /// What is known about the adapter sending our own bytes back.
    pub echo: AdapterEcho,
    /// How long units are given to act on a broadcast, in which nothing is sent.
    pub turnaround: Duration,
    /// Whether a read waits no longer than its unit's answers have taught: four times the longest delay of the last 32,
    /// at least 100 ms, beside the time that the answer's characters take, and never longer than the time-out. What is
    /// polled waits so in any case.
    pub learn_timeout: bool,
    /// How many requests may wait for the line; who comes then is told so at once
    /// ([`Failure::QueueFull`](crate::Failure::QueueFull)). A stop is always let in. 0 would let nobody wait.
    pub queue: usize,
    /// Whether the port is shared with other programs of the same user.
    pub share: Share,
    /// The number of a group of the system whose users may use the port through this program, beside its own user: they meet in
    /// `/run/drivebus`. Only where there are Unix sockets; `None`: its own user's programs alone.
    pub group: Option<u32>,
    /// Whether the threads of the bus's own go before all others of the computer that are not of that kind (`SCHED_FIFO`):
    /// workers, polls, and those of clients over the network. Where the system refuses that,
    /// [`Bus::notes`](crate::Bus::notes) says so.
    pub realtime: bool,
    /// Who halts units for programs and clients that are gone, by what their families know; `None`: their
    /// [`LastWill::ways`] are sent as they are.
    pub halter: Option<&'static dyn Halter>,
}

impl BusOptions {
    /// Half a second, two retries of reads, writing allowed, the adapter's echo found out, the turnaround delay of the
    /// specification, no time-outs that learn, 65 536 requests that may wait.
    pub const fn new(format: SerialFormat) -> Self {
        Self {
            format,
            timeout: Duration::from_millis(500),
            retries: 2,
            read_only: false,
            echo: AdapterEcho::Auto,
            turnaround: TURNAROUND,
            learn_timeout: false,
            queue: DEFAULT_QUEUE,
            share: Share::Auto,
            group: None,
            realtime: false,
            halter: None,
        }
    }

    /// Sets [`format`](Self#structfield.format).
    #[must_use]
    pub const fn format(self, format: SerialFormat) -> Self {
        Self { format, ..self }
    }

    /// Sets [`timeout`](Self#structfield.timeout).
    #[must_use]
    pub const fn timeout(self, timeout: Duration) -> Self {
        Self { timeout, ..self }
    }

    /// Sets [`retries`](Self#structfield.retries).
    #[must_use]
    pub const fn retries(self, retries: u32) -> Self {
        Self { retries, ..self }
    }

    /// Sets [`read_only`](Self#structfield.read_only).
    #[must_use]
    pub const fn read_only(self, read_only: bool) -> Self {
        Self { read_only, ..self }
    }

    /// Why `request` is not sent over a bus that is for reading only; `None` of one that is.
    pub(crate) fn kept_from(&self, request: &Request<'_>) -> Option<Failure> {
        if !self.read_only || request.only_reads() {
            return None;
        }
        let function = request.function();
        Some(if request.is_write() { Failure::ReadOnly { function } } else { Failure::NotARead { function } })
    }

    /// Sets [`echo`](Self#structfield.echo).
    #[must_use]
    pub const fn echo(self, echo: AdapterEcho) -> Self {
        Self { echo, ..self }
    }

    /// Sets [`turnaround`](Self#structfield.turnaround).
    #[must_use]
    pub const fn turnaround(self, turnaround: Duration) -> Self {
        Self { turnaround, ..self }
    }

    /// Sets [`learn_timeout`](Self#structfield.learn_timeout).
    #[must_use]
    pub const fn learn_timeout(self, learn_timeout: bool) -> Self {
        Self { learn_timeout, ..self }
    }

    /// Sets [`queue`](Self#structfield.queue).
    #[must_use]
    pub const fn queue(self, queue: usize) -> Self {
        Self { queue, ..self }
    }

    /// Sets [`share`](Self#structfield.share).
    #[must_use]
    pub const fn share(self, share: Share) -> Self {
        Self { share, ..self }
    }

    /// Sets [`group`](Self#structfield.group).
    #[must_use]
    pub const fn group(self, group: Option<u32>) -> Self {
        Self { group, ..self }
    }

    /// Sets [`realtime`](Self#structfield.realtime).
    #[must_use]
    pub const fn realtime(self, realtime: bool) -> Self {
        Self { realtime, ..self }
    }

    /// Sets [`halter`](Self#structfield.halter).
    #[must_use]
    pub const fn halter(self, halter: Option<&'static dyn Halter>) -> Self {
        Self { halter, ..self }
    }
}

/// Whether a port is shared with other programs of the same user on this computer.
///
/// The program that has the port does what the others want in its own queue. Serial ports and serial servers
/// (`socket://`) can be shared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Share {
    /// The first program to open the port owns it and serves the others; later ones go through it.
    #[default]
    Auto,
    /// As `Auto`, but nobody is served where this program has the port.
    Own,
    /// A port that another program has is busy, and nobody is served.
    Never,
}

/// What is known about the adapter sending our own bytes back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdapterEcho {
    /// Find out.
    Auto,
    /// It does: the request is taken off before every answer.
    Present,
    /// It does not.
    Absent,
}

impl From<AdapterEcho> for OwnEcho {
    fn from(echo: AdapterEcho) -> Self {
        match echo {
            AdapterEcho::Auto => Self::Unknown,
            AdapterEcho::Present => Self::Present,
            AdapterEcho::Absent => Self::Absent,
        }
    }
}

/// What one unit needs otherwise than the bus; `None` keeps what the bus has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnitOptions {
    /// The longest wait from the end of a request to the end of its answer.
    pub timeout: Option<Duration>,
    /// The least silence before a request to the unit, where it needs more than the 3.5 characters of every other.
    pub gap: Option<Duration>,
}

impl UnitOptions {
    /// Options that leave everything as the bus has it.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`timeout`](Self#structfield.timeout).
    #[must_use]
    pub fn timeout(self, timeout: impl Into<Option<Duration>>) -> Self {
        Self { timeout: timeout.into(), ..self }
    }

    /// Sets [`gap`](Self#structfield.gap).
    #[must_use]
    pub fn gap(self, gap: impl Into<Option<Duration>>) -> Self {
        Self { gap: gap.into(), ..self }
    }
}

/// What one call wants otherwise than the bus; `None` keeps what the bus has.
#[derive(Debug, Clone, Copy, Default)]
#[non_exhaustive]
pub struct CallOptions {
    /// The longest wait for the answer.
    pub timeout: Option<Duration>,
    /// How often a read is asked once more; after a damaged answer, which took no time-out, twice as often.
    pub retries: Option<u32>,
    /// Who goes first; `None` is [`Priority::Write`] for what changes something and [`Priority::Read`] for the rest.
    pub priority: Option<Priority>,
    /// Whether the request goes out at once, whatever is in doubt about the unit: for a stop, which must not wait for an
    /// echo to come back. Its confirmation may then belong to the very same request, sent before.
    pub in_doubt: bool,
    /// Whether a read is asked until the same words came twice in a row: against noise that happens to match its CRC
    /// (one damaged answer in 65 536).
    pub verify: bool,
    /// Where the words of a write can be read. Then a confirmation that is missing is looked for there, and the write is
    /// repeated only while the unit shows other words. For absolute values only: what a command does, nobody can read back.
    pub read_back: Option<u16>,
    /// How often the port had been opened again ([`Stats::reconnects`](crate::Stats::reconnects)) when the caller saw who
    /// answers. Where it was opened again since, nothing is sent: another unit may have the address now.
    pub connection: Option<u64>,
    /// How often the unit had been told to halt ([`Bus::halts`](crate::Bus::halts)) when the caller decided on this request.
    /// Where it was told to since, nothing is sent ([`Failure::Halted`](crate::Failure::Halted)): for what starts a motor,
    /// so that a stop which overtook it stays the last word. What is a stop itself goes out in any case.
    pub halts: Option<u64>,
}

impl CallOptions {
    /// Options that leave everything as the bus has it.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`timeout`](Self#structfield.timeout).
    #[must_use]
    pub fn timeout(self, timeout: impl Into<Option<Duration>>) -> Self {
        Self { timeout: timeout.into(), ..self }
    }

    /// Sets [`retries`](Self#structfield.retries).
    #[must_use]
    pub fn retries(self, retries: impl Into<Option<u32>>) -> Self {
        Self { retries: retries.into(), ..self }
    }

    /// Sets [`priority`](Self#structfield.priority).
    #[must_use]
    pub fn priority(self, priority: impl Into<Option<Priority>>) -> Self {
        Self { priority: priority.into(), ..self }
    }

    /// Sets [`in_doubt`](Self#structfield.in_doubt).
    #[must_use]
    pub const fn in_doubt(self, in_doubt: bool) -> Self {
        Self { in_doubt, ..self }
    }

    /// Sets [`verify`](Self#structfield.verify).
    #[must_use]
    pub const fn verify(self, verify: bool) -> Self {
        Self { verify, ..self }
    }

    /// Sets [`read_back`](Self#structfield.read_back).
    #[must_use]
    pub fn read_back(self, read_back: impl Into<Option<u16>>) -> Self {
        Self { read_back: read_back.into(), ..self }
    }

    /// Sets [`connection`](Self#structfield.connection).
    #[must_use]
    pub fn connection(self, connection: impl Into<Option<u64>>) -> Self {
        Self { connection: connection.into(), ..self }
    }

    /// Sets [`halts`](Self#structfield.halts).
    #[must_use]
    pub fn halts(self, halts: impl Into<Option<u64>>) -> Self {
        Self { halts: halts.into(), ..self }
    }
}

/// What halts a unit when the program that runs it is gone without a word.
///
/// Whoever carries it out has a [halter](BusOptions::halter) halt the unit as it is [`named`](Self#structfield.named). Where
/// it is named as no family that one knows, such as by somebody's own profile, or there is no halter, the
/// [`ways`](Self#structfield.ways) are sent as they are, behind the [`look`](Self#structfield.look); then nobody looks whether
/// the motor stands, and a unit of another family is not halted.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct LastWill {
    /// The unit.
    pub unit: UnitAddress,
    /// Each of these halts it, and the first is tried first: PDUs that follow each other.
    pub ways: Vec<Vec<Vec<u8>>>,
    /// What the unit is asked before, by one read, and the PDUs of the answers by which it says that it is another one: then
    /// it is not halted. Silence and refusals are no evidence, nor is any other answer.
    pub look: Option<(Vec<u8>, Vec<Vec<u8>>)>,
    /// After how long a silence the unit acts by itself; zero where it does not.
    pub silence: Duration,
    /// As what it is halted by who knows families.
    pub named: Option<Named>,
}

impl LastWill {
    /// What halts `unit`: in one of these `ways`.
    pub fn new(unit: UnitAddress, ways: Vec<Vec<Vec<u8>>>) -> Self {
        Self { unit, ways, look: None, silence: Duration::ZERO, named: None }
    }

    /// Sets [`look`](Self#structfield.look).
    #[must_use]
    pub fn look(self, question: Vec<u8>, others: Vec<Vec<u8>>) -> Self {
        Self { look: Some((question, others)), ..self }
    }

    /// Sets [`silence`](Self#structfield.silence).
    #[must_use]
    pub fn silence(self, silence: Duration) -> Self {
        Self { silence, ..self }
    }

    /// Sets [`named`](Self#structfield.named).
    #[must_use]
    pub fn named(self, named: impl Into<Option<Named>>) -> Self {
        Self { named: named.into(), ..self }
    }
}

/// As what a unit was named that is to be halted, and how: names that a [`Halter`] knows, and nobody else here.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Named {
    /// The family.
    pub family: String,
    /// The commands that halt it: the first is sent first.
    pub commands: Vec<String>,
    /// Whether that family is meant, whatever the unit says.
    pub is_trusted: bool,
    /// Whether what no document of the family proves is done all the same.
    pub is_unverified: bool,
}

impl Named {
    /// A unit of `family`, which these `commands` halt.
    pub fn new(family: impl Into<String>, commands: Vec<String>) -> Self {
        Self { family: family.into(), commands, is_trusted: false, is_unverified: false }
    }

    /// Sets [`is_trusted`](Self#structfield.is_trusted).
    #[must_use]
    pub fn trusted(self, is_trusted: bool) -> Self {
        Self { is_trusted, ..self }
    }

    /// Sets [`is_unverified`](Self#structfield.is_unverified).
    #[must_use]
    pub fn unverified(self, is_unverified: bool) -> Self {
        Self { is_unverified, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_for_reading_only_keeps_what_is_no_read_and_any_other_keeps_nothing() {
        let both = BusOptions::new(SerialFormat::DEFAULT);
        let looks = both.read_only(true);
        for (pdu, kept) in [
            (&[0x03, 0, 0, 0, 1][..], None),
            (&[0x03, 1, 1], Some(Failure::NotARead { function: 3 })),
            (&[0x02, 3, 5, 0, 17], Some(Failure::NotARead { function: 2 })),
            (&[0x06, 0x20, 0, 0, 5], Some(Failure::ReadOnly { function: 6 })),
            (&[0x41], Some(Failure::ReadOnly { function: 0x41 })),
        ] {
            let request = Request::raw(pdu, None).unwrap();
            assert_eq!(looks.kept_from(&request), kept, "{pdu:02X?}");
            assert_eq!(both.kept_from(&request), None, "{pdu:02X?}");
        }
    }
}
