//! What happened on a bus, in numbers.

use std::collections::BTreeMap;
use std::time::Duration;

use drivebus_rtu::{Tally, UnitAddress};

/// What happened on a bus since it was opened.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stats {
    /// Everything that can be told of the exchanges, over all units and broadcasts.
    pub total: Counters,
    /// The same for each unit that was asked; what came beside an answer counts for the unit that was asked then.
    pub units: BTreeMap<UnitAddress, Counters>,
    /// How often the port was opened again after it was lost.
    pub reconnects: u64,
    /// How often another program had changed the settings of the open port, which were set again.
    pub settings_changed: u64,
    /// The programs that use the port through the one that has it, since that opened it, and the clients that it serves over
    /// the network now.
    pub programs: Vec<Program>,
}

/// What one program asked of a port that it shares with others. What is not counted here, the program that has the port
/// asked itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "share", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Program {
    /// As it calls itself, such as `drivebus`.
    pub name: String,
    /// Its number in the system; 0 of a client over the network.
    pub process: u32,
    /// Whether it still uses the port.
    pub here: bool,
    /// Calls that it wanted; a call may take several requests, or none.
    pub calls: u64,
    /// Those of them that brought an answer.
    pub answered: u64,
}

/// Counts of exchanges, and how long the answers took.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "share", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Counters {
    /// Requests that went out, probes included.
    pub requests: u64,
    /// Right answers.
    pub answers: u64,
    /// Exceptions.
    pub refusals: u64,
    /// Requests without an answer in time.
    pub timeouts: u64,
    /// Answers whose CRC was wrong.
    pub crc_errors: u64,
    /// Whole frames that could not be the answer.
    pub bad_answers: u64,
    /// Requests sent once more.
    pub retries: u64,
    /// Reads asked twice, because the answer to another one might have been taken for theirs.
    pub verified: u64,
    /// Calls that were not sent, because the unit was silent before and others use the line.
    pub not_asked: u64,
    /// Requests that found the way back after one was left open: echoes, reads of another length, and reads of the caller's
    /// that were put so that their answer is told apart.
    pub resyncs: u64,
    /// Whole frames that came before the request went out, or that the unit still owed.
    pub late: u64,
    /// Whole frames of others, or of another function, while an answer was waited for.
    pub foreign: u64,
    /// Bytes that belong to no frame.
    pub noise_bytes: u64,
    /// Those of them that are 00H or FFH.
    pub noise_idle: u64,
    /// Requests that the adapter sent back to us.
    pub own_echoes: u64,
    /// Requests without an answer in time, but with something else in its place: frames of other functions, units or
    /// transactions, or bytes that belong to no frame. They count as time-outs, too.
    pub other_answers: u64,
    /// Those of them to which the unit sent a whole frame of another function.
    pub other_functions: u64,
    /// Those of them that were answered under another transaction number.
    pub other_transactions: u64,
    /// How often bytes came that belong to no frame: beside a request, or between two. Not before or at the first request of
    /// a connection: a server may greet.
    pub noise_events: u64,
    /// How long requests had the line: each from its first bit until its answer was there or waited for no more, and the silence
    /// after it.
    pub occupied: Duration,
    /// From the first bit of the request to the last byte of the answer.
    pub round_trip: Latency,
    /// From the last character of the request to the first of the answer, as the times of characters are computed: how
    /// long the unit, the adapter and this machine took.
    pub delay: Latency,
}

/// Shortest, longest and mean of a time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "share", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Latency {
    /// The shortest; zero while nothing was measured.
    pub min: Duration,
    /// The longest.
    pub max: Duration,
    sum: Duration,
    count: u32,
}

impl Latency {
    /// The mean; zero while nothing was measured.
    pub fn mean(&self) -> Duration {
        self.sum.checked_div(self.count).unwrap_or_default()
    }

    fn add(&mut self, time: Duration) {
        self.min = if self.count == 0 { time } else { self.min.min(time) };
        self.max = self.max.max(time);
        self.sum = self.sum.saturating_add(time);
        self.count = self.count.saturating_add(1);
    }
}

impl Stats {
    pub(crate) fn count(&mut self, unit: Option<UnitAddress>, change: impl Fn(&mut Counters)) {
        change(&mut self.total);
        if let Some(unit) = unit {
            change(self.units.entry(unit).or_default());
        }
    }
}

impl Counters {
    /// What was seen beside the answer.
    pub(crate) fn add(&mut self, tally: Tally) {
        for (count, more) in [
            (&mut self.late, tally.late),
            (&mut self.foreign, tally.foreign),
            (&mut self.noise_bytes, tally.noise),
            (&mut self.noise_idle, tally.noise_idle),
            (&mut self.own_echoes, tally.own_echo),
        ] {
            *count = count.saturating_add(more.into());
        }
    }

    pub(crate) fn answered(&mut self, round_trip: Duration, delay: Duration) {
        self.answers = self.answers.saturating_add(1);
        self.round_trip.add(round_trip);
        self.delay.add(delay);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_that_are_full_stay_full() {
        let full = Counters {
            answers: u64::MAX,
            late: u64::MAX,
            foreign: u64::MAX,
            noise_bytes: u64::MAX,
            noise_idle: u64::MAX,
            own_echoes: u64::MAX,
            ..Counters::default()
        };
        let mut counters = full.clone();
        let mut tally = Tally::default();
        (tally.late, tally.foreign, tally.noise, tally.noise_idle, tally.own_echo) = (1, 1, 1, 1, 1);
        counters.add(tally);
        counters.answered(Duration::MAX, Duration::MAX);
        counters.answered(Duration::MAX, Duration::MAX);
        assert_eq!(Counters { round_trip: full.round_trip, delay: full.delay, ..counters }, full);
        assert_eq!(counters.round_trip.max, Duration::MAX);
    }

    #[test]
    fn latency_keeps_the_ends_and_the_mean() {
        let mut latency = Latency::default();
        assert_eq!(latency.mean(), Duration::ZERO);
        for millis in [5, 2, 11] {
            latency.add(Duration::from_millis(millis));
        }
        assert_eq!((latency.min, latency.max), (Duration::from_millis(2), Duration::from_millis(11)));
        assert_eq!(latency.mean(), Duration::from_millis(6));
    }
}
