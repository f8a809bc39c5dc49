//! One connection: whose it is, and what it has to do with all others.

use std::net::IpAddr;
use std::sync::Arc;

use crate::bus::programs::Seat;
use crate::gateway::clients::Place;
use crate::gateway::common::{Common, WillsOf};
use crate::gateway::stream::Stream;

/// What both threads of a connection have.
pub(super) struct Connection {
    pub(super) common: Arc<Common>,
    pub(super) seat: Seat,
    /// Where its client is.
    pub(super) host: IpAddr,
    /// Who that is, for people.
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) stream: Arc<dyn Stream>,
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
