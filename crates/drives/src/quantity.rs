//! Quantities: what a word measures, counts or names, and exact conversion both ways.
//!
//! Knows one value at a time; knows nothing of addresses or of who may write.

use std::collections::BTreeMap;

use crate::decimal::{Counts, Decimal};
use crate::scale::Scale;
use crate::text::{closest, parse_address};
use crate::value::{Input, Limits, Value, ValueError, to_word};

/// What a word means: counts of a [`unit`](Self::unit), within a range, or one of some choices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    pub(crate) unit: String,
    pub(crate) scale: Option<Scale>,
    pub(crate) signed: bool,
    /// Whether it takes two words.
    pub(crate) wide: bool,
    /// Of two words: whether the high one comes first.
    pub(crate) high_first: bool,
    /// In counts, as `high`.
    pub(crate) low: Option<i64>,
    pub(crate) high: Option<i64>,
    pub(crate) low_from: Option<String>,
    pub(crate) high_from: Option<String>,
    pub(crate) choices: BTreeMap<u16, String>,
    /// What decides unit, scale and range.
    pub(crate) variant: Option<String>,
}

impl Quantity {
    /// The unit of its values: `"Hz"`, `"A"`, `"%"` …; empty for plain numbers and choices; `"raw"` where the scale is
    /// not known and values are counts.
    pub fn unit(&self) -> &str {
        if self.scale.is_some() { &self.unit } else { "raw" }
    }

    /// Counts per unit (1, 10, 100 …). `None` where the manuals do not say: then values are counts; and where it is not a power
    /// of ten: [`ratio`](Self::ratio) has every scale.
    pub fn scale(&self) -> Option<u32> {
        self.scale.filter(|scale| scale.is_decimal()).map(|scale| scale.as_ratio().0)
    }

    /// So many counts are so many units, without a common divisor: (100, 1), or (4096, 25) where 16384 counts are 100 %.
    /// `None` where the manuals do not say: then values are counts.
    pub fn ratio(&self) -> Option<(u32, u32)> {
        self.scale.map(Scale::as_ratio)
    }

    /// Digits after the point of every value.
    pub fn decimals(&self) -> u8 {
        self.scale_or_one().decimals()
    }

    /// How many words it takes: 1, or 2, whose order [`is_high_first`](Self::is_high_first) tells.
    pub fn words(&self) -> u16 {
        if self.wide { 2 } else { 1 }
    }

    /// Whether the high word comes first, where it takes two.
    pub fn is_high_first(&self) -> bool {
        self.high_first
    }

    /// The [variant](crate::Variant) that decides unit, scale and range, if one does.
    pub fn variant(&self) -> Option<&str> {
        self.variant.as_deref()
    }

    /// Whether a variant decides what it is, and nobody has said which: then values are counts, and none can be encoded.
    pub fn is_undecided(&self) -> bool {
        self.variant.is_some() && self.scale.is_none()
    }

    /// Whether words are two's complement.
    pub fn is_signed(&self) -> bool {
        self.signed
    }

    /// Whether its values are measures (with a unit or a fraction), as opposed to counts, choices and bits.
    pub fn measures(&self) -> bool {
        self.scale.is_some_and(|scale| scale != Scale::ONE || !self.unit.is_empty())
    }

    /// The lowest value allowed, where it is documented.
    pub fn low(&self) -> Option<Value> {
        self.low.map(|count| self.value(count))
    }

    /// The highest value allowed, where it is documented.
    pub fn high(&self) -> Option<Value> {
        self.high.map(|count| self.value(count))
    }

    /// The parameter that bounds it from below on a given drive, beside [`low`](Self::low): its code.
    pub fn low_from(&self) -> Option<&str> {
        self.low_from.as_deref()
    }

    /// The parameter that bounds it from above on a given drive, beside [`high`](Self::high): its code.
    pub fn high_from(&self) -> Option<&str> {
        self.high_from.as_deref()
    }

    /// The choices that are documented, by word. Others may exist.
    pub fn choices(&self) -> &BTreeMap<u16, String> {
        &self.choices
    }

    /// The value of `raw`. Every word has one, in range or not.
    pub fn decode(&self, raw: u16) -> Value {
        self.value(if self.signed { i64::from(raw.cast_signed()) } else { i64::from(raw) })
    }

    /// The value of `words`, which has [as many](Self::words) as it takes, in the order of their addresses; `None` if it has not.
    pub fn decode_words(&self, words: &[u16]) -> Option<Value> {
        (words.len() == usize::from(self.words())).then(|| self.decode_raw(self.raw(words)))
    }

    /// The bits of all its `words`, which stand in the order of their addresses.
    pub fn raw(&self, words: &[u16]) -> u32 {
        let behind = |high: u32, &low: &u16| high << 16 | u32::from(low);
        if self.high_first { words.iter().fold(0, behind) } else { words.iter().rev().fold(0, behind) }
    }

    /// The value of the bits of all its words; of one word, of the low ones.
    pub fn decode_raw(&self, raw: u32) -> Value {
        match (self.wide, self.signed) {
            (false, _) => self.decode(to_word(raw.into())),
            (true, false) => self.value(raw.into()),
            (true, true) => self.value(raw.cast_signed().into()),
        }
    }

    /// The word for `input`, of a value that has one; `name` is for the error.
    pub(crate) fn encode(&self, name: &str, input: &Input<'_>) -> Result<u16, ValueError> {
        if self.wide {
            return Err(ValueError::TwoWords { name: name.to_owned() });
        }
        self.encode_count(name, input).map(to_word)
    }

    /// The words for `input`, in the order of their addresses; `name` is for the error.
    pub(crate) fn encode_words(&self, name: &str, input: &Input<'_>) -> Result<Vec<u16>, ValueError> {
        let count = self.encode_count(name, input)?;
        Ok(match (self.wide, self.high_first) {
            (false, _) => vec![to_word(count)],
            (true, false) => vec![to_word(count), to_word(count >> 16)],
            (true, true) => vec![to_word(count >> 16), to_word(count)],
        })
    }

    /// The count for `input`, which the words hold.
    fn encode_count(&self, name: &str, input: &Input<'_>) -> Result<i64, ValueError> {
        if let Some(variant) = self.variant.as_ref().filter(|_| self.is_undecided()) {
            return Err(ValueError::Undecided {
                name: name.to_owned(),
                value: input.to_string(),
                variant: variant.clone(),
            });
        }
        let counts = self.counts(name, input)?;
        let (low, high) = self.bounds();
        let within = |count: i64| low <= count && count <= high;
        match counts {
            // A count within bounds fits the words: the loader checked the bounds.
            Counts::Whole(count) if within(count) => Ok(count),
            Counts::Above(floor) if within(floor) && within(floor + 1) => Err(ValueError::SurplusDigits {
                name: name.to_owned(),
                value: input.to_string(),
                unit: self.unit().to_owned(),
                below: self.value(floor),
                above: self.value(floor + 1),
            }),
            _ => Err(ValueError::OutOfRange {
                name: name.to_owned(),
                value: input.to_string(),
                limits: Box::new(Limits {
                    unit: self.unit().to_owned(),
                    low: self.value(low),
                    high: self.value(high),
                    low_from: self.low_from.clone(),
                    high_from: self.high_from.clone(),
                }),
            }),
        }
    }

    /// `input` in counts, whatever the range.
    fn counts(&self, name: &str, input: &Input<'_>) -> Result<Counts, ValueError> {
        let text = match input {
            Input::Integer(number) => number.to_string(),
            // `{:?}` prints the shortest digits that read back as the same float.
            Input::Float(number) => format!("{number:?}"),
            Input::Text(text) | Input::Decimal(text) => text.trim().to_owned(),
        };
        // A label comes first: the format 8E1 also reads as the number 80. The loader made sure that no label is the
        // number of another choice.
        if matches!(input, Input::Text(_))
            && let Some((&word, _)) = self.choices.iter().find(|(_, label)| label.eq_ignore_ascii_case(&text))
        {
            return Ok(Counts::Whole(i64::from(word)));
        }
        if let Some(number) = Decimal::parse(&text) {
            return Ok(self.counts_of(&number));
        }
        if let Some(word) = parse_address(&text).filter(|_| !self.measures()) {
            return Ok(Counts::Whole(i64::from(word)));
        }
        let (name, value) = (name.to_owned(), input.to_string());
        Err(match closest(&text, self.choices.values().map(String::as_str)) {
            Some(closest) => ValueError::UnknownChoice {
                name,
                value,
                closest: closest.to_owned(),
                choices: self.choices.iter().map(|(number, label)| format!("{number} = {label}")).collect(),
            },
            None => ValueError::NotANumber { name, value, unit: self.unit().to_owned() },
        })
    }

    /// The lowest and the highest count: as documented, or what a word can hold.
    fn bounds(&self) -> (i64, i64) {
        let (least, most) = limits(self.signed, self.wide);
        (self.low.unwrap_or(least), self.high.unwrap_or(most))
    }

    /// The counts that are nearest to `number` of units, whatever the range.
    pub(crate) fn counts_of(&self, number: &Decimal) -> Counts {
        self.scale_or_one().count(number)
    }

    fn scale_or_one(&self) -> Scale {
        self.scale.unwrap_or(Scale::ONE)
    }

    pub(crate) fn value(&self, count: i64) -> Value {
        Value::new(count, self.scale_or_one())
    }
}

/// The least and the greatest count that a word holds, or two.
pub(crate) fn limits(signed: bool, wide: bool) -> (i64, i64) {
    match (signed, wide) {
        (true, false) => (i64::from(i16::MIN), i64::from(i16::MAX)),
        (false, false) => (0, i64::from(u16::MAX)),
        (true, true) => (i64::from(i32::MIN), i64::from(i32::MAX)),
        (false, true) => (0, i64::from(u32::MAX)),
    }
}
