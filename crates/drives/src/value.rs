//! Values: as a drive means them, as a caller gives them, and why one cannot be the other.

use std::fmt;

use crate::scale::Scale;

/// A value as a decimal number, and the counts that it is. `Display` prints every decimal: `10.00`.
///
/// It is exact where there are so many counts to a unit as a power of ten says. Else it has as many digits as tell it from
/// the values of the counts beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Value {
    count: i64,
    scale: Scale,
}

impl Value {
    pub(crate) fn new(count: i64, scale: Scale) -> Self {
        Self { count, scale }
    }

    /// The counts of the drive, with their sign: what its word is, and not the value where there is a scale.
    pub fn count(self) -> i64 {
        self.count
    }

    /// The low word of the counts, in two's complement: of one word, that word.
    pub fn word(self) -> u16 {
        to_word(self.count)
    }

    /// The float closest to this value. It prints with no more digits than the value has.
    pub fn to_f64(self) -> f64 {
        // 49 bits at most, so both are exact and the one division is correctly rounded.
        #[expect(clippy::cast_precision_loss, reason = "32 bits of counts, and at most 16 and a few for the scale")]
        let digits = self.scale.digits(self.count) as f64;
        digits / f64::from(10_u32.pow(u32::from(self.scale.decimals())))
    }
}

/// The low word of `count`, in two's complement.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low 16 bits are the word")]
pub(crate) fn to_word(count: i64) -> u16 {
    count as u16
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (digits, decimals) = (self.scale.digits(self.count), self.scale.decimals());
        let tens = 10_u64.pow(u32::from(decimals));
        let magnitude = digits.unsigned_abs();
        let sign = if digits < 0 { "-" } else { "" };
        if decimals == 0 {
            return write!(f, "{sign}{magnitude}");
        }
        write!(f, "{sign}{}.{:0width$}", magnitude / tens, magnitude % tens, width = usize::from(decimals))
    }
}

/// A value as a caller gives it.
///
/// A float counts by its shortest decimal form: `0.57` is 57 hundredths, exactly. Text is the label of a choice in upper
/// or lower case, a decimal number (`"12.50"`, `"1e2"`), or, for what is not measured, hex (`"0x3F"`).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Input<'a> {
    /// A whole number of units.
    Integer(i64),
    /// A number of units.
    Float(f64),
    /// A number of units, or a choice.
    Text(&'a str),
    /// A number of units from a decimal type, in its text form. Never a choice.
    Decimal(&'a str),
}

/// An [`Input`] that is kept.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum OwnedInput {
    /// See [`Input::Integer`].
    Integer(i64),
    /// See [`Input::Float`].
    Float(f64),
    /// See [`Input::Text`].
    Text(String),
    /// See [`Input::Decimal`].
    Decimal(String),
}

impl OwnedInput {
    /// What it gives.
    pub fn input(&self) -> Input<'_> {
        match self {
            Self::Integer(number) => Input::Integer(*number),
            Self::Float(number) => Input::Float(*number),
            Self::Text(text) => Input::Text(text),
            Self::Decimal(digits) => Input::Decimal(digits),
        }
    }
}

impl From<Input<'_>> for OwnedInput {
    fn from(input: Input<'_>) -> Self {
        match input {
            Input::Integer(number) => Self::Integer(number),
            Input::Float(number) => Self::Float(number),
            Input::Text(text) => Self::Text(text.to_owned()),
            Input::Decimal(digits) => Self::Decimal(digits.to_owned()),
        }
    }
}

impl From<i32> for Input<'_> {
    fn from(number: i32) -> Self {
        Self::Integer(i64::from(number))
    }
}

impl From<i64> for Input<'_> {
    fn from(number: i64) -> Self {
        Self::Integer(number)
    }
}

impl From<f64> for Input<'_> {
    fn from(number: f64) -> Self {
        Self::Float(number)
    }
}

impl<'a> From<&'a str> for Input<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(text)
    }
}

impl fmt::Display for Input<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Longer text is cut in messages.
        const SHOWN: usize = 60;
        match self {
            Self::Integer(number) => write!(f, "{number}"),
            Self::Float(number) => write!(f, "{number:?}"),
            Self::Text(text) | Self::Decimal(text) if text.chars().count() > SHOWN => {
                write!(f, "{}…", text.chars().take(SHOWN).collect::<String>())
            }
            Self::Text(text) | Self::Decimal(text) => f.write_str(text),
        }
    }
}

/// Why a value cannot be a word of its quantity. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// The value is no number, and the quantity has no choices.
    #[error("{name} = {value}: not a number{}", in_unit(unit))]
    NotANumber {
        /// What was to be set.
        name: String,
        /// The value as given.
        value: String,
        /// The unit of the quantity; may be empty.
        unit: String,
    },
    /// The value is neither a number nor one of the choices.
    #[error("{name} = {value}: neither a number nor a known choice; {}", known_choices(closest, choices))]
    UnknownChoice {
        /// What was to be set.
        name: String,
        /// The value as given.
        value: String,
        /// The label closest to it.
        closest: String,
        /// The choices, each with its number: `2 = communication`.
        choices: Vec<String>,
    },
    /// The value takes two words, and can only be read.
    #[error("{name} takes two words, and can only be read")]
    TwoWords {
        /// What was to be set.
        name: String,
    },
    /// A parameter of the drive decides what the register means, and nobody has said which it is.
    #[error("{name} = {value}: its unit depends on the setting \"{variant}\" of the drive, which is not known here")]
    Undecided {
        /// What was to be set.
        name: String,
        /// The value as given.
        value: String,
        /// The variant.
        variant: String,
    },
    /// The value lies outside the range.
    #[error("{name} = {value}{}: out of range, allowed is {limits}", spaced(&limits.unit))]
    OutOfRange {
        /// What was to be set.
        name: String,
        /// The value as given.
        value: String,
        /// What is allowed.
        limits: Box<Limits>,
    },
    /// The value is finer than the drive's steps.
    #[error(
        "{name} = {value}{}: finer than the drive counts; the nearest allowed are {below} and {above}{}",
        spaced(unit),
        spaced(unit)
    )]
    SurplusDigits {
        /// What was to be set.
        name: String,
        /// The value as given.
        value: String,
        /// The unit of the quantity; may be empty.
        unit: String,
        /// The next allowed value below.
        below: Value,
        /// The next allowed value above.
        above: Value,
    },
}

fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

fn in_unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!("; give it in {unit}") }
}

/// Choices that a message lists at most.
const LISTED: usize = 12;

fn known_choices(closest: &str, choices: &[String]) -> String {
    if choices.len() > LISTED {
        format!("the closest is \"{closest}\"")
    } else {
        format!("known: {}", choices.join(", "))
    }
}

/// The values that a quantity allows.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// The unit of the quantity; may be empty.
    pub unit: String,
    /// The lowest value allowed.
    pub low: Value,
    /// The highest value allowed.
    pub high: Value,
    /// The parameter that may raise `low` on a given drive.
    pub low_from: Option<String>,
    /// The parameter that may lower `high` on a given drive.
    pub high_from: Option<String>,
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}{}", self.low, self.high, spaced(&self.unit))?;
        match (&self.low_from, &self.high_from) {
            (None, None) => Ok(()),
            (Some(code), None) => write!(f, ", and not below {code}"),
            (None, Some(code)) => write!(f, ", and not above {code}"),
            (Some(low), Some(high)) => write!(f, ", and between {low} and {high}"),
        }
    }
}
