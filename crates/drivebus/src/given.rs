//! What a program gave the fields of words, kept until the drive is told: an operation outlives the call that began it.

use drivebus_drive::FieldInput;

use crate::error::Error;

/// What a field of a word is to be.
#[derive(Debug)]
pub(crate) enum GivenField {
    Switch(bool),
    Number(i64),
    Label(String),
}

impl GivenField {
    pub(crate) fn of(input: FieldInput<'_>) -> Result<Self, Error> {
        match input {
            FieldInput::Switch(is_on) => Ok(Self::Switch(is_on)),
            FieldInput::Number(number) => Ok(Self::Number(number)),
            FieldInput::Label(label) => Ok(Self::Label(label.to_owned())),
            input => Err(Error::not_allowed(format_args!("no bus knows how to set a field to {input:?}"))),
        }
    }

    pub(crate) fn input(&self) -> FieldInput<'_> {
        match self {
            Self::Switch(is_on) => FieldInput::Switch(*is_on),
            Self::Number(number) => FieldInput::Number(*number),
            Self::Label(label) => FieldInput::Label(label),
        }
    }
}
