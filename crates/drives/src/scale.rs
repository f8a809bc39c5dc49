//! Scales: how many counts are how many units, and the exact way from one to the other.
//!
//! Most drives count tenths or hundredths. Some count a share of a range: 16384 counts are 100 %. Then hardly a count is a
//! decimal number, so its value is rounded to as many digits as tell it from its neighbours.

use crate::decimal::{Counts, Decimal};

/// `counts` counts are `units` units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Scale {
    /// Without a common divisor, as `units`.
    counts: u32,
    units: u32,
    /// Digits after the point: the fewest at which every count reads differently.
    decimals: u8,
    /// Whether a count is a step of the last digit, as nearly everywhere.
    is_decimal: bool,
}

/// The most counts in one unit that a plain number says: 10^4.
const MOST_DECIMALS: u8 = 4;

impl Scale {
    /// One count is one unit.
    pub(crate) const ONE: Self = Self { counts: 1, units: 1, decimals: 0, is_decimal: true };

    /// Reads `text`: `1`, `10`, `100`, `1000` or `10000` counts in one unit, or a ratio such as `16384/100`: 16384 counts are
    /// 100 units.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        match text.split_once('/') {
            None => Self::decimal(text.trim().parse().ok()?),
            Some((counts, units)) => {
                let number = |text: &str| text.trim().parse::<u16>().ok().map(u64::from);
                Self::ratio(number(counts)?, number(units)?)
            }
        }
    }

    /// Of what has `counts` where something else, counted as `per` says, has `whole`: 16384 counts where 5000 hundredths of a
    /// hertz are set. `None` where nothing is, or where a count would be too little or too much for a number of this kind.
    pub(crate) fn of_share(counts: u16, whole: u32, per: Self) -> Option<Self> {
        Self::ratio(u64::from(counts) * u64::from(per.counts), u64::from(whole) * u64::from(per.units))
    }

    /// The scale of so many counts per unit, if that is a power of ten up to 10000.
    pub(crate) fn decimal(counts: u32) -> Option<Self> {
        let decimals = (0..=MOST_DECIMALS).find(|&decimals| 10_u32.pow(decimals.into()) == counts)?;
        Some(Self { counts, units: 1, decimals, is_decimal: true })
    }

    fn ratio(counts: u64, units: u64) -> Option<Self> {
        if counts == 0 || units == 0 {
            return None;
        }
        let divisor = greatest_common_divisor(counts, units);
        let [counts, units] = [counts, units].map(|each| u32::try_from(each / divisor).ok());
        let (counts, units) = (counts?, units?);
        // With one digit less a count would be less than one step of the last digit, and two of 65536 would read the same.
        let steps = |decimals: u8| u64::from(units) * 10_u64.pow(decimals.into());
        let decimals = (0..=5).find(|&decimals| steps(decimals) >= u64::from(counts))?;
        Some(Self { counts, units, decimals, is_decimal: units == 1 && steps(decimals) == u64::from(counts) })
    }

    /// Counts and units, without a common divisor.
    pub(crate) fn as_ratio(self) -> (u32, u32) {
        (self.counts, self.units)
    }

    /// Digits after the point.
    pub(crate) fn decimals(self) -> u8 {
        self.decimals
    }

    /// Whether every count is a number of so many digits, exactly.
    pub(crate) fn is_decimal(self) -> bool {
        self.is_decimal
    }

    /// The value of `count` × 10^decimals: the nearest whole number, and of two the one farther from zero.
    #[inline]
    pub(crate) fn digits(self, count: i64) -> i64 {
        if self.is_decimal { count } else { self.rounded(count) }
    }

    fn rounded(self, count: i64) -> i64 {
        let (steps, counts) = (self.steps(), i128::from(self.counts));
        let magnitude = (i128::from(count).abs() * steps * 2 + counts) / (counts * 2);
        signed(magnitude, count < 0)
    }

    /// The count nearest to the value `digits` / 10^decimals, and of two the one nearer to zero: never more than was asked.
    fn nearest(self, digits: i64) -> i64 {
        if self.is_decimal {
            return digits;
        }
        let (steps, counts) = (self.steps(), i128::from(self.counts));
        // Rounded up from just above a half, in halves of a step.
        let magnitude = (i128::from(digits).abs() * counts * 2 + steps - 1) / (steps * 2);
        signed(magnitude, digits < 0)
    }

    /// `number` in counts: those nearest to it. A number with more digits than the scale has lies between two.
    pub(crate) fn count(self, number: &Decimal) -> Counts {
        match number.counts(self.decimals) {
            Counts::Whole(digits) => Counts::Whole(self.nearest(digits)),
            Counts::Above(digits) => Counts::Above(self.last_up_to(digits)),
            far => far,
        }
    }

    /// The greatest count that does not read as more than `digits`.
    fn last_up_to(self, digits: i64) -> i64 {
        let near = self.nearest(digits);
        // What reads the same as the nearest count, or less, is that count or the one before.
        if self.digits(near) <= digits { near } else { near - 1 }
    }

    /// Units × 10^decimals: the steps of the last digit in `counts` counts.
    fn steps(self) -> i128 {
        i128::from(self.units) * 10_i128.pow(self.decimals.into())
    }
}

fn greatest_common_divisor(mut one: u64, mut other: u64) -> u64 {
    while other != 0 {
        (one, other) = (other, one % other);
    }
    one
}

/// What is beyond every word stays beyond it.
fn signed(magnitude: i128, negative: bool) -> i64 {
    let magnitude = i64::try_from(magnitude).unwrap_or(i64::MAX);
    if negative { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Scale;
    use crate::decimal::{Counts, Decimal};

    fn scale(text: &str) -> Scale {
        Scale::parse(text).unwrap()
    }

    fn count(scale: Scale, text: &str) -> Counts {
        scale.count(&Decimal::parse(text).unwrap())
    }

    #[test]
    fn a_scale_is_a_power_of_ten_or_a_ratio() {
        // Counts and units, and the digits that tell every count from the next: 16384/100 is 163.84 counts for one unit, so
        // a count is 0.0061 units.
        for (text, ratio, decimals) in [
            ("1", (1, 1), 0),
            ("10000", (10_000, 1), 4),
            ("16384/100", (4_096, 25), 3),
            ("16384/50", (8_192, 25), 3),
            ("20000/100", (200, 1), 3),
            ("20000/50", (400, 1), 3),
            ("1000/10", (100, 1), 2),
            ("100/100", (1, 1), 0),
            ("1/10", (1, 10), 0),
            ("2/3", (2, 3), 0),
            ("65535/1", (65_535, 1), 5),
            ("1/65535", (1, 65_535), 0),
            ("3/2", (3, 2), 1),
        ] {
            assert_eq!((scale(text).as_ratio(), scale(text).decimals()), (ratio, decimals), "{text}");
        }
        assert_eq!(scale("1000/10"), scale("100"));
        assert!(scale("100").is_decimal() && !scale("20000/100").is_decimal() && !scale("1/10").is_decimal());
        for text in ["", "2", "16384", "100000", "0", "0/1", "1/0", "65536/1", "1/65536", "-1/2", "1.5/2", "1/2/3", "/"]
        {
            assert_eq!(Scale::parse(text), None, "{text}");
        }
    }

    #[test]
    fn shares_of_a_range_are_rounded_to_what_tells_counts_apart() {
        // count / 163.84, worked out by hand.
        let percent = scale("16384/100");
        for (count, digits) in [(0, 0), (1, 6), (-1, -6), (8_192, 50_000), (16_384, 100_000), (32_767, 199_994)] {
            assert_eq!(percent.digits(count), digits, "{count}");
        }
        assert_eq!(percent.digits(-16_384), -100_000);
        // 33.333 × 163.84 = 5461.28; 0.003 × 163.84 = 0.49; 0.004 × 163.84 = 0.66.
        for (text, whole) in
            [("33.333", 5_461), ("0.003", 0), ("0.004", 1), ("-0.004", -1), ("1e2", 16_384), ("-50", -8_192)]
        {
            assert_eq!(count(percent, text), Counts::Whole(whole), "{text}");
        }
        // 50.0001 lies between 8192 counts, 50.000, and 8193, 50.006. -0.0001 lies between -1 and 0.
        assert_eq!(count(percent, "50.0001"), Counts::Above(8_192));
        assert_eq!(count(percent, "-0.0001"), Counts::Above(-1));
        assert_eq!(count(percent, "50.0059"), Counts::Above(8_192));
        assert_eq!(count(percent, "50.0061"), Counts::Above(8_193));
        assert_eq!(count(percent, "1e99"), Counts::FarAbove);
    }

    #[test]
    fn of_two_counts_as_near_the_smaller_is_taken() {
        // One count is 10 units: 5 is as near to 0 as to 10. One is 0.005 units: 0.0025 has too many digits, so no tie.
        let tens = scale("1/10");
        for (text, whole) in [("5", 0), ("6", 1), ("15", 1), ("16", 2), ("-5", 0), ("-6", -1), ("-15", -1), ("-16", -2)]
        {
            assert_eq!(count(tens, text), Counts::Whole(whole), "{text}");
        }
        assert_eq!((tens.digits(7), tens.digits(-7)), (70, -70));
        // And of two digits as near the greater: 2 counts of 16/10 are 1.25, 3 are 1.875.
        let tenths = scale("16/10");
        assert_eq!([1, 2, 3, -1, -2].map(|count| tenths.digits(count)), [6, 13, 19, -6, -13]);
    }

    proptest! {
        #[test]
        fn every_ratio_goes_around(counts in 1_u32..=65_535, units in 1_u32..=65_535, raw in -65_535_i64..=65_535) {
            let scale = Scale::parse(&format!("{counts}/{units}")).unwrap();
            let digits = scale.digits(raw);
            prop_assert_eq!(scale.nearest(digits), raw);
            // Every count reads as more than the one before.
            prop_assert!(digits < scale.digits(raw + 1));
            prop_assert_eq!(scale.digits(-raw), -digits);
        }

        #[test]
        fn a_value_is_at_most_half_a_count_from_its_count(
            counts in 1_u32..=65_535, units in 1_u32..=65_535, digits in -10_000_000_i64..10_000_000,
        ) {
            let scale = Scale::parse(&format!("{counts}/{units}")).unwrap();
            let count = scale.nearest(digits);
            // In steps of the last digit, times 2 × counts: |digits - count × steps / counts| ≤ steps / counts / 2.
            let (counts, units) = (i128::from(counts), i128::from(units));
            let steps = units * 10_i128.pow(scale.decimals().into());
            let off = i128::from(digits) * counts - i128::from(count) * steps;
            prop_assert!(off.abs() * 2 <= steps);
            let next = scale.nearest(digits + 1);
            prop_assert!(count <= next);
            // What lies between two values has both as its neighbours.
            let last = scale.last_up_to(digits);
            prop_assert!(scale.digits(last) <= digits && digits < scale.digits(last + 1));
        }

        #[test]
        fn one_digit_less_would_not_tell_all_counts_apart(counts in 1_u32..=65_535, units in 1_u32..=65_535) {
            let scale = Scale::parse(&format!("{counts}/{units}")).unwrap();
            if let Some(fewer) = scale.decimals().checked_sub(1) {
                let coarse = Scale { decimals: fewer, ..scale };
                prop_assert!((0..65_535).any(|raw| coarse.digits(raw) == coarse.digits(raw + 1)));
            }
        }
    }
}
