//! What came of a run.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use drivebus_sim::Transmission;

/// How much of the trace is kept with a wrong value.
const TRACE: usize = 40;
/// How many wrong things are kept in full.
const KEPT: usize = 10;

/// Something that must not happen, with what led to it.
#[derive(Debug, Clone)]
pub struct Wrong {
    /// What, in words.
    pub what: String,
    /// The transmissions before it.
    pub trace: Vec<Transmission>,
}

/// What came of a run.
#[derive(Debug, Clone, Default)]
pub struct Verdict {
    /// Calls of the bus.
    pub calls: u64,
    /// Requests on the wire, probes and repeated reads included.
    pub requests: u64,
    /// Reads that brought the right words.
    pub right: u64,
    /// Reads that brought others.
    pub wrong_values: u64,
    /// Refusals that no drive gave for what was asked.
    pub false_refusals: u64,
    /// Writes and commands reported done.
    pub done: u64,
    /// Writes and commands that a drive took more than once.
    pub twice: u64,
    /// Writes and commands reported done that no drive took.
    pub not_done: u64,
    /// Writes and commands reported as not sent that a drive took, and words that nobody wrote.
    pub unasked: u64,
    /// Words in the drives' logs that nobody looked at.
    pub words_lost: u64,
    /// Samples of a poll that were lost, came out of turn or were counted wrongly.
    pub samples_lost: u64,
    /// Threads that ended by themselves.
    pub panicked: u64,
    /// Requests before the silence was over.
    pub silence_violations: u64,
    /// Stops, sent at once though an answer was owed, whose confirmation was that of an earlier stop.
    pub confirmed_by_earlier: u64,
    /// Frames that came too late, and were not taken for anything.
    pub late_frames: u64,
    /// How often the port was opened again.
    pub reconnects: u64,
    /// Errors that callers got, by kind.
    pub errors: BTreeMap<&'static str, u64>,
    /// Faults that happened, by kind.
    pub faults: Vec<(&'static str, u64)>,
    /// Virtual time.
    pub simulated: Duration,
    /// Real time.
    pub wall: Duration,
    /// Where chance came from.
    pub seed: u64,
    /// The first things that must not happen.
    pub details: Vec<Wrong>,
}

impl Verdict {
    /// Whether all was true, and every kind of fault had its chance to make it untrue.
    pub fn is_good(&self) -> bool {
        self.is_true() && self.faults.iter().all(|&(_, count)| count > 0)
    }

    /// Whether nothing happened that must not.
    pub fn is_true(&self) -> bool {
        let bad = [self.wrong_values, self.false_refusals, self.twice, self.not_done, self.unasked];
        bad.iter().sum::<u64>() + self.words_lost + self.samples_lost + self.panicked == 0
    }

    /// Both together.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        self.right += other.right;
        self.wrong_values += other.wrong_values;
        self.false_refusals += other.false_refusals;
        self.samples_lost += other.samples_lost;
        self.done += other.done;
        self.twice += other.twice;
        self.not_done += other.not_done;
        self.unasked += other.unasked;
        self.confirmed_by_earlier += other.confirmed_by_earlier;
        for (kind, count) in other.errors {
            *self.errors.entry(kind).or_default() += count;
        }
        self.details.extend(other.details);
        self.details.truncate(KEPT);
        self
    }

    /// Keeps what must not happen to the samples of a poll.
    pub(crate) fn lost_samples(&mut self, what: String, trace: Vec<Transmission>) {
        self.samples_lost += 1;
        self.blame(what, trace);
    }

    /// Keeps what must not happen.
    pub(crate) fn blame(&mut self, what: String, mut trace: Vec<Transmission>) {
        if self.details.len() < KEPT {
            let trace = trace.split_off(trace.len().saturating_sub(TRACE));
            self.details.push(Wrong { what, trace });
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.wall.as_secs_f64();
        #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
        let speed = self.requests as f64 / seconds.max(1e-9);
        let rows: [(&str, String); 15] = [
            ("seed", self.seed.to_string()),
            ("simulated time", format!("{:.2} h", self.simulated.as_secs_f64() / 3_600.0)),
            ("wall time", format!("{seconds:.1} s")),
            ("transactions", format!("{}, {speed:.0} a second", self.requests)),
            ("calls", self.calls.to_string()),
            ("right values read", self.right.to_string()),
            ("writes and commands done", self.done.to_string()),
            ("wrong values", self.wrong_values.to_string()),
            ("refusals of something else", self.false_refusals.to_string()),
            ("done twice", self.twice.to_string()),
            ("reported done, not in the log", self.not_done.to_string()),
            ("in the log, never sent", self.unasked.to_string()),
            ("late frames dropped", self.late_frames.to_string()),
            ("stops confirmed by an earlier", self.confirmed_by_earlier.to_string()),
            ("port opened again", self.reconnects.to_string()),
        ];
        for (name, value) in rows {
            writeln!(f, "{name:<32}{value}")?;
        }
        for (title, counts) in [
            ("errors by kind", self.errors.iter().map(|(&kind, &count)| (kind, count)).collect::<Vec<_>>()),
            ("faults by kind", self.faults.clone()),
        ] {
            writeln!(f, "{title}")?;
            for (kind, count) in counts {
                writeln!(f, "  {kind:<30}{count}")?;
            }
        }
        if self.words_lost + self.samples_lost + self.panicked > 0 {
            let (words, samples, panicked) = (self.words_lost, self.samples_lost, self.panicked);
            writeln!(f, "words nobody wrote: {words}, samples lost: {samples}, threads that panicked: {panicked}")?;
        }
        for wrong in &self.details {
            writeln!(f, "\n{}", wrong.what)?;
            for sent in &wrong.trace {
                let bytes: Vec<String> = sent.bytes.iter().map(|byte| format!("{byte:02X}")).collect();
                writeln!(f, "  {:>16} {:?}: {}", sent.begin.as_nanos(), sent.side, bytes.join(" "))?;
            }
        }
        Ok(())
    }
}
