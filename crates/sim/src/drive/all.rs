//! The drives on one line, by address.

use std::collections::BTreeMap;

use drivebus_rtu::UnitAddress;

use super::Drive;

/// How many addresses a byte can say.
const ADDRESSES: usize = 256;

/// The drives on one line, in the order of their addresses.
#[derive(Debug)]
pub(crate) struct Drives {
    drives: Vec<Drive>,
    /// By address: the place in `drives`, if there is one; looked up for every request.
    places: Box<[Option<u8>; ADDRESSES]>,
}

impl Drives {
    pub(crate) fn new(drives: BTreeMap<u8, Drive>) -> Self {
        let mut places = Box::new([None; ADDRESSES]);
        for (&address, place) in drives.keys().zip(0..) {
            places[usize::from(address)] = Some(place);
        }
        Self { drives: drives.into_values().collect(), places }
    }

    pub(crate) fn get_mut(&mut self, unit: UnitAddress) -> Option<&mut Drive> {
        let place = self.places[usize::from(unit.get())]?;
        self.drives.get_mut(usize::from(place))
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Drive> {
        self.drives.iter_mut()
    }
}
