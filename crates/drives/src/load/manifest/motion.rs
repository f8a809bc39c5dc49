//! The shape of the tables that say how the motor is moved: commands, states, what must be set before, setpoints, and what
//! happens when the bus falls silent.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{Error, MapAccess, Unexpected, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};

use super::{Placed, yes};
use crate::parts::command::Command;
use crate::parts::state::State;

/// What makes the motor move.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Commands {
    /// Where commands are written.
    pub(in crate::load) register: Placed<String>,
    /// Every register whose write can start a motor, that one among them.
    pub(in crate::load) moves: Vec<Placed<String>>,
    /// What each word has that is given as a table of bit fields, beside those.
    pub(in crate::load) base: Option<Placed<Word>>,
    /// The words.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "super::schema::table::<Command, Word>"))]
    pub(in crate::load) codes: BTreeMap<Command, Placed<Word>>,
    pub(in crate::load) assumed: Option<AssumedCommands>,
    /// The words that come, in this order, before one that runs or jogs a motor at rest.
    #[serde(default)]
    pub(in crate::load) sequence: Vec<Placed<SequenceWord>>,
    /// Commands that another register takes.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "super::schema::table::<Command, Elsewhere>"))]
    pub(in crate::load) elsewhere: BTreeMap<Command, Elsewhere>,
    /// What is written, once, before the word of a command: the direction, where one register says whether the motor runs
    /// and another which way.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "super::schema::table::<Command, Elsewhere>"))]
    pub(in crate::load) first: BTreeMap<Command, Elsewhere>,
    /// Words that mean something else: `"9" = "immediate stop"`.
    #[serde(default)]
    pub(in crate::load) other: BTreeMap<Placed<String>, String>,
    /// Where it is printed: document and page.
    #[serde(rename = "source")]
    _source: String,
}

/// A whole word: a number, or what its bit fields hold. Bits that no field names are 0, or those of `base`.
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(untagged))]
pub(in crate::load) enum Word {
    /// The word itself.
    Number(u16),
    /// Names of bits, and what they hold.
    Fields(BTreeMap<String, u16>),
}

impl<'de> Deserialize<'de> for Word {
    fn deserialize<D: Deserializer<'de>>(word: D) -> Result<Self, D::Error> {
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = Word;

            fn expecting(&self, what: &mut fmt::Formatter<'_>) -> fmt::Result {
                what.write_str("a number, 0 to 65535, or a table of bit fields")
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Word, E> {
                let whole = u16::try_from(number);
                whole.map(Word::Number).map_err(|_| E::invalid_value(Unexpected::Signed(number), &"u16"))
            }

            fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<Word, A::Error> {
                BTreeMap::deserialize(MapAccessDeserializer::new(fields)).map(Word::Fields)
            }
        }

        word.deserialize_any(Either)
    }
}

/// A word that comes before one that runs the motor.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct SequenceWord {
    /// The word.
    pub(in crate::load) word: Placed<Word>,
    /// What it does.
    pub(in crate::load) label: String,
    /// Bits of the state word, and what they must hold before the next word goes out.
    pub(in crate::load) until: BTreeMap<String, u16>,
}

/// A command in a register of its own, or what comes before one.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Elsewhere {
    /// Where it is written; it must stand in `moves` too.
    pub(in crate::load) register: Placed<String>,
    /// The word.
    pub(in crate::load) code: Placed<Word>,
}

/// Commands that no document of the family prints.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct AssumedCommands {
    /// Why they are thought to be right.
    pub(in crate::load) reason: Placed<String>,
    /// The words.
    #[cfg_attr(test, schemars(schema_with = "super::schema::table::<Command, Word>"))]
    pub(in crate::load) codes: BTreeMap<Command, Placed<Word>>,
}

/// What the motor does: by a number, or by bits.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct States {
    /// Where it stands.
    pub(in crate::load) register: Placed<String>,
    /// The words.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "super::schema::table::<State, u16>"))]
    pub(in crate::load) codes: BTreeMap<State, Placed<u16>>,
    /// By bits: the first that fits.
    #[serde(default)]
    pub(in crate::load) when: Vec<Placed<When>>,
    /// What each other word means, such as `"running"` where the register counts how fast the motor turns.
    pub(in crate::load) otherwise: Option<State>,
    /// Whether a motor only rests once its output frequency is zero, too: the word may say so while it slows down.
    #[serde(default)]
    pub(in crate::load) rest_by_frequency: bool,
    /// Whether a document of this very family prints it.
    #[serde(default = "yes")]
    pub(in crate::load) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(in crate::load) note: String,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// A state that is told by bit fields.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct When {
    /// The state.
    #[serde(rename = "is")]
    pub(in crate::load) state: State,
    /// Names of bits, and what they hold then.
    pub(in crate::load) fields: BTreeMap<String, u16>,
}

/// A parameter, and what it must be.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Control {
    /// Its code; a register by its name.
    pub(in crate::load) code: String,
    /// The highest and the lowest of the bits that count, where the others are somebody else's; it is then not set from here.
    pub(in crate::load) bits: Option<[u8; 2]>,
    /// The value, in counts; that of the bits, where there are any.
    pub(in crate::load) value: i64,
    /// What that means.
    pub(in crate::load) label: String,
    /// Whether it is asked before each start, also where the drive says itself that it obeys the bus.
    #[serde(default)]
    pub(in crate::load) always: bool,
    /// Whether setting it does more than make the drive obey, so that `prepare` leaves it to who asks for it by name.
    #[serde(default)]
    pub(in crate::load) by_hand: bool,
    /// Other values, in counts, with which the words of commands mean what they mean with this one.
    #[serde(default)]
    pub(in crate::load) same: Vec<i64>,
    /// Values with which the words of commands mean something else. Where there is one, the parameter is read before the first command.
    #[serde(default)]
    pub(in crate::load) otherwise: Vec<Placed<OtherWords>>,
    /// Whether a document of this very family prints it.
    pub(in crate::load) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(in crate::load) note: String,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// A value of a parameter with which the words of commands mean something else.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct OtherWords {
    /// The value, in counts.
    pub(in crate::load) value: i64,
    /// What the words mean then.
    pub(in crate::load) means: String,
    /// The word that stops the motor then.
    pub(in crate::load) stop: Option<u16>,
    /// The word that lets it coast then; without it, that of `stop`.
    pub(in crate::load) coast: Option<u16>,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// One setpoint.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct SetpointRole {
    /// Where it is written.
    pub(in crate::load) register: Placed<String>,
    /// What must be set before the drive follows it.
    #[serde(default)]
    pub(in crate::load) needs: Vec<Placed<Control>>,
}

/// A parameter that decides what some registers mean.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Variant {
    /// The parameter that decides.
    pub(in crate::load) parameter: Placed<String>,
    /// By name, such as `Hz`; or `share`.
    #[serde(default)]
    pub(in crate::load) choices: BTreeMap<String, Placed<VariantChoice>>,
    /// Of what the parameter says, whatever that is; or `choices`.
    pub(in crate::load) share: Option<Placed<VariantShare>>,
    /// Whether a document of this very family prints it.
    pub(in crate::load) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(in crate::load) note: String,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// A share of what the parameter says, in its unit.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct VariantShare {
    /// The counts of the register that are as much as the parameter says.
    pub(in crate::load) counts: u16,
    /// Whether the word is two's complement.
    #[serde(default)]
    pub(in crate::load) signed: bool,
    /// The least that the parameter may say, above 0: with less the drive is refused.
    pub(in crate::load) low: f64,
    /// The most that it may say.
    pub(in crate::load) high: f64,
}

/// What a register means with this choice.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct VariantChoice {
    /// What the parameter is then, in counts.
    pub(in crate::load) value: u16,
    /// The unit; empty for a plain number.
    #[serde(default)]
    pub(in crate::load) unit: String,
    /// Counts in one unit: 1, 10, 100, 1000 or 10000; or so many counts in so many units, as text: `"16384/100"`.
    pub(in crate::load) scale: Scale,
    /// Whether the word is two's complement.
    #[serde(default)]
    pub(in crate::load) signed: bool,
    /// The lowest value, in the unit.
    pub(in crate::load) low: Option<f64>,
    /// The highest value, in the unit.
    pub(in crate::load) high: Option<f64>,
}

/// Counts in one unit, or in several.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[cfg_attr(test, schemars(inline))]
#[serde(untagged, expecting = "scale must be a number, or a ratio as text such as \"16384/100\"")]
pub(in crate::load) enum Scale {
    Number(u32),
    Ratio(String),
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(counts) => write!(f, "{counts}"),
            Self::Ratio(text) => write!(f, "\"{text}\""),
        }
    }
}

/// What makes the drive act by itself when the bus falls silent.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Watchdog {
    /// The parameter with the time.
    pub(in crate::load) timeout: Placed<String>,
    /// The parameter with what it does then. Without it, the drive trips, and something else decides what that does.
    pub(in crate::load) action: Option<Placed<String>>,
    /// What the action must be so that it coasts, in counts.
    pub(in crate::load) coast: Option<Placed<i64>>,
    /// What the action must be so that it stops, in counts.
    pub(in crate::load) stop: Option<Placed<i64>>,
    /// What the action must be so that it trips, and nothing else, in counts. Without it, a coast trips, too.
    pub(in crate::load) trip: Option<Placed<i64>>,
    /// The number of the fault that it trips.
    pub(in crate::load) fault: Option<u16>,
    /// Whether a document of this very family prints it.
    pub(in crate::load) verified: bool,
    /// What to know about it; where it is not verified, why.
    #[serde(default)]
    pub(in crate::load) note: String,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// What a drive wants to be told before it takes what is written to it.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct Unlock {
    /// The register that takes the word. It moves no motor.
    pub(in crate::load) register: Placed<String>,
    /// What is written there.
    pub(in crate::load) word: u16,
    /// The exception by which a drive that is locked refuses a write.
    pub(in crate::load) exception: u8,
    /// The word by which a drive shows, each time, that it is one of this family: no other gets the one that unlocks.
    pub(in crate::load) shown_by: ShownBy,
    /// Where it is printed: document and page.
    pub(in crate::load) source: String,
}

/// A word that no other drive has there.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::load) struct ShownBy {
    /// Where it is read.
    pub(in crate::load) register: Placed<String>,
    /// What it is.
    pub(in crate::load) word: u16,
}
