//! Which word stands where: from an address to a place in a list, in one step.

/// How many addresses share a page.
const PAGE: usize = 256;

/// Places in a list by address. Every request asks for some, so they are looked up, not searched.
#[derive(Debug, Clone)]
pub(crate) struct Places {
    /// By the high byte of the address; pages without words share the first, which is empty.
    page_of: [u16; PAGE],
    /// By the low byte: the place and 1, or 0.
    pages: Vec<[u16; PAGE]>,
}

impl Places {
    /// `addresses` in the order of the list.
    pub(crate) fn new(addresses: impl IntoIterator<Item = u16>) -> Self {
        let mut places = Self { page_of: [0; PAGE], pages: vec![[0; PAGE]] };
        for (address, place) in addresses.into_iter().zip(1..=u16::MAX) {
            let [high, low] = address.to_be_bytes().map(usize::from);
            if places.page_of[high] == 0 {
                places.page_of[high] = u16::try_from(places.pages.len()).unwrap_or(0); // 256 at most
                places.pages.push([0; PAGE]);
            }
            places.pages[usize::from(places.page_of[high])][low] = place;
        }
        places
    }

    /// Where `address` stands.
    pub(crate) fn of(&self, address: u16) -> Option<usize> {
        let [high, low] = address.to_be_bytes().map(usize::from);
        usize::from(self.pages[usize::from(self.page_of[high])][low]).checked_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_address_stands_where_it_was_put_and_no_other_does() {
        let some = [0x0000, 0x00FF, 0x0100, 0x2100, 0x3000, 0xFFFF];
        let places = Places::new(some);
        for address in 0..=0xFFFF {
            assert_eq!(places.of(address), some.iter().position(|&other| other == address), "{address:04X}");
        }
        let full = Places::new(0..0xFFFF);
        assert!((0..0xFFFF).all(|address| full.of(address) == Some(usize::from(address))));
        assert_eq!(full.of(0xFFFF), None);
    }
}
