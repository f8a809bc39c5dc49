//! Who is connected, how many may be, and who gives way to one more.

use std::net::IpAddr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;

use crate::gateway::stream::Stream;

/// Connections at a time, of all and of one host.
const MOST: usize = 64;
const MOST_OF_ONE: usize = 16;

/// One connection.
#[derive(Debug)]
struct Client {
    number: u64,
    host: IpAddr,
    /// When it asked last, or came.
    asked: Instant,
    stream: Arc<dyn Stream>,
}

/// Who is connected.
#[derive(Debug, Default)]
pub(super) struct Clients {
    inside: Mutex<Inside>,
    left: Condvar,
}

#[derive(Debug, Default)]
struct Inside {
    numbers: u64,
    clients: Vec<Client>,
    /// How many have not ended, those included that gave way.
    open: usize,
    is_closed: bool,
}

impl Clients {
    fn lock(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets the other end of `stream` in. Where no more may be, the one that has not asked for the longest gives way,
    /// which is told; `None`: nobody comes in any more.
    pub(super) fn enter(
        self: &Arc<Self>,
        stream: Arc<dyn Stream>,
        host: IpAddr,
        now: Instant,
    ) -> Option<(Place, bool)> {
        let mut inside = self.lock();
        if inside.is_closed {
            return None;
        }
        let hosts: Vec<(IpAddr, Instant)> = inside.clients.iter().map(|one| (one.host, one.asked)).collect();
        let gone = gives_way(&hosts, host).map(|place| inside.clients.remove(place));
        if let Some(gone) = &gone {
            // Its own threads see that, and end.
            gone.stream.end();
        }
        inside.numbers += 1;
        inside.open += 1;
        let number = inside.numbers;
        inside.clients.push(Client { number, host, asked: now, stream });
        Some((Place { clients: Arc::clone(self), number }, gone.is_some()))
    }

    pub(super) fn count(&self) -> usize {
        self.lock().clients.len()
    }

    /// Ends all connections, and waits until they have, so long at most; nobody comes in any more.
    pub(super) fn close(&self, within: Duration) {
        let mut inside = self.lock();
        inside.is_closed = true;
        for client in &inside.clients {
            client.stream.end();
        }
        let _ = self.left.wait_timeout_while(inside, within, |inside| inside.open > 0);
    }
}

/// A connection that was let in, until this is dropped.
#[derive(Debug)]
pub(super) struct Place {
    clients: Arc<Clients>,
    /// Which one it is, of all that ever were.
    pub(super) number: u64,
}

impl Place {
    /// It asks `now`.
    pub(super) fn asks(&self, now: Instant) {
        if let Some(client) = self.clients.lock().clients.iter_mut().find(|one| one.number == self.number) {
            client.asked = now;
        }
    }

    /// Whether all connections are ended: it is no longer the client's doing that this one is.
    pub(super) fn is_closed(&self) -> bool {
        self.clients.lock().is_closed
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut inside = self.clients.lock();
        inside.clients.retain(|one| one.number != self.number);
        inside.open -= 1;
        self.clients.left.notify_all();
    }
}

/// Which of `clients`, each with when it asked last, gives way to one more from `host`.
fn gives_way(clients: &[(IpAddr, Instant)], host: IpAddr) -> Option<usize> {
    let of_host = clients.iter().filter(|(other, _)| *other == host).count();
    let is_full_for_it = of_host >= MOST_OF_ONE;
    if !is_full_for_it && clients.len() < MOST {
        return None;
    }
    let may = |other: IpAddr| !is_full_for_it || other == host;
    let rest = clients.iter().enumerate().filter(|(_, (other, _))| may(*other));
    rest.min_by_key(|(_, (_, asked))| *asked).map(|(place, _)| place)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn host(number: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, number])
    }

    fn asked(seconds: u64) -> Instant {
        Instant::ZERO + Duration::from_secs(seconds)
    }

    #[test]
    fn one_host_gives_way_to_itself() {
        let mut clients: Vec<_> = (0..15).map(|number| (host(1), asked(100 - number))).collect();
        clients.push((host(2), asked(0)));
        assert_eq!(gives_way(&clients, host(1)), None);
        clients.push((host(1), asked(50)));
        assert_eq!(gives_way(&clients, host(1)), Some(16));
        assert_eq!(gives_way(&clients, host(2)), None);
    }

    #[test]
    fn of_all_the_one_that_has_not_asked_for_the_longest() {
        let clients: Vec<_> = (0..64).map(|number| (host(number % 5), asked(200 - u64::from(number)))).collect();
        assert_eq!(gives_way(&clients[..63], host(9)), None);
        assert_eq!(gives_way(&clients, host(9)), Some(63));
    }
}
