//! The numbers by which the queue tells the programs of one line apart.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::system::sync::{Mutex, PoisonError};
use crate::turns::order::Program;

/// Which numbers are taken. 0 is this program's own.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    taken: Mutex<BTreeSet<u16>>,
}

impl Programs {
    /// The lowest number that nobody has; of more programs than there are numbers, the rest have the last one together.
    pub(crate) fn seat(self: &Arc<Self>) -> Seat {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let number = (1..u16::MAX).find(|number| !taken.contains(number)).unwrap_or(u16::MAX);
        taken.insert(number);
        Seat { program: Program(number), programs: Arc::clone(self) }
    }
}

/// The number of one program, until this is dropped.
#[derive(Debug)]
pub(crate) struct Seat {
    pub(crate) program: Program,
    programs: Arc<Programs>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.programs.taken.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.program.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_given_again_when_its_program_is_gone() {
        let programs = Arc::new(Programs::default());
        let [first, second, third] = std::array::from_fn(|_| programs.seat());
        assert_eq!([&first, &second, &third].map(|seat| seat.program.0), [1, 2, 3]);
        drop(second);
        assert_eq!(programs.seat().program.0, 2);
    }
}
