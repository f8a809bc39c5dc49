//! The four tables of a unit, each with addresses of its own, and the functions that read them.
//!
//! | table | holds | read by | most in one read |
//! | --- | --- | --- | --- |
//! | coils | bits | 01H | 2000 |
//! | discrete inputs | bits, read only | 02H | 2000 |
//! | holding registers | words | 03H | 125 |
//! | input registers | words, read only | 04H | 125 |
//!
//! Source: *Modbus Application Protocol* V1.1b3, §4.3, §6.1 to §6.4.

use crate::pdu::function::{READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT};
use crate::pdu::{MAX_READ, MAX_READ_BITS};

/// A table: which of a unit's places an address is one of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[repr(u8)]
pub enum Table {
    /// Bits that are read and written.
    Coil = READ_COILS,
    /// Bits that are only read.
    Discrete = READ_DISCRETE,
    /// Words that are read and written.
    #[default]
    Holding = READ_HOLDING,
    /// Words that are only read.
    Input = READ_INPUT,
}

impl Table {
    /// All of them, the one that is meant where nothing is said first.
    pub const ALL: [Self; 4] = [Self::Holding, Self::Input, Self::Coil, Self::Discrete];

    /// The function that reads it.
    pub const fn function(self) -> u8 {
        self as u8
    }

    /// The table that `function` reads.
    pub const fn of_function(function: u8) -> Option<Self> {
        match function {
            READ_COILS => Some(Self::Coil),
            READ_DISCRETE => Some(Self::Discrete),
            READ_HOLDING => Some(Self::Holding),
            READ_INPUT => Some(Self::Input),
            _ => None,
        }
    }

    /// Whether it holds bits, each of which is read as a word of 0 or 1.
    pub const fn is_bits(self) -> bool {
        matches!(self, Self::Coil | Self::Discrete)
    }

    /// Whether it can be written.
    pub const fn is_writable(self) -> bool {
        matches!(self, Self::Coil | Self::Holding)
    }

    /// Most of it in one read.
    pub const fn max_read(self) -> u16 {
        if self.is_bits() { MAX_READ_BITS } else { MAX_READ }
    }

    /// How many bytes of an answer carry `count` of it.
    pub const fn bytes(self, count: usize) -> usize {
        if self.is_bits() { count.div_ceil(8) } else { 2 * count }
    }

    /// The word for it in programs and profiles.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coil => "coil",
            Self::Discrete => "discrete",
            Self::Holding => "holding",
            Self::Input => "input",
        }
    }

    /// The table of that [`name`](Self::name).
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|table| table.name() == name)
    }

    /// What one of it is called in a sentence.
    pub const fn one(self) -> &'static str {
        match self {
            Self::Coil => "coil",
            Self::Discrete => "discrete input",
            Self::Holding => "register",
            Self::Input => "input register",
        }
    }

    /// What several of it are called.
    pub const fn many(self) -> &'static str {
        match self {
            Self::Coil => "coils",
            Self::Discrete => "discrete inputs",
            Self::Holding => "words",
            Self::Input => "input registers",
        }
    }
}
