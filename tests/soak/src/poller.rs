//! The role that polls: the same known words again and again, while all others use the line.

use std::sync::Arc;
use std::time::Duration;

use drivebus_line::{Poll, PollTarget};
use drivebus_rtu::UnitAddress;

use crate::chance::Chance;
use crate::rig::{BLOCKS, Rig, UNITS, known};
use crate::roles::{Role, judge, note};
use crate::verdict::Verdict;

/// How long one poll is polled: so many times somebody waits for its samples.
const WAITS: u16 = 40;
/// How long it is waited for samples at most; a time-out and what comes after it take less.
const WAIT: Duration = Duration::from_millis(100);
/// Samples that a poll keeps: more than one wait can bring.
const KEPT: usize = 64;

/// Polls some units, now these and now those, at a rate or as fast as the wire.
#[derive(Debug)]
pub(crate) struct Poller {
    chance: Chance,
    poll: Option<Running>,
}

#[derive(Debug)]
struct Running {
    poll: Poll,
    units: Vec<u8>,
    /// The place of the target whose sample is next.
    next: usize,
    missing: u64,
    waits_left: u16,
}

impl Poller {
    pub(crate) fn new(chance: Chance) -> Self {
        Self { chance, poll: None }
    }

    fn begin(&mut self, rig: &Rig) -> Result<Running, String> {
        let count = 1 + usize::from(self.chance.below(3));
        // A unit may be there twice, as two drives of one poll may be by mistake.
        let units: Vec<u8> = (0..count).filter_map(|_| self.chance.one_of(&UNITS)).collect();
        let targets: Vec<PollTarget> = units
            .iter()
            .filter_map(|&unit| Some(PollTarget::new(UnitAddress::new(unit).ok()?, BLOCKS.to_vec())))
            .collect();
        let interval = (self.chance.below(2) == 0).then_some(Duration::from_millis(50));
        let poll = Poll::start(Arc::clone(&rig.bus), targets, interval, KEPT).map_err(|error| error.to_string())?;
        Ok(Running { poll, units, next: 0, missing: 0, waits_left: WAITS })
    }
}

impl Running {
    /// Waits for a few samples, and judges each that came.
    fn go_on(&mut self, rig: &Rig, count: usize, verdict: &mut Verdict) -> Result<(), String> {
        self.poll.wait(count, Some(WAIT), &mut || false).map_err(|failure| failure.to_string())?;
        let batch = self.poll.take(usize::MAX);
        rig.called(batch.len());
        for (sample, words) in batch.iter() {
            if sample.target != self.next || sample.sent > sample.ended {
                return Err(format!("{sample:?} came, that of target {} was next", self.next));
            }
            self.next = (self.next + 1) % self.units.len();
            let unit = self.units[sample.target];
            if let Some(error) = &sample.missing {
                self.missing += 1;
                note(rig, error, verdict);
                continue;
            }
            let expected: Vec<u16> = BLOCKS
                .into_iter()
                .flat_map(|(first, count)| first..first + count)
                .map(|address| known(unit, address))
                .collect();
            judge(rig, unit, BLOCKS[0].0, &[&expected], words, verdict);
        }
        let counts = self.poll.counts();
        if counts.missing != self.missing || counts.dropped != 0 {
            return Err(format!("{counts:?}, but {} samples were missing", self.missing));
        }
        Ok(())
    }
}

impl Role for Poller {
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict) {
        let mut running =
            match self.poll.take().filter(|running| running.waits_left > 0).map_or_else(|| self.begin(rig), Ok) {
                Ok(running) => running,
                Err(why) => return verdict.lost_samples(why, rig.trace()),
            };
        running.waits_left -= 1;
        let count = 1 + usize::from(self.chance.below(4));
        match running.go_on(rig, count, verdict) {
            Ok(()) => self.poll = Some(running),
            Err(why) => verdict.lost_samples(why, rig.trace()),
        }
    }
}
