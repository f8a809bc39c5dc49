//! Polling: a bus asks the same again and again, and hands out what came as samples.

use std::sync::Arc;
use std::time::Duration;

use drivebus_line::{Bus as Core, Poll as Polled, PollBatch, PollCounts, PollSample, PollTarget};
use drivebus_rtu::{Instant, Table, UnitAddress};

use crate::checks;
use crate::error::Error;
use crate::reading::{Reading, Values};

/// How many samples are kept for who takes them; then the oldest give way.
const KEPT: usize = 10_000;

/// What is asked of one unit in each cycle.
#[derive(Debug, Clone)]
pub struct Target {
    unit: u8,
    what: What,
}

#[derive(Debug, Clone)]
enum What {
    Values(Reading),
    Words(Vec<(u16, u16)>),
}

impl Target {
    /// The values of `reading` from `unit`.
    pub fn values(unit: u8, reading: &Reading) -> Self {
        Self { unit, what: What::Values(reading.clone()) }
    }

    /// Words of `unit` as they are: address and count of each read.
    pub fn words(unit: u8, reads: impl IntoIterator<Item = (u16, u16)>) -> Self {
        Self { unit, what: What::Words(reads.into_iter().collect()) }
    }

    fn reads(&self) -> Vec<(Table, u16, u16)> {
        match &self.what {
            What::Values(reading) => {
                reading.spans().map(|(place, count)| (checks::table(place.table), place.address, count)).collect()
            }
            What::Words(reads) => reads.iter().map(|&(address, count)| (Table::Holding, address, count)).collect(),
        }
    }

    fn length(&self) -> usize {
        self.reads().iter().map(|&(.., count)| usize::from(count)).sum()
    }
}

/// A poll under way. It ends when it is dropped.
#[derive(Debug)]
pub struct Poll {
    pub(crate) core: Arc<Polled>,
    pub(crate) is_virtual: bool,
    /// With the number of words that each of them brings.
    targets: Vec<(Target, usize)>,
}

impl Poll {
    pub(crate) fn start(bus: &Arc<Core>, targets: Vec<Target>, interval: Option<Duration>) -> Result<Self, Error> {
        let asked = targets.iter().map(|target| {
            let unit: UnitAddress = checks::unit(target.unit)?;
            Ok(PollTarget::of_tables(unit, target.reads()))
        });
        let core = Polled::start(Arc::clone(bus), asked.collect::<Result<_, Error>>()?, interval, KEPT)?;
        let with_length = |target: Target| {
            let length = target.length();
            (target, length)
        };
        let targets = targets.into_iter().map(with_length).collect();
        Ok(Self { core: Arc::new(core), is_virtual: bus.is_virtual(), targets })
    }

    /// The samples as they come; waits for each of them. They end when the poll has ended.
    pub fn samples(&self) -> impl Iterator<Item = Sample> {
        std::iter::from_fn(|| self.next())
    }

    /// The next sample; waits for it. `None` when the poll has ended.
    pub fn next(&self) -> Option<Sample> {
        self.next_within(None)
    }

    /// As [`next`](Self::next), but waits no longer than `time` of the line's clock.
    pub fn next_within(&self, time: impl Into<Option<Duration>>) -> Option<Sample> {
        // It fails only where the poll is over for this process.
        let _ = self.core.wait(1, time.into(), &mut || false);
        self.take()
    }

    /// The oldest sample that is there already.
    pub fn take(&self) -> Option<Sample> {
        let batch: PollBatch = self.core.take(1);
        let (sample, words) = batch.iter().next()?;
        self.sample(sample, words)
    }

    fn sample(&self, sample: &PollSample, words: &[u16]) -> Option<Sample> {
        let (target, length) = self.targets.get(sample.target)?;
        let words = match &sample.missing {
            None => Ok(words.get(..*length)?.to_vec()),
            Some(missing) => Err(Error::from(missing.clone())),
        };
        let reading = match &target.what {
            What::Values(reading) => Some(reading.clone()),
            What::Words(_) => None,
        };
        Some(Sample { unit: target.unit, sent: sample.sent, ended: sample.ended, words, reading })
    }

    /// What was done so far: cycles, samples without words, beats missed, samples that gave way.
    pub fn counts(&self) -> PollCounts {
        self.core.counts()
    }

    /// How long one cycle takes at least on this line.
    pub fn shortest(&self) -> Duration {
        self.core.shortest()
    }

    /// Whether nothing is asked any more. Samples may still be there.
    pub fn is_over(&self) -> bool {
        self.core.is_over()
    }

    /// Ends the poll, and waits until the exchange that is under way is over.
    pub fn close(&self) {
        self.core.close();
    }
}

impl Drop for Poll {
    /// A thread that still waits for it does not keep it going.
    fn drop(&mut self) {
        self.core.stop();
    }
}

/// What became of one target in one cycle.
#[derive(Debug, Clone)]
pub struct Sample {
    unit: u8,
    sent: Instant,
    ended: Instant,
    words: Result<Vec<u16>, Error>,
    reading: Option<Reading>,
}

impl Sample {
    /// Who was asked.
    pub fn unit(&self) -> u8 {
        self.unit
    }

    /// When its first request began, on the line's clock; where nothing was sent, when it was given up.
    pub fn sent(&self) -> Instant {
        self.sent
    }

    /// When its last answer was complete, or it was given up.
    pub fn ended(&self) -> Instant {
        self.ended
    }

    /// The words of all reads, one read after the other.
    ///
    /// # Errors
    ///
    /// Why there are none.
    pub fn words(&self) -> Result<&[u16], &Error> {
        self.words.as_deref()
    }

    /// The values, where the target was asked for values.
    ///
    /// # Errors
    ///
    /// Why there are none.
    pub fn values(&self) -> Result<Option<Values>, &Error> {
        let words = self.words()?;
        Ok(self.reading.as_ref().map(|reading| reading.values(words)))
    }
}
