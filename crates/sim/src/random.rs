//! Chance from a seed: the same seed, the same simulation.

use std::time::Duration;

/// A small generator (SplitMix64), good enough for noise and the same everywhere.
#[derive(Debug, Clone)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Any number, of the one who is number `place` among those who draw from the same seed.
    pub(crate) fn of(seed: u64, place: u64) -> u64 {
        Self::new(seed ^ place.rotate_left(32)).next()
    }

    /// 1..=255, nearly evenly.
    pub(crate) fn next_nonzero(&mut self) -> u8 {
        let byte = self.next() % 255 + 1;
        u8::try_from(byte).unwrap_or(u8::MAX)
    }

    /// Any byte.
    pub(crate) fn byte(&mut self) -> u8 {
        let [byte, ..] = self.next().to_be_bytes();
        byte
    }

    /// 0..`bound`, nearly evenly; 0 where `bound` is 0.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        let bound = u64::try_from(bound).unwrap_or(u64::MAX).max(1);
        usize::try_from(self.next() % bound).unwrap_or(0)
    }

    /// True in this share (0.0..=1.0) of all cases.
    pub(crate) fn happens(&mut self, share: f64) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "53 bits, which is what a float holds")]
        let drawn = (self.next() >> 11) as f64 / (1_u64 << 53) as f64;
        drawn < share
    }

    /// 0 to `longest`, in whole nanoseconds.
    pub(crate) fn up_to(&mut self, longest: Duration) -> Duration {
        let nanos = u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX);
        let drawn = self.next();
        Duration::from_nanos(nanos.checked_add(1).map_or(drawn, |bound| drawn % bound))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // SplitMix64 from seed 1234567: the test vector of Java's SplittableRandom, as Rosetta Code prints it.
        let mut random = Random::new(1_234_567);
        assert_eq!(
            [random.next(), random.next(), random.next()],
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]
        );
    }

    #[test]
    fn shares_are_kept_at_both_ends() {
        let mut random = Random::new(1);
        assert!((0..1_000).all(|_| random.happens(1.0)));
        assert!(!(0..1_000).any(|_| random.happens(0.0)));
        assert_eq!((random.below(0), random.below(1), random.up_to(Duration::ZERO)), (0, 0, Duration::ZERO));
    }

    #[test]
    fn any_time_has_a_share() {
        let mut random = Random::new(1);
        for longest in [Duration::from_nanos(1), Duration::from_nanos(u64::MAX - 1), Duration::from_nanos(u64::MAX)] {
            assert!(random.up_to(longest) <= longest);
        }
        assert!(
            random.up_to(Duration::MAX) > Duration::from_secs(3_600),
            "what no clock counts is the longest it counts"
        );
    }
}
