//! One connection: whose it is, and what it has to do with all others.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use crate::bus::programs::Seat;
use crate::gateway::clients::{Place, Stream};
use crate::gateway::common::{Common, WillsOf};

/// How long a request may take to come whole, and a client to take an answer.
pub(super) const HURRY: Duration = Duration::from_secs(1);

/// What both threads of a connection have.
pub(super) struct Connection {
    pub(super) common: Arc<Common>,
    pub(super) seat: Seat,
    pub(super) peer: SocketAddr,
    /// The same in words.
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) stream: Stream,
}

impl Connection {
    /// What is left for its client.
    pub(super) fn wills(&self) -> WillsOf<'_> {
        self.common.wills_of(&self.name)
    }

    /// The client is gone, or silent: what it commanded is halted. `why` is for people.
    pub(super) fn gone(&self, why: &str) {
        self.common.gone(self.place.number, &self.name, why);
    }
}
