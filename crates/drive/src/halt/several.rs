//! The halts of several units over one line: first each is told, then each is told until it takes it and proved, side by
//! side.
//!
//! No word goes to all units at once: that which stops one family starts another. Whoever is silent, or has to be asked
//! first what it is, keeps nobody waiting, and what the others take counts against no proof.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use drivebus_rtu::Instant;

use super::not_halted::{NotHalted, Why};
use super::{Halt, Judged};
use crate::aim::goes_out_at_once;
use crate::families::Families;
use crate::harm::What;
use crate::look::POLL_INTERVAL;
use crate::task::{LineError, Mailbox};

/// Carries out `halts` of units that hang on one line, side by side. What came of each, in their order.
///
/// # Errors
///
/// Of each unit those of [`Halt::carry_out`]; none keeps another from being halted.
pub async fn halt_all<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    halts: Vec<Halt<E>>,
) -> Vec<Result<(), NotHalted<E>>> {
    let mut pending = in_order(line, families, halts).await;
    let mut done = BTreeMap::new();
    while !pending.is_empty() {
        for _ in 0..pending.len() {
            let Some((place, mut halt)) = pending.pop_front() else { break };
            let began = line.now();
            let came = halt.advance(line, families).await;
            let took = line.now().saturating_duration_since(began);
            for (_, other) in &mut pending {
                other.wait(took);
            }
            match came {
                Ok(false) => pending.push_back((place, halt)),
                ended => drop(done.insert(place, ended.map(drop))),
            }
        }
        let Some(pause) = pending.iter().map(|(_, halt)| halt.pause(line.now())).min() else { break };
        // One ends by each pause that failed, so that all end where there is no time any more.
        if let Err(error) = line.sleep(pause).await
            && let Some((place, halt)) = pending.pop_front()
        {
            done.insert(place, Err(halt.not_halted(line, Why::Failed(error))));
        }
    }
    done.into_values().collect()
}

/// The `halts`, each with its place among them: those whose units answered lately and are told at once come first, the
/// silent ones last.
async fn in_order<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    halts: Vec<Halt<E>>,
) -> VecDeque<(usize, Halt<E>)> {
    let mut ranked = Vec::with_capacity(halts.len());
    for (place, halt) in halts.into_iter().enumerate() {
        let (same, what) = (halt.named.same(), What::Command(halt.order.command));
        // What is not known of a link makes nobody wait.
        let is_silent = line.link(same.unit()).await.is_ok_and(|link| link.asked > 0 && link.good == 0);
        let is_asked_first = !goes_out_at_once(same, families, what, line.connection());
        ranked.push(((is_silent, is_asked_first, place), halt));
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.into_iter().map(|((.., place), halt)| (place, halt)).collect()
}

impl<E: LineError> Halt<E> {
    /// Does the next thing of it: sends, asks what the unit is, or looks. Whether nothing is left to be done.
    async fn advance(&mut self, line: &Mailbox<E>, families: &Families) -> Result<bool, NotHalted<E>> {
        match self.next(line, families).await {
            Ok(is_done) => Ok(is_done),
            Err(why) => Err(self.not_halted(line, why)),
        }
    }

    async fn next(&mut self, line: &Mailbox<E>, families: &Families) -> Result<bool, Why<E>> {
        if let Some(mut proof) = self.proof.take() {
            let looked = proof.look(line, &self.unit, &self.record).await;
            match self.judged(line, families, looked).await? {
                Judged::Open => {
                    self.proof = Some(proof);
                    return Ok(false);
                }
                Judged::Proved => return Ok(true),
                Judged::Untaken => self.is_taken = false,
                Judged::Anew => {}
            }
        }
        if self.is_taken {
            self.proof = Some(self.prove(line, families).await?);
            return Ok(false);
        }
        self.check_order()?;
        if !self.step(line, families).await? && self.is_over(line) {
            return Err(self.failure(line).await);
        }
        Ok(false)
    }

    /// Time until there is something to do again.
    fn pause(&self, now: Instant) -> Duration {
        self.proof.as_ref().map_or(POLL_INTERVAL, |proof| proof.pause(now))
    }

    /// For `time` others were seen to: its proof does not count that.
    fn wait(&mut self, time: Duration) {
        if let Some(proof) = &mut self.proof {
            proof.wait(time);
        }
    }
}

#[cfg(test)]
mod tests;
