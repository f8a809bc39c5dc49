// Nobody here is gone without a word: there are no last wills.

use std::sync::Arc;

use drivebus_rtu::UnitAddress;

use crate::error::Failure;
use crate::line::Opener;
use crate::options::BusOptions;
use crate::ports::key::PortKey;

/// There are none.
#[derive(Debug)]
pub(crate) struct Wills;

impl Wills {
    pub(crate) fn new(_key: Option<PortKey>, _options: &BusOptions) -> Self {
        Self
    }

    pub(crate) fn finding(self: &Arc<Self>, open: Opener) -> Opener {
        open
    }

    pub(crate) fn serves<B>(self: &Arc<Self>, _bus: &Arc<B>) {}

    pub(crate) fn let_go(&self) {}

    pub(crate) fn hand_over(&self) {}

    pub(crate) fn look_soon(&self) {}

    pub(crate) fn keeps_from(&self, _unit: Option<UnitAddress>) -> Option<Failure> {
        None
    }
}
