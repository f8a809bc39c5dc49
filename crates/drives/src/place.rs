//! Places: an address and which of a drive's tables it is one of. Coil 1 and register 1 are different places.

use std::fmt;

/// The tables of the Modbus specification.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Table {
    /// Words, read by 03H and written by 06H and 10H.
    #[default]
    Holding,
    /// Words that are only read, by 04H.
    Input,
    /// Bits, read by 01H and written by 05H.
    Coil,
    /// Bits that are only read, by 02H.
    Discrete,
}

impl Table {
    /// All of them, the one that is meant where nothing is said first.
    pub const ALL: [Self; 4] = [Self::Holding, Self::Input, Self::Coil, Self::Discrete];

    /// The word for it in profiles and programs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holding => "holding",
            Self::Input => "input",
            Self::Coil => "coil",
            Self::Discrete => "discrete",
        }
    }

    /// The table of that [`name`](Self::name).
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|table| table.name() == name)
    }

    /// The function that reads it.
    pub const fn function(self) -> u8 {
        match self {
            Self::Coil => 0x01,
            Self::Discrete => 0x02,
            Self::Holding => 0x03,
            Self::Input => 0x04,
        }
    }

    /// The functions that write it, of which a drive knows one at least; none where it is only read.
    pub const fn written_by(self) -> &'static [u8] {
        match self {
            Self::Holding => &[0x06, 0x10],
            Self::Coil => &[0x05],
            Self::Input | Self::Discrete => &[],
        }
    }

    /// Whether it holds bits, each of which is a word of 0 or 1.
    pub const fn is_bits(self) -> bool {
        matches!(self, Self::Coil | Self::Discrete)
    }

    /// What stands above the address in a [number](Place::number).
    const fn above(self) -> u32 {
        match self {
            Self::Holding => 0,
            Self::Coil | Self::Discrete | Self::Input => (self.function() as u32) << 16,
        }
    }
}

/// An address of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// Which table.
    pub table: Table,
    /// Where in it.
    pub address: u16,
}

impl Place {
    /// `address` of `table`.
    pub const fn new(table: Table, address: u16) -> Self {
        Self { table, address }
    }

    /// Both as one number: of a holding register its address, of the others the function that reads them above it, so that
    /// coil 0001H is 10001H.
    pub const fn number(self) -> u32 {
        self.table.above() | self.address as u32
    }

    /// The place with that [`number`](Self::number).
    pub fn of_number(number: u32) -> Option<Self> {
        let [_, _, high, low] = number.to_be_bytes();
        let table = Table::ALL.into_iter().find(|table| table.above() == number & 0xFFFF_0000)?;
        Some(Self { table, address: u16::from_be_bytes([high, low]) })
    }
}

impl From<u16> for Place {
    /// The holding register at `address`.
    fn from(address: u16) -> Self {
        Self { table: Table::Holding, address }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.table {
            Table::Holding => "",
            Table::Input => "input register ",
            Table::Coil => "coil ",
            Table::Discrete => "discrete input ",
        })?;
        write!(f, "{:04X}H", self.address)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_one_number() {
        for (table, number, text) in [
            (Table::Holding, 0x2000, "2000H"),
            (Table::Coil, 0x1_2000, "coil 2000H"),
            (Table::Discrete, 0x2_2000, "discrete input 2000H"),
            (Table::Input, 0x4_2000, "input register 2000H"),
        ] {
            let place = Place::new(table, 0x2000);
            assert_eq!((place.number(), place.to_string().as_str()), (number, text));
            assert_eq!(Place::of_number(number), Some(place));
            assert_eq!(Table::named(table.name()), Some(table));
        }
        assert_eq!(Place::from(0x2000).number(), 0x2000);
        for number in [0x3_2000, 0x5_0000, 0x10_0000] {
            assert_eq!(Place::of_number(number), None);
        }
    }
}
