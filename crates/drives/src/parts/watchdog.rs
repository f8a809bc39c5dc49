//! What makes a drive act by itself when its bus falls silent.

/// The parameters that set a drive's own time-out of the bus, and the values that they take.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Watchdog {
    /// The code of the parameter that says how long the bus may be silent.
    pub timeout: String,
    /// The code of the parameter that says what the drive then does.
    pub action: String,
    /// The word of `action` that takes the voltage off the motor; `None` where the family cannot.
    pub coast: Option<u16>,
    /// The word of `action` that stops the motor as the drive is set to; `None` where the family cannot.
    pub stop: Option<u16>,
    /// Whether a document of this family prints all of it.
    pub verified: bool,
    /// What to know about it; may be empty.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}
