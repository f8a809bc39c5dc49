//! Why a drive refuses. Each family says by which exception code.

/// A refusal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Unknown function code. Assumption: an 08H sub-function other than 0000 counts as one.
    Function,
    /// No such address, or one with bit 15 that was to be read.
    Address,
    /// The word can only be written.
    Unreadable,
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

/// The exception codes of the Modbus specification, and 04H for what the drive does not do now.
///
/// Assumption, where the manual of a family does not say which it sends.
pub(crate) fn by_the_specification(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable | Refusal::ReadOnly => 0x02,
        Refusal::Structure | Refusal::Value => 0x03,
        Refusal::Password | Refusal::Running | Refusal::Locked => 0x04,
    }
}
