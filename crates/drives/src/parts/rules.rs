//! Rules: what kind of unit a family is, what requests it takes, and which of its parameters need care.

/// Whether a unit feeds a motor, or the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum UnitKind {
    /// It turns a motor.
    Inverter,
    /// It makes the direct voltage from which inverters turn motors.
    Rectifier,
}

impl UnitKind {
    /// Its name in profiles and programs: `inverter`, `rectifier`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inverter => "inverter",
            Self::Rectifier => "rectifier",
        }
    }
}

/// Which protocol a drive speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Protocol {
    /// Modbus RTU.
    #[default]
    Modbus,
    /// Huanyang's own: no Modbus, on the same wires and with the same CRC.
    Huanyang,
}

impl Protocol {
    /// Its name in profiles and programs: `modbus`, `huanyang`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Modbus => "modbus",
            Self::Huanyang => "huanyang",
        }
    }
}

/// What a drive takes as a request.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Requests {
    /// In which protocol it is asked. In Huanyang's the function is the high byte of a register's address: 01 a parameter, 03 the
    /// control, 04 a status, 05 the frequency.
    pub protocol: Protocol,
    /// The function codes that it takes.
    pub functions: Vec<u8>,
    /// Most words in one read, 1..=125.
    pub max_words: u16,
    /// Most words in one write, 1..=123: no more than in a read.
    pub max_written: u16,
    /// Where it is printed that one 10H request may write several parameters; `None` where it is not printed.
    pub joined: Option<String>,
    /// Whether a read may run from one parameter group into the next.
    pub across_groups: bool,
    /// Whether a read may have one parameter and no more; registers are not meant.
    pub single_parameters: bool,
    /// The high bytes of addresses of holding registers under which each is answered, with 0 where there is nothing.
    pub zeros: Vec<u8>,
    /// A word that stands for nothing, where the drive has it instead of a value that it does not know.
    pub absent: Option<u16>,
    /// Whether documents of this family print all of this.
    pub verified: bool,
    /// What to know about it; says what is assumed where it is not verified.
    pub note: String,
    /// Where it is printed.
    pub source: String,
}

impl Requests {
    /// The function that writes several words.
    pub const WRITE_MANY: u8 = 0x10;

    /// Whether one request may write two words.
    pub fn writes_two(&self) -> bool {
        self.functions.contains(&Self::WRITE_MANY) && self.max_written > 1
    }
}

/// Parameters that need care, by code.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Groups {
    /// The code of a parameter says nothing of its address: each row does.
    pub(crate) listed: bool,
    /// Groups that the maker keeps closed.
    pub(crate) closed: Vec<u8>,
    /// High bytes of addresses at which there are parameters without a row.
    pub(crate) unlisted: Vec<u8>,
    /// Codes of rows that the profile dropped: its drives do not have them, not even as raw words.
    pub(crate) dropped: Vec<String>,
    /// Their write does something, and is not simply kept.
    pub(crate) acts: Vec<String>,
    /// They set the line.
    pub(crate) serial: Vec<String>,
    /// They describe the motor.
    pub(crate) motor: Vec<String>,
    /// They are to be written last, in this order.
    pub(crate) last: Vec<String>,
}
