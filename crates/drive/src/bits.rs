//! Words whose bits are things of their own: terminals as the bus gives them, and the special control word.
//!
//! They are given by the names that the profile has for the bits. Words that can move a motor are sent once and never
//! repeated, under the checks of a start.

use std::collections::BTreeMap;

use drivebus_drives::{Access, BitField, Entry, Setpoint};
use thiserror::Error;

use crate::command::NotCommanded;
use crate::families::Families;
use crate::ready::NotReady;
use crate::settings::Setting;
use crate::task::{LineError, Mailbox, Payload};
use crate::unit::Unit;
use crate::writing::{NotWritten, Words};

/// What the field of a word is to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FieldInput<'a> {
    /// On or off, of a field that has two values.
    Switch(bool),
    /// The number of a label ("motor 2" of the field `motor`), or else its raw value.
    Number(i64),
    /// A label that the profile has for it.
    Label(&'a str),
}

impl From<bool> for FieldInput<'_> {
    fn from(is_on: bool) -> Self {
        Self::Switch(is_on)
    }
}

impl From<i32> for FieldInput<'_> {
    fn from(number: i32) -> Self {
        Self::Number(i64::from(number))
    }
}

impl From<i64> for FieldInput<'_> {
    fn from(number: i64) -> Self {
        Self::Number(number)
    }
}

impl<'a> From<&'a str> for FieldInput<'a> {
    fn from(label: &'a str) -> Self {
        Self::Label(label)
    }
}

/// Why bits were not set. `E` is the error of whoever drives.
///
/// But for [`NotCommanded`](Self::NotCommanded) and [`NotWritten`](Self::NotWritten), nothing was sent that changes anything.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotSetBits<E> {
    /// No such word of the family is known.
    #[error("no such word of this family is known")]
    NoRegister,
    /// The word may not be written; with the reason.
    #[error("it may not be written: {0}")]
    MayNot(String),
    /// Nothing was to be set.
    #[error("nothing to set was named")]
    NothingNamed,
    /// The word has no such field.
    #[error("it has no {name}, only {}", .known.join(", "))]
    NoField {
        /// What was named.
        name: String,
        /// The fields that it has.
        known: Vec<String>,
    },
    /// The field cannot be that.
    #[error("{name} cannot be that; allowed is {}", listed(.choices))]
    Unfit {
        /// Which field.
        name: String,
        /// What it can be.
        choices: BTreeMap<u16, String>,
    },
    /// Where the field is may not be used; with the reason.
    #[error("where {name} is may not be used: {why}")]
    Unproved {
        /// Which field.
        name: String,
        /// And why not.
        why: String,
    },
    /// The drive may not be started.
    #[error("{0}")]
    NotReady(NotReady<E>),
    /// The drive takes it from elsewhere, or is not known to take it from the bus: all that it needs for that.
    #[error("the drive would ignore it: {}", told(.0))]
    Ignored(Vec<Setting>),
    /// What the other bits are may not be read; with the reason.
    #[error("what else it holds may not be read: {0}")]
    Unreadable(String),
    /// The line failed before the word was sent, or the unit refused to be read.
    #[error("{0}")]
    Failed(E),
    /// The unit is not known to have taken the word, which can move the motor.
    #[error("{0}")]
    NotCommanded(Box<NotCommanded<E>>),
    /// The unit is not known to have taken the word.
    #[error("{0}")]
    NotWritten(NotWritten<E>),
}

fn listed(choices: &BTreeMap<u16, String>) -> String {
    choices.iter().map(|(number, label)| format!("{number} = {label}")).collect::<Vec<_>>().join(", ")
}

fn told(settings: &[Setting]) -> String {
    settings.iter().filter(|setting| !setting.is_right()).map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// What the fields of `register` are to be: each with its value, in the order of `given`.
fn fields<'e, E>(
    register: &'e Entry,
    given: &[(&str, FieldInput<'_>)],
) -> Result<Vec<(&'e BitField, u16)>, NotSetBits<E>> {
    let field = |&(name, value): &(&str, FieldInput<'_>)| {
        let Some(field) = register.bits().iter().find(|field| field.name() == name) else {
            let known = register.bits().iter().map(|field| field.name().to_owned()).collect();
            return Err(NotSetBits::NoField { name: name.to_owned(), known });
        };
        let choices = choices(field);
        match chosen(field, &choices, value) {
            Some(value) => Ok((field, value)),
            None => Err(NotSetBits::Unfit { name: name.to_owned(), choices }),
        }
    };
    if given.is_empty() { Err(NotSetBits::NothingNamed) } else { given.iter().map(field).collect() }
}

/// What `field` can be.
fn choices(field: &BitField) -> BTreeMap<u16, String> {
    if field.values().is_empty() {
        return BTreeMap::from([(0, "off".to_owned()), (1, "on".to_owned())]);
    }
    field.values().clone()
}

/// `value` as one of the `choices` of `field`; `None` where it is none of them.
fn chosen(field: &BitField, choices: &BTreeMap<u16, String>, value: FieldInput<'_>) -> Option<u16> {
    let labelled = |label: &str| choices.iter().find(|(_, known)| *known == label).map(|(&number, _)| number);
    let chosen = match value {
        FieldInput::Switch(is_on) => (choices.len() == 2).then_some(u16::from(is_on)),
        FieldInput::Label(label) => labelled(label),
        FieldInput::Number(number) => {
            labelled(&format!("{} {number}", field.name())).or_else(|| u16::try_from(number).ok())
        }
    };
    chosen.filter(|number| choices.contains_key(number))
}

impl Unit {
    /// Sets fields of the word that takes `setpoint`: virtual inputs, virtual outputs, or special control. What is not named
    /// keeps what the drive says it has; where the word can only be written, it is off.
    ///
    /// What can move the motor is sent once, to a drive that is ready and could be stopped again; over a bad link only where it
    /// `is_forced`. A halt wins over it, as over a start. The drive need not take its commands from the bus.
    ///
    /// # Errors
    ///
    /// [`NotSetBits`].
    pub async fn set_bits<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        setpoint: Setpoint,
        given: &[(&str, FieldInput<'_>)],
        is_forced: bool,
    ) -> Result<(), NotSetBits<E>> {
        let register = self.register_of(setpoint).ok_or(NotSetBits::NoRegister)?;
        let (profile, rule) = (self.profile(), self.rule());
        rule.write(register).map_err(|why| NotSetBits::MayNot(why.to_string()))?;
        let fields = fields(register, given)?;
        for (field, _) in &fields {
            let unproved = |why: String| NotSetBits::Unproved { name: field.name().to_owned(), why };
            rule.bits(register, field).map_err(|why| unproved(why.to_string()))?;
        }
        // What may be written has an address.
        let place = register.place().ok_or(NotSetBits::NoRegister)?;
        let moves = profile.is_command(place);
        let mut unit = self.clone();
        if moves {
            self.can_be_stopped().map_err(NotSetBits::NotReady)?;
            unit = self.unless_halted(line).await.map_err(NotSetBits::Failed)?;
            if !is_forced {
                unit.prove_link(line).await.map_err(NotSetBits::NotReady)?;
            }
            // These words stand in for terminals, so the drive need not take its commands from the bus.
            unit.ready(line, false).await.map_err(NotSetBits::NotReady)?;
        }
        if let Some(settings) = unit.unheeded(line, setpoint).await.map_err(NotSetBits::Failed)? {
            return Err(NotSetBits::Ignored(settings));
        }
        // What can only be written tells nothing: there, what is not named is off.
        let held = if register.access() == Access::Wo {
            0
        } else {
            rule.read(register).map_err(|why| NotSetBits::Unreadable(why.to_string()))?;
            unit.word(line, place).await.map_err(NotSetBits::Failed)?
        };
        let word = fields.iter().fold(held, |word, (field, value)| field.insert(word, *value));
        if moves {
            let is_unverified = rule.trusts_all();
            // Who started it so must not be kept from stopping it.
            unit.record().note(|sent| sent.started_unverified |= is_unverified);
            let sent = unit.write_moving(line, families, place, word).await;
            return sent.map_err(|why| NotSetBits::NotCommanded(Box::new(why)));
        }
        let read_back = profile.read_back(register).map(|shown| shown.address);
        let words = Words { read_back, ..Words::once(place, Payload::Word(word)) };
        unit.write(line, families, &words).await.map_err(NotSetBits::NotWritten)
    }
}

#[cfg(test)]
mod tests;
