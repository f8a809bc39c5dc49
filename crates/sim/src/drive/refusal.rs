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
