//! Faults by rate or by script: which of them hit the next answer, and how often each has.
//!
//! What a fault does to an answer stands in `damage`, what it is in `kind`. What is to be spoilt once and exactly as
//! said, by a test, is in `spoil`.

mod damage;
mod kind;

use std::collections::BTreeMap;
use std::time::Duration;

pub(crate) use damage::Outgoing;
pub use kind::FaultKind;

use crate::random::Random;

const KINDS: usize = FaultKind::ALL.len();
/// All that the first byte of a frame can say.
const ADDRESSES: usize = 256;
/// Chance of faults must not depend on the chance of collisions, which has the plain seed.
const OWN_CHANCE: u64 = 0xFA17;

/// The faults that hit one answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Hits(u32);

impl Hits {
    pub(crate) fn has(self, kind: FaultKind) -> bool {
        self.0 & (1 << kind.index()) != 0
    }

    fn add(&mut self, kind: FaultKind) {
        self.0 |= 1 << kind.index();
    }

    fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// How long what takes time takes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Times {
    /// Of [`FaultKind::Delay`], at most.
    pub(crate) delay: Duration,
    /// Of [`FaultKind::Late`], at least; at most twice as long.
    pub(crate) late: Duration,
    /// Of [`FaultKind::Overtaken`], at least and at most.
    pub(crate) overtaken: (Duration, Duration),
    /// From [`FaultKind::Unplug`] until the port is there again.
    pub(crate) replug: Duration,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            delay: Duration::from_millis(50),
            late: Duration::from_millis(600),
            overtaken: (Duration::from_millis(600), Duration::from_millis(2_400)),
            replug: Duration::from_millis(500),
        }
    }
}

/// The faults of one wire.
#[derive(Debug)]
pub(crate) struct Faults {
    random: Random,
    rates: [f64; KINDS],
    /// Whether one of the rates is more than nothing.
    by_rate: bool,
    /// By the number of the answer.
    script: BTreeMap<u64, Hits>,
    /// What comes instead of an answer, by its number.
    instead: BTreeMap<u64, Vec<u8>>,
    /// Answers since the script began.
    answers: u64,
    counts: [u64; KINDS],
    /// Addresses that have answered on this line.
    present: [bool; ADDRESSES],
    pub(crate) times: Times,
    /// The silence that another's frame keeps to ours.
    pub(crate) silence: Duration,
}

impl Faults {
    pub(crate) fn new(seed: u64, silence: Duration) -> Self {
        Self {
            random: Random::new(seed ^ OWN_CHANCE),
            rates: [0.0; KINDS],
            by_rate: false,
            script: BTreeMap::new(),
            instead: BTreeMap::new(),
            answers: 0,
            counts: [0; KINDS],
            present: [false; ADDRESSES],
            times: Times::default(),
            silence,
        }
    }

    /// `share` is 0.0..=1.0.
    pub(crate) fn set_rate(&mut self, kind: FaultKind, share: f64) {
        self.rates[kind.index()] = share;
        self.by_rate = self.rates.iter().any(|&rate| rate > 0.0);
    }

    pub(crate) fn rate(&self, kind: FaultKind) -> f64 {
        self.rates[kind.index()]
    }

    /// Sets what hits which answer, and which bytes come instead of which, counted from now: 1 is the next. Replaces what
    /// was left of the script before.
    pub(crate) fn script(&mut self, faults: &[(u64, FaultKind)], instead: &[(u64, &[u8])]) {
        self.answers = 0;
        self.script.clear();
        for &(answer, kind) in faults {
            self.script.entry(answer).or_default().add(kind);
        }
        self.instead = instead.iter().map(|&(answer, bytes)| (answer, bytes.to_vec())).collect();
    }

    /// Forgets rates and script; what was counted stays.
    pub(crate) fn clear(&mut self) {
        self.rates = [0.0; KINDS];
        self.by_rate = false;
        self.script.clear();
        self.instead.clear();
    }

    pub(crate) fn count(&self, kind: FaultKind) -> u64 {
        self.counts[kind.index()]
    }

    /// What hits the answer to the request that just reached a unit.
    pub(crate) fn next(&mut self) -> Hits {
        self.answers += 1;
        let mut hits = self.script.remove(&self.answers).unwrap_or_default();
        if !self.by_rate {
            return hits;
        }
        for kind in FaultKind::ALL {
            let rate = self.rates[kind.index()];
            if rate > 0.0 && self.random.happens(rate) {
                hits.add(kind);
            }
        }
        hits
    }

    /// What comes instead of the answer that [`next`](Self::next) was about.
    pub(crate) fn instead(&mut self) -> Option<Vec<u8>> {
        self.instead.remove(&self.answers)
    }

    /// Counts a fault that has happened.
    pub(crate) fn happened(&mut self, kind: FaultKind) {
        self.counts[kind.index()] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_counts_from_the_next_answer() {
        let mut faults = Faults::new(0, Duration::ZERO);
        faults.next();
        faults.script(&[(2, FaultKind::Late), (2, FaultKind::Split), (1, FaultKind::Deaf)], &[]);
        let hits = [faults.next(), faults.next(), faults.next()];
        assert!(hits[0].has(FaultKind::Deaf) && !hits[0].has(FaultKind::Late));
        assert!(hits[1].has(FaultKind::Late) && hits[1].has(FaultKind::Split));
        assert!(hits[2].is_empty());
    }

    #[test]
    fn a_rate_is_kept_within_what_chance_allows() {
        let mut faults = Faults::new(7, Duration::ZERO);
        faults.set_rate(FaultKind::Short, 0.25);
        faults.set_rate(FaultKind::Long, 1.0);
        let hits: Vec<Hits> = (0..10_000).map(|_| faults.next()).collect();
        let short = hits.iter().filter(|hits| hits.has(FaultKind::Short)).count();
        // Five standard deviations of 43.3 around 2500.
        assert!((2_283..=2_717).contains(&short), "{short}");
        assert!(hits.iter().all(|hits| hits.has(FaultKind::Long) && !hits.has(FaultKind::Late)));
        faults.clear();
        assert!(faults.next().is_empty());
    }
}
