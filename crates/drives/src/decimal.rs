//! Numbers exactly as they were written, and their product with a power of ten.
//!
//! Knows digits; knows nothing of words, units or ranges.

/// A decimal number of any length: `0.d₁d₂d₃… × 10^point`, without leading or trailing zeros among the digits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Decimal {
    negative: bool,
    digits: Vec<u8>,
    point: i64,
}

/// A number times a power of ten, as far as whole counts can say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Counts {
    /// A whole number of counts.
    Whole(i64),
    /// Between this whole number of counts and the next.
    Above(i64),
    /// Too far below zero for any word.
    FarBelow,
    /// Too far above zero for any word.
    FarAbove,
}

/// More digits than this before the point are far outside every word, and still fit an `i64`.
const MOST_DIGITS: i64 = 12;

/// Exponents beyond this all mean the same: far outside, or next to nothing.
const MOST_EXPONENT: i64 = 1_000_000;

impl Decimal {
    /// `number` by its shortest digits that read back as the same float; `None` for what is no number.
    pub(crate) fn of_float(number: f64) -> Option<Self> {
        Self::parse(&format!("{number:?}"))
    }

    /// Reads `text`: an optional sign, digits with at most one point, an optional exponent. `None` for anything else.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (negative, text) = match text.as_bytes().first()? {
            b'-' => (true, &text[1..]),
            b'+' => (false, &text[1..]),
            _ => (false, text),
        };
        let (mantissa, exponent) = match text.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, parse_exponent(exponent)?),
            None => (text, 0),
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let all: Vec<u8> = whole.bytes().chain(fraction.bytes()).collect();
        if all.is_empty() || !all.iter().all(u8::is_ascii_digit) {
            return None;
        }
        let leading = all.iter().take_while(|&&digit| digit == b'0').count();
        let significant = all.iter().rposition(|&digit| digit != b'0').map_or(leading, |last| last + 1);
        let digits: Vec<u8> = all[leading..significant].iter().map(|digit| digit - b'0').collect();
        let point = signed(whole.len()) - signed(leading) + exponent;
        Some(Self { negative: negative && !digits.is_empty(), digits, point })
    }

    /// This number × 10^`decimals`.
    pub(crate) fn counts(&self, decimals: u8) -> Counts {
        if self.digits.is_empty() {
            return Counts::Whole(0);
        }
        let before_point = self.point + i64::from(decimals);
        if before_point > MOST_DIGITS {
            return if self.negative { Counts::FarBelow } else { Counts::FarAbove };
        }
        let whole_digits = usize::try_from(before_point).unwrap_or(0);
        let padded = self.digits.iter().copied().chain(std::iter::repeat(0));
        let magnitude = padded.take(whole_digits).fold(0_i64, |sum, digit| sum * 10 + i64::from(digit));
        let exact = self.digits.len() <= whole_digits;
        match (exact, self.negative) {
            (true, false) => Counts::Whole(magnitude),
            (true, true) => Counts::Whole(-magnitude),
            (false, false) => Counts::Above(magnitude),
            (false, true) => Counts::Above(-magnitude - 1),
        }
    }
}

/// The exponent after `e`, cut to ±[`MOST_EXPONENT`].
fn parse_exponent(text: &str) -> Option<i64> {
    let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    // Only overflow can fail here, and every exponent that overflows is cut anyway.
    let magnitude = digits.parse().unwrap_or(MOST_EXPONENT).min(MOST_EXPONENT);
    Some(if text.starts_with('-') { -magnitude } else { magnitude })
}

/// Lengths of text fit an `i64`.
fn signed(length: usize) -> i64 {
    i64::try_from(length).unwrap_or(i64::MAX / 2)
}

#[cfg(test)]
mod tests {
    use super::{Counts, Decimal};

    fn counts(text: &str, decimals: u8) -> Option<Counts> {
        Decimal::parse(text).map(|number| number.counts(decimals))
    }

    #[test]
    fn digits_shift_by_the_scale_and_nothing_is_rounded() {
        for (text, decimals, expected) in [
            ("0", 2, Counts::Whole(0)),
            ("-0.000", 2, Counts::Whole(0)),
            ("0.57", 2, Counts::Whole(57)),
            ("+50.12", 2, Counts::Whole(5012)),
            ("5", 1, Counts::Whole(50)),
            ("5.", 1, Counts::Whole(50)),
            (".5", 1, Counts::Whole(5)),
            ("-12.50", 1, Counts::Whole(-125)),
            ("1e2", 1, Counts::Whole(1000)),
            ("1.5E-1", 2, Counts::Whole(15)),
            ("007", 0, Counts::Whole(7)),
            ("10.005", 2, Counts::Above(1000)),
            ("-10.005", 2, Counts::Above(-1001)),
            ("0.001", 2, Counts::Above(0)),
            ("-0.001", 2, Counts::Above(-1)),
            ("1e-999999999999999999999", 2, Counts::Above(0)),
            ("1e308", 0, Counts::FarAbove),
            ("-1e999999999999999999999", 0, Counts::FarBelow),
            ("0e999999999", 0, Counts::Whole(0)),
            ("0.00000000000000000000000000000000000000001", 4, Counts::Above(0)),
        ] {
            assert_eq!(counts(text, decimals), Some(expected), "{text} with {decimals} decimals");
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in
            ["", "-", "+", ".", "e5", "1e", "1e+", "1.2.3", "1,5", "NaN", "inf", "-inf", "0x10", "1 2", "١", "--1"]
        {
            assert_eq!(counts(text, 0), None, "{text:?}");
        }
    }
}
