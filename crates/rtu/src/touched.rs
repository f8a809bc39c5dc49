//! Which places a request reads or writes, by its bytes alone: also where its counts are wrong, which a unit may not look at.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.1 to §6.6, §6.11, §6.12, §6.17. Of 17H what it writes is told, and not what it
//! reads; what 16H leaves of a register nobody knows who has not read it.

use crate::pdu::function::{READ_WRITE, WRITE_COIL, WRITE_COILS, WRITE_MULTIPLE, WRITE_SINGLE};
use crate::table::Table;

/// What a request reads or writes.
///
/// ```
/// use drivebus_rtu::{Table, Touched};
///
/// let touched = Touched::by(&[0x0F, 0x00, 0x13, 0x00, 0x03, 0x01, 0b101]).unwrap();
/// assert_eq!((touched.table, touched.address, touched.count), (Table::Coil, 0x13, 3));
/// assert!(touched.written().unwrap().eq([1, 0, 1]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Touched<'a> {
    /// In which table.
    pub table: Table,
    /// The first place.
    pub address: u16,
    /// How many places, as the request says: 1 where it has no count.
    pub count: u16,
    written: Option<Written<'a>>,
}

/// What is written, as it stands in a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Written<'a> {
    Coil(u16),
    Coils(&'a [u8]),
    Word(u16),
    Words(&'a [u8]),
}

impl<'a> Touched<'a> {
    /// What the request `pdu` reads or writes; `None` where it is none of the reads and writes above, or ends before it says so.
    pub fn by(pdu: &'a [u8]) -> Option<Self> {
        let &[function, a1, a0, b1, b0, ref rest @ ..] = pdu else { return None };
        let (address, second) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([b1, b0]));
        let one = |table, written| Self { table, address, count: 1, written: Some(written) };
        let many = |table, written| Self { table, address, count: second, written };
        match (function, rest) {
            (WRITE_COIL, []) => Some(one(Table::Coil, Written::Coil(second))),
            (WRITE_SINGLE, []) => Some(one(Table::Holding, Written::Word(second))),
            (WRITE_COILS, _) => Some(many(Table::Coil, data_of(rest).map(Written::Coils))),
            (WRITE_MULTIPLE, _) => Some(many(Table::Holding, data_of(rest).map(Written::Words))),
            (READ_WRITE, &[a1, a0, c1, c0, ref rest @ ..]) => Some(Self {
                table: Table::Holding,
                address: u16::from_be_bytes([a1, a0]),
                count: u16::from_be_bytes([c1, c0]),
                written: data_of(rest).map(Written::Words),
            }),
            _ => Table::of_function(function).map(|table| many(table, None)),
        }
    }

    /// The words that it writes, of a coil 0 or 1; `None` where it writes none. Of coils no more than it says, of registers as many
    /// as it brings.
    pub fn written(&self) -> Option<impl Iterator<Item = u16> + use<'a>> {
        let written = self.written?;
        let bits = usize::from(self.count);
        let count = match written {
            Written::Coil(_) | Written::Word(_) => 1,
            Written::Coils(data) => bits.min(8 * data.len()),
            Written::Words(data) => data.len() / 2,
        };
        Some((0..count).map(move |at| match written {
            Written::Coil(value) => u16::from(value != 0),
            Written::Coils(data) => u16::from(data[at / 8] >> (at % 8) & 1),
            Written::Word(value) => value,
            Written::Words(data) => u16::from_be_bytes([data[2 * at], data[2 * at + 1]]),
        }))
    }
}

/// What follows the count of bytes, if anything does.
fn data_of(rest: &[u8]) -> Option<&[u8]> {
    rest.get(1..).filter(|data| !data.is_empty())
}
