//! Values as a program gave them, kept until the drive is told: an operation outlives the call that began it.

use drivebus_drive::FieldInput;
use drivebus_drives::Input;

use crate::error::Error;

/// A value of a register or parameter.
#[derive(Debug)]
pub(crate) enum Given {
    Integer(i64),
    Float(f64),
    Text(String),
    Decimal(String),
}

impl Given {
    pub(crate) fn of(input: Input<'_>) -> Result<Self, Error> {
        match input {
            Input::Integer(number) => Ok(Self::Integer(number)),
            Input::Float(number) => Ok(Self::Float(number)),
            Input::Text(text) => Ok(Self::Text(text.to_owned())),
            Input::Decimal(digits) => Ok(Self::Decimal(digits.to_owned())),
            input => Err(Error::not_allowed(format_args!("no bus knows how to write {input}"))),
        }
    }

    pub(crate) fn input(&self) -> Input<'_> {
        match self {
            Self::Integer(number) => Input::Integer(*number),
            Self::Float(number) => Input::Float(*number),
            Self::Text(text) => Input::Text(text),
            Self::Decimal(digits) => Input::Decimal(digits),
        }
    }
}

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
