//! What is kept of each unit: a place for each number, found without a search.

use drivebus_rtu::UnitAddress;

/// A `T` for each unit. One that nobody has set is as `T` begins.
#[derive(Debug)]
pub(crate) struct ByUnit<T> {
    /// Up to the highest unit that was set.
    places: Vec<T>,
}

impl<T> Default for ByUnit<T> {
    fn default() -> Self {
        Self { places: Vec::new() }
    }
}

impl<T: Default> ByUnit<T> {
    /// What is kept of `unit`, if anything was set of it or of one with a higher number.
    pub(crate) fn get(&self, unit: UnitAddress) -> Option<&T> {
        self.places.get(usize::from(unit.get()))
    }

    /// The same, to be changed.
    pub(crate) fn of(&mut self, unit: UnitAddress) -> &mut T {
        let place = usize::from(unit.get());
        if place >= self.places.len() {
            self.grow(place + 1);
        }
        &mut self.places[place]
    }

    #[cold]
    fn grow(&mut self, places: usize) {
        self.places.resize_with(places, T::default);
    }
}
