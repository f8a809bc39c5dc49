//! What makes a drive act by itself when its bus falls silent.

/// The parameters that set a drive's own time-out of the bus, and the values that they take.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Watchdog {
    /// The code of the parameter that says how long the bus may be silent.
    pub timeout: String,
    /// The code of the parameter that says what the drive then does. `None`: it trips, and what it then does about the
    /// motor is decided elsewhere.
    pub action: Option<String>,
    /// The word of `action` that takes the voltage off the motor; `None` where the family cannot. Where no word is known for a
    /// trip alone, it trips the fault, too.
    pub coast: Option<u16>,
    /// The word of `action` that stops the motor as the drive is set to; `None` where the family cannot.
    pub stop: Option<u16>,
    /// The word of `action` that trips the fault, and what that does to the motor is decided elsewhere; `None` where the family
    /// has none.
    pub trip: Option<u16>,
    /// The number of the fault that it trips, where that is known.
    pub fault: Option<u16>,
    /// Whether a document of this family prints all of it.
    pub verified: bool,
    /// What to know about it; may be empty.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}
