//! Samples of a poll that nobody has taken yet: a fixed number of them, the oldest give way.
//!
//! Words are kept as they came, in memory that was set aside at the beginning: what takes no sample away pays nothing for
//! it, and what they mean is worked out where they are used.

use std::collections::VecDeque;

use drivebus_rtu::Instant;

use crate::error::CallError;

/// What became of one target in one cycle.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct PollSample {
    /// Which target, by its place among those of the poll.
    pub target: usize,
    /// The first bit of the first request, on the line's clock; where nothing was sent, when it was given up.
    pub sent: Instant,
    /// The last byte of the last answer, or when it was given up.
    pub ended: Instant,
    /// How many beats were missed since the sample of the same target before it: the line was not free in time.
    pub late: u64,
    /// Why there are no words.
    pub missing: Option<Box<CallError>>,
}

/// Samples that were taken out of a poll, the oldest first.
#[derive(Debug, Clone, Default)]
pub struct PollBatch {
    samples: Vec<PollSample>,
    words: Vec<u16>,
    stride: usize,
}

impl PollBatch {
    /// Each sample with the words of its reads, one read after the other. Of a missing sample they mean nothing, and behind
    /// those of a target with fewer words than others stand zeros.
    pub fn iter(&self) -> impl Iterator<Item = (&PollSample, &[u16])> {
        let words = |index: usize| self.words.get(index * self.stride..(index + 1) * self.stride).unwrap_or_default();
        self.samples.iter().enumerate().map(move |(index, sample)| (sample, words(index)))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

/// The samples that wait to be taken.
#[derive(Debug)]
pub(crate) struct Ring {
    size: usize,
    samples: VecDeque<PollSample>,
    /// The words of the sample at index i are in slot (first + i) % size.
    words: Vec<u16>,
    first: usize,
    stride: usize,
    dropped: u64,
}

impl Ring {
    /// For `size` samples, at least one, of at most `stride` words each; `None` where the system has no room for them.
    pub(crate) fn new(size: usize, stride: usize) -> Option<Self> {
        let size = size.max(1);
        let mut samples = VecDeque::new();
        samples.try_reserve_exact(size).ok()?;
        let count = size.checked_mul(stride)?;
        // Only to see whether there is room: zeros that the system hands out take none until they are written to.
        Vec::<u16>::new().try_reserve_exact(count).ok()?;
        Some(Self { size, samples, words: vec![0; count], first: 0, stride, dropped: 0 })
    }

    /// Adds a sample with its words; where there is no room left the oldest gives way.
    pub(crate) fn push(&mut self, sample: PollSample, words: &[u16]) {
        if self.samples.len() == self.size {
            self.samples.pop_front();
            self.first = (self.first + 1) % self.size;
            self.dropped += 1;
        }
        let slot = (self.first + self.samples.len()) % self.size;
        let place = &mut self.words[slot * self.stride..(slot + 1) * self.stride];
        let count = words.len().min(place.len());
        let (used, rest) = place.split_at_mut(count);
        used.copy_from_slice(&words[..count]);
        rest.fill(0);
        self.samples.push_back(sample);
    }

    /// Takes the oldest out, `max` of them at most.
    pub(crate) fn take(&mut self, max: usize) -> PollBatch {
        let count = max.min(self.samples.len());
        let mut words = Vec::with_capacity(count * self.stride);
        // The slots are one run, or two where they go round the end.
        let end = self.first + count;
        let (tail, around) = (end.min(self.size), end.saturating_sub(self.size));
        words.extend_from_slice(&self.words[self.first * self.stride..tail * self.stride]);
        words.extend_from_slice(&self.words[..around * self.stride]);
        self.first = end % self.size;
        PollBatch { samples: self.samples.drain(..count).collect(), words, stride: self.stride }
    }

    pub(crate) fn len(&self) -> usize {
        self.samples.len()
    }

    /// How many gave way.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sample(target: usize) -> PollSample {
        PollSample { target, sent: Instant::ZERO, ended: Instant::ZERO, late: 0, missing: None }
    }

    #[test]
    fn words_of_a_shorter_target_are_not_those_of_the_sample_before() {
        let mut ring = Ring::new(1, 3).unwrap();
        ring.push(sample(0), &[1, 2, 3]);
        ring.push(sample(1), &[4]);
        let batch = ring.take(9);
        assert_eq!(
            batch.iter().map(|(sample, words)| (sample.target, words)).collect::<Vec<_>>(),
            [(1, &[4, 0, 0][..])]
        );
        assert_eq!(ring.dropped(), 1);
    }

    #[test]
    fn what_there_is_no_room_for_is_no_panic() {
        for (size, stride) in [(usize::MAX, 1), (1 << 40, 1 << 40), (1 << 40, 1 << 20)] {
            assert!(Ring::new(size, stride).is_none());
        }
    }

    proptest! {
        #[test]
        fn what_comes_out_is_what_went_in_but_for_the_oldest(
            size in 1_usize..6,
            stride in 0_usize..3,
            moves in prop::collection::vec((0_usize..9, 0_usize..9), 0..40),
        ) {
            let mut ring = Ring::new(size, stride).unwrap();
            let (mut model, mut next, mut dropped) = (VecDeque::new(), 0_u16, 0);
            for (pushes, takes) in moves {
                for _ in 0..pushes {
                    ring.push(sample(usize::from(next)), &vec![next; stride]);
                    model.push_back(next);
                    if model.len() > size {
                        model.pop_front();
                        dropped += 1;
                    }
                    next += 1;
                }
                prop_assert_eq!((ring.len(), ring.dropped()), (model.len(), dropped));
                let batch = ring.take(takes);
                prop_assert_eq!(batch.len(), takes.min(model.len()));
                prop_assert_eq!(batch.is_empty(), takes == 0 || model.is_empty());
                for ((sample, words), expected) in batch.iter().zip(model.drain(..batch.len())) {
                    prop_assert_eq!(sample.target, usize::from(expected));
                    prop_assert_eq!(words, &vec![expected; stride][..]);
                }
            }
        }
    }
}
