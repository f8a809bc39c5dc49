//! What a bus does where programs cannot share a port: it asks the line itself.

use std::time::Duration;

use drivebus_rtu::{Answer, Destination, Instant, Request, UnitAddress};

use crate::ask::Done;
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::bus::shared::Shared;
use crate::error::{CallError, Failure};
use crate::health::link::Link;
use crate::health::stats::Stats;
use crate::options::CallOptions;
use crate::trace::Overheard;
use crate::turns::queue::Turn;

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
        Call::new(&self.port, self.port.ask(destination, request, &options), options).run(give_up, take)
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
        self.port.listen(time, give_up, hear)
    }

    pub(super) fn overhear(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Overheard),
    ) -> Result<(), Failure> {
        self.port.overhear(time, give_up, hear)
    }

    pub(super) fn stats(&self) -> Stats {
        self.port.figures.stats()
    }

    pub(super) fn link(&self, unit: UnitAddress) -> Link {
        self.port.figures.link(unit)
    }

    pub(super) fn halts(&self, unit: UnitAddress) -> u64 {
        self.port.halts.of(unit)
    }

    pub(super) fn fresh_word(&self) -> u16 {
        self.port.words.next()
    }

    pub(super) fn reconnects(&self) -> u64 {
        self.port.figures.reconnects()
    }
}
