//! Where nobody would carry out a last will, none is left: where programs cannot share a port, and where a lock does not tell
//! that a program is gone.

use std::sync::Arc;

use drivebus_rtu::UnitAddress;

use crate::error::Failure;
use crate::line::Opener;
use crate::options::{BusOptions, LastWill};
use crate::ports::key::PortKey;
#[cfg(all(any(unix, windows), feature = "share"))]
use crate::share::place::Place;

/// Never called.
#[cfg(feature = "tcp")]
pub(super) type Then = Box<dyn FnMut(bool, Option<&str>) + Send>;

/// Whether there is a will at a place: there is none.
#[cfg(all(any(unix, windows), feature = "share"))]
pub(super) fn is_any(_place: &Place) -> bool {
    false
}

/// There are none.
#[derive(Debug)]
pub(super) struct Wills;

impl Wills {
    pub(super) fn new(_key: Option<PortKey>, _options: &BusOptions) -> Self {
        Self
    }

    pub(super) fn finding(self: &Arc<Self>, open: Opener) -> Opener {
        open
    }

    pub(super) fn serves<B>(self: &Arc<Self>, _bus: &Arc<B>) {}

    pub(super) fn leave(self: &Arc<Self>, _will: LastWill) -> Option<u64> {
        None
    }

    #[cfg(feature = "tcp")]
    pub(super) fn leave_for(self: &Arc<Self>, _client: String, _will: LastWill, _then: Then) -> Option<u64> {
        None
    }

    #[cfg(feature = "tcp")]
    pub(super) fn carry_out_now(self: &Arc<Self>, _number: u64) {}

    pub(super) fn withdraw(&self, _number: u64) {}

    pub(super) fn let_go(&self) {}

    pub(super) fn hand_over(&self) {}

    pub(super) fn let_out(&self) {}

    pub(super) fn keeps_from(&self, _unit: Option<UnitAddress>) -> Option<Failure> {
        None
    }

    #[cfg(all(any(unix, windows), feature = "share"))]
    pub(super) fn look_soon(self: &Arc<Self>) {}

    pub(super) fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
