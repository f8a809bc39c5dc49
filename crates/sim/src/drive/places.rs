//! Which word stands where: from an address to a place in a list, in one step.
//!
//! An address is one number with its table: of a holding register the address itself, of the others the function that
//! reads them stands above its sixteen bits.

use drivebus_rtu::Table;

/// The number of `address` in `table`.
pub(crate) const fn spot(table: Table, address: u16) -> u32 {
    let above = match table {
        Table::Holding => 0,
        Table::Coil | Table::Discrete | Table::Input => table.function() as u32,
    };
    above << 16 | address as u32
}

/// Table and address of a number.
pub(crate) fn table_of(spot: u32) -> (Table, u16) {
    let [_, above, high, low] = spot.to_be_bytes();
    (Table::of_function(above).unwrap_or_default(), u16::from_be_bytes([high, low]))
}

/// How many addresses share a page.
const PAGE: usize = 256;
/// Pages of all tables.
const PAGES: usize = 5 * 256;

/// Places in a list by address. Every request asks for some, so they are looked up, not searched.
#[derive(Debug, Clone)]
pub(crate) struct Places {
    /// By the address without its low byte; pages without words share the first, which is empty.
    page_of: [u16; PAGES],
    /// By the low byte: the place and 1, or 0.
    pages: Vec<[u16; PAGE]>,
}

impl Places {
    /// `addresses` in the order of the list.
    pub(crate) fn new(addresses: impl IntoIterator<Item = u32>) -> Self {
        let mut places = Self { page_of: [0; PAGES], pages: vec![[0; PAGE]] };
        for (address, place) in addresses.into_iter().zip(1..=u16::MAX) {
            let (high, low) = split(address);
            let Some(page) = places.page_of.get_mut(high) else { continue };
            if *page == 0 {
                *page = u16::try_from(places.pages.len()).unwrap_or(0); // a page for each at most
                places.pages.push([0; PAGE]);
            }
            places.pages[usize::from(*page)][low] = place;
        }
        places
    }

    /// Where `address` stands.
    pub(crate) fn of(&self, address: u32) -> Option<usize> {
        let (high, low) = split(address);
        let page = usize::from(self.page_of.get(high).copied().unwrap_or(0));
        usize::from(self.pages[page][low]).checked_sub(1)
    }
}

fn split(address: u32) -> (usize, usize) {
    let [high2, high1, high0, low] = address.to_be_bytes();
    (u32::from_be_bytes([0, high2, high1, high0]) as usize, usize::from(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_table_has_numbers_of_its_own() {
        for table in Table::ALL {
            assert_eq!(table_of(spot(table, 0x2100)), (table, 0x2100));
        }
        assert_eq!(
            [spot(Table::Holding, 0x2100), spot(Table::Coil, 1), spot(Table::Input, 2)],
            [0x2100, 0x1_0001, 0x4_0002]
        );
    }

    #[test]
    fn each_address_stands_where_it_was_put_and_no_other_does() {
        let some = [0x0000, 0x00FF, 0x0100, 0x2100, 0x3000, 0xFFFF];
        let places = Places::new(some);
        for address in 0..=0x5_0000 {
            assert_eq!(places.of(address), some.iter().position(|&other| other == address), "{address:04X}");
        }
        let full = Places::new(0..0xFFFF);
        assert!((0..0xFFFF_u16).all(|address| full.of(address.into()) == Some(usize::from(address))));
        assert_eq!(full.of(0xFFFF), None);
    }
}
