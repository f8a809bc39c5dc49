//! Why a drive refuses, as its exception codes.

use drivebus_rtu::ExceptionCode;

/// A refusal, by the GD350's meaning of the code (operation manual, section 9.4.7), which beyond 03H is not that of
/// the Modbus specification.
///
/// | code | here |
/// | ---: | --- |
/// | 01H  | [`Function`](Self::Function) |
/// | 02H  | [`Address`](Self::Address) |
/// | 03H  | [`Structure`](Self::Structure) |
/// | 04H  | [`Value`](Self::Value) |
/// | 05H  | [`Password`](Self::Password) |
/// | 07H  | [`ReadOnly`](Self::ReadOnly) |
/// | 08H  | [`Running`](Self::Running) |
/// | 09H  | [`Locked`](Self::Locked) |
///
/// Assumption: 06H (frame error) is never sent. One line of the manual promises it for a wrong CRC; a unit that
/// answers frames it cannot trust would answer its neighbours' too, so this one stays silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Unknown function code. Assumption: an 08H sub-function other than 0000 counts as one.
    Function,
    /// No such address, an address of group P99, or a RAM address that was to be read.
    Address,
    /// No words, more than 16, or lengths that do not agree.
    Structure,
    /// The value is out of range.
    Value,
    /// The password is not the right one.
    Password,
    /// The word can only be read.
    ReadOnly,
    /// The parameter can be changed only while the motor is stopped.
    Running,
    /// A password is set, and nobody has unlocked the drive.
    Locked,
}

impl Refusal {
    pub(crate) fn code(self) -> ExceptionCode {
        ExceptionCode(match self {
            Self::Function => 0x01,
            Self::Address => 0x02,
            Self::Structure => 0x03,
            Self::Value => 0x04,
            Self::Password => 0x05,
            Self::ReadOnly => 0x07,
            Self::Running => 0x08,
            Self::Locked => 0x09,
        })
    }
}
