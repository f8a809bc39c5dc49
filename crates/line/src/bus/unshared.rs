//! Where programs cannot share a port: without the feature `share`, and on systems without Unix sockets.

use std::convert::Infallible;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_rtu::{Answer, Destination, Instant, Request, UnitAddress};

use crate::ask::Done;
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::bus::openings::Openings;
use crate::bus::shared::Shared;
use crate::error::{CallError, Failure};
use crate::health::link::Link;
use crate::health::stats::Stats;
use crate::line::Opener;
use crate::options::{BusOptions, CallOptions};
use crate::ports::key::PortKey;
use crate::trace::Overheard;
use crate::turns::queue::Turn;

/// There is none.
#[derive(Debug)]
pub(super) struct Sharing(Infallible);

impl Sharing {
    /// The port is opened by `opener`, and is this program's alone.
    pub(super) fn around(
        _key: Option<PortKey>,
        _options: &BusOptions,
        _stats: &Arc<Mutex<Stats>>,
        _openings: &Arc<Openings>,
        opener: Opener,
    ) -> (Option<Arc<Self>>, Opener) {
        (None, opener)
    }

    pub(super) fn is_guest(&self) -> bool {
        match self.0 {}
    }

    pub(super) fn serves(&self, _bus: &Arc<Shared>) {
        match self.0 {}
    }

    pub(super) fn end(&self) {
        match self.0 {}
    }

    pub(super) fn serves_no_more(&self) {
        match self.0 {}
    }

    pub(super) fn notes(&self) -> Vec<String> {
        match self.0 {}
    }
}

impl Shared {
    /// What becomes of a call on a port that is shared: there is none.
    pub(super) fn call_shared(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        Call::new(self, self.ask(destination, request, &options), options).run(give_up, take)
    }

    pub(super) fn carry_out(
        &self,
        errand: &Errand,
        turn: Turn<'_, Errand>,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Option<Result<Done, Box<CallError>>> {
        self.carry_out_here(errand, turn, take)
    }

    pub(super) fn listen(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Instant, &[u8]),
    ) -> Result<(), Failure> {
        self.listen_here(time, give_up, hear)
    }

    pub(super) fn overhear(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Overheard),
    ) -> Result<(), Failure> {
        self.overhear_here(time, give_up, hear)
    }

    pub(super) fn stats(&self) -> Stats {
        self.stats_here()
    }

    pub(super) fn link(&self, unit: UnitAddress) -> Link {
        self.link_here(unit)
    }

    pub(super) fn fresh_word(&self) -> u16 {
        self.words.next()
    }

    pub(super) fn reconnects(&self) -> u64 {
        self.reconnects_here()
    }
}
