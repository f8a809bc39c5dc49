//! The numbers by which the queue tells the programs of one line apart, and what clients of this program asked.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::health::stats::Program as Counted;
use crate::system::sync::atomic::{AtomicU64, Ordering};
use crate::system::sync::{Mutex, PoisonError};
use crate::turns::order::Program;

/// Which numbers are taken. 0 is this program's own.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    taken: Mutex<BTreeMap<u16, Option<Arc<Client>>>>,
}

/// One that uses the line through this program without being one that shares the port.
#[derive(Debug)]
struct Client {
    name: String,
    calls: AtomicU64,
    answered: AtomicU64,
}

impl Programs {
    /// The lowest number that nobody has; of more programs than there are numbers, the rest have the last one together.
    #[cfg(any(test, all(any(unix, windows), feature = "share")))]
    pub(crate) fn seat(self: &Arc<Self>) -> Seat {
        self.take(None)
    }

    /// As [`seat`](Self::seat), for a client that people know by `name`, and that is [counted](Self::clients).
    #[cfg(feature = "tcp")]
    pub(crate) fn seat_of(self: &Arc<Self>, name: String) -> Seat {
        self.take(Some(Arc::new(Client { name, calls: AtomicU64::new(0), answered: AtomicU64::new(0) })))
    }

    fn take(self: &Arc<Self>, client: Option<Arc<Client>>) -> Seat {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let number = (1..u16::MAX).find(|number| !taken.contains_key(number)).unwrap_or(u16::MAX);
        taken.insert(number, client.clone());
        Seat { program: Program(number), client, programs: Arc::clone(self) }
    }

    /// The clients that are here, and what they asked.
    pub(crate) fn clients(&self) -> Vec<Counted> {
        let taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let counted = taken.values().flatten().map(|client| Counted {
            name: client.name.clone(),
            process: 0,
            here: true,
            calls: client.calls.load(Ordering::Relaxed),
            answered: client.answered.load(Ordering::Relaxed),
        });
        counted.collect()
    }
}

/// The number of one program, until this is dropped.
#[derive(Debug)]
pub(crate) struct Seat {
    pub(crate) program: Program,
    #[cfg_attr(not(feature = "tcp"), expect(dead_code, reason = "only clients over the network are counted here"))]
    client: Option<Arc<Client>>,
    programs: Arc<Programs>,
}

#[cfg(feature = "tcp")]
impl Seat {
    /// Its client asked.
    pub(crate) fn asked(&self) {
        if let Some(client) = &self.client {
            client.calls.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// It was answered, by what the unit said.
    pub(crate) fn answered(&self) {
        if let Some(client) = &self.client {
            client.answered.fetch_add(1, Ordering::Relaxed);
        }
    }
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

    #[cfg(feature = "tcp")]
    #[test]
    fn a_client_is_counted_while_it_is_here() {
        let programs = Arc::new(Programs::default());
        let _other = programs.seat();
        let seat = programs.seat_of("client 10.0.0.5:1".to_owned());
        seat.asked();
        seat.asked();
        seat.answered();
        let [client] = &programs.clients()[..] else { panic!("one") };
        assert_eq!((&*client.name, client.here, client.calls, client.answered), ("client 10.0.0.5:1", true, 2, 1));
        drop(seat);
        assert!(programs.clients().is_empty());
    }
}
