//! The hand that pulls the adapter out and puts it back, or another one that echoes.

use std::time::Duration;

use drivebus_rtu::Instant;
use drivebus_sim::SimulatedLine;

use crate::chance::Chance;

/// Pulls the adapter out now and then.
#[derive(Debug)]
pub(crate) struct Hand {
    chance: Chance,
    every: Duration,
    next: Instant,
    /// Whether this hand holds the adapter.
    holds: bool,
    pub(crate) pulls: u64,
}

impl Hand {
    pub(crate) fn new(chance: Chance, every: Duration, now: Instant) -> Self {
        Self { chance, every, next: now + every, holds: false, pulls: 0 }
    }

    /// Does what is due.
    pub(crate) fn act(&mut self, wire: &SimulatedLine, now: Instant) {
        if now < self.next {
            return;
        }
        if self.holds {
            // It may be another one: half of all adapters echo.
            wire.set_echo(self.chance.below(2) == 0);
            // Nothing is served to other programs, so that nothing can fail.
            let _ = wire.replug();
            self.holds = false;
            self.next = now + self.every.mul_f64(f64::from(self.chance.below(2_000)) / 1_000.0);
        } else {
            wire.unplug();
            self.holds = true;
            self.pulls += 1;
            self.next = now + Duration::from_millis(20) * u32::from(1 + self.chance.below(25));
        }
    }
}
