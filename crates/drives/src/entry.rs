//! Entries: one register or parameter, its address, its quantity and who may change it when.

use crate::bits::BitField;
use crate::evidence::Evidence;
use crate::place::{Place, Table};
use crate::quantity::Quantity;
use crate::value::{Input, Value, ValueError};

/// Whether an entry is a bus register or a parameter of the drive's own menu.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A register that exists for the bus only; it is never kept in EEPROM.
    Register,
    /// A parameter ("function code"), which the keypad shows too and EEPROM keeps.
    Parameter,
}

/// When an entry may be read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Access {
    /// A register to read and to write.
    Rw,
    /// Only to read.
    Ro,
    /// Only to write.
    Wo,
    /// A parameter that can be changed at any time.
    Run,
    /// A parameter that can be changed only while the motor is stopped.
    Stop,
    /// The manuals at hand do not say.
    Unknown,
}

impl Access {
    /// Every access class.
    pub const ALL: [Self; 6] = [Self::Rw, Self::Ro, Self::Wo, Self::Run, Self::Stop, Self::Unknown];

    /// Its name in profiles and programs: `rw`, `ro`, `wo`, `run`, `stop`, `unknown`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rw => "rw",
            Self::Ro => "ro",
            Self::Wo => "wo",
            Self::Run => "run",
            Self::Stop => "stop",
            Self::Unknown => "unknown",
        }
    }
}

/// Where a written parameter is to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Store {
    /// In RAM: lost when the drive is switched off, and free of wear.
    Ram,
    /// In EEPROM: kept, with a limited number of writes.
    Eeprom,
}

/// One register or parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// A register's name, a parameter's code.
    pub(crate) name: String,
    /// The name that a parameter has beside its code.
    pub(crate) alias: Option<String>,
    pub(crate) kind: Kind,
    pub(crate) place: Option<Place>,
    pub(crate) label: String,
    pub(crate) quantity: Quantity,
    pub(crate) bits: Vec<BitField>,
    pub(crate) access: Access,
    pub(crate) default: Option<u16>,
    pub(crate) evidence: Evidence,
    pub(crate) note: String,
    pub(crate) source: String,
    /// Whether a row of the profile has it.
    pub(crate) listed: bool,
}

impl Entry {
    /// The name of a register (`output_current`), the code of a parameter (`P00.11`).
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The name in words that a parameter has beside its code: `acceleration_time_1`.
    pub fn alias(&self) -> Option<&str> {
        self.alias.as_deref()
    }

    /// The code, if this is a parameter.
    pub fn code(&self) -> Option<&str> {
        match self.kind {
            Kind::Register => None,
            Kind::Parameter => Some(&self.name),
        }
    }

    /// Register or parameter.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The address to read from. `None` where it is known that there is such a word, and not where: then it cannot be
    /// used.
    pub fn address(&self) -> Option<u16> {
        self.place.map(|place| place.address)
    }

    /// The address and its table; `None` as for the [`address`](Self::address).
    pub fn place(&self) -> Option<Place> {
        self.place
    }

    /// The table that it is in.
    pub fn table(&self) -> Table {
        self.place.map_or(Table::Holding, |place| place.table)
    }

    /// How many words it takes from its address on: 1 or 2.
    pub fn words(&self) -> u16 {
        self.quantity.words()
    }

    /// What it is, in a few words.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Unit, scale, range and choices.
    pub fn quantity(&self) -> &Quantity {
        &self.quantity
    }

    /// What its bits mean, lowest first; empty for most.
    pub fn bits(&self) -> &[BitField] {
        &self.bits
    }

    /// When it may be read and written.
    pub fn access(&self) -> Access {
        self.access
    }

    /// The word it holds when the drive leaves the factory, where that is documented.
    pub fn default_raw(&self) -> Option<u16> {
        self.default
    }

    /// Whether documents of this family print all of this row; else [`note`](Self::note) says what they do not.
    pub fn verified(&self) -> bool {
        self.evidence == Evidence::Verified
    }

    /// How well documents of this family prove this row.
    pub fn evidence(&self) -> Evidence {
        self.evidence
    }

    /// What to know about it; may be empty.
    pub fn note(&self) -> &str {
        &self.note
    }

    /// Where it is printed; empty only where it is assumed.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Whether a row of the profile has it; else it is a code that nothing is known of but its address.
    pub fn is_listed(&self) -> bool {
        self.listed
    }

    /// Whether the profile knows that it can be read. False where access is unknown, and where it is assumed: a read
    /// across it might be refused.
    pub fn is_known_readable(&self) -> bool {
        !matches!(self.access, Access::Wo | Access::Unknown) && self.evidence != Evidence::Assumed
    }

    /// The value of `raw`. Every word has one, in range or not.
    pub fn decode(&self, raw: u16) -> Value {
        self.quantity.decode(raw)
    }

    /// The word for a value in [`unit`](Quantity::unit)s, or for a choice. Whether the entry may be written is not
    /// asked here.
    ///
    /// # Errors
    ///
    /// [`ValueError`]: not a number or choice, out of range, or finer than the drive counts.
    pub fn encode<'a>(&self, value: impl Into<Input<'a>>) -> Result<u16, ValueError> {
        self.quantity.encode(&self.name, &value.into())
    }

    /// The words for `value`, as many as the entry [has](Self::words), in the order of their addresses.
    ///
    /// # Errors
    ///
    /// Those of [`encode`](Self::encode), but for two words.
    pub fn encode_words<'a>(&self, value: impl Into<Input<'a>>) -> Result<Vec<u16>, ValueError> {
        self.quantity.encode_words(&self.name, &value.into())
    }
}

/// Why an entry cannot be used as asked. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// It can only be read.
    #[error("{name} ({label}) can only be read")]
    ReadOnly {
        /// What was to be written.
        name: String,
        /// What it is.
        label: String,
    },
    /// It can only be written.
    #[error("{name} ({label}) can only be written")]
    WriteOnly {
        /// What was to be read.
        name: String,
        /// What it is.
        label: String,
    },
    /// Nobody knows where it is.
    #[error("{name} ({label}) cannot be used: its address is not known. {note}")]
    NoAddress {
        /// What was to be used.
        name: String,
        /// What it is.
        label: String,
        /// What is known instead.
        note: String,
    },
    /// The family has no write to RAM only, or none is known.
    #[error(
        "{name} ({label}) can only be stored: no write that RAM alone keeps is known for this family, and every write \
         may wear EEPROM"
    )]
    NoRam {
        /// What was to be written.
        name: String,
        /// What it is.
        label: String,
    },
    /// It is a register, which EEPROM never keeps.
    #[error("{name} ({label}) is a register and never kept in EEPROM; write it without storing")]
    NotStored {
        /// What was to be stored.
        name: String,
        /// What it is.
        label: String,
    },
}

/// What an entry is called.
pub(crate) fn names(entry: &Entry) -> impl Iterator<Item = &str> {
    std::iter::once(entry.name()).chain(entry.alias())
}
