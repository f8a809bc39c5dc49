//! What a bus, one of its units and one call may be told to do otherwise.

use std::time::Duration;

use drivebus_rtu::{SerialFormat, TURNAROUND};

use crate::turns::order::Priority;
use crate::turns::queue::DEFAULT_QUEUE;

/// How a bus behaves.
#[derive(Debug, Clone, Copy)]
pub struct BusOptions {
    /// Characters and silence.
    pub format: SerialFormat,
    /// The longest wait from the end of a request to the end of its answer.
    pub timeout: Duration,
    /// How often a read is asked once more. A damaged answer, which took no time-out, counts half. A write is never.
    pub retries: u32,
    /// Whether every request that may change something in a unit is refused before it is sent.
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
        }
    }
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

/// What one unit needs otherwise than the bus; `None` keeps what the bus has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct UnitOptions {
    /// The longest wait from the end of a request to the end of its answer.
    pub timeout: Option<Duration>,
    /// The least silence before a request to the unit, where it needs more than the 3.5 characters of every other.
    pub gap: Option<Duration>,
}

/// What one call wants otherwise than the bus; `None` keeps what the bus has.
#[derive(Debug, Clone, Copy, Default)]
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
}
