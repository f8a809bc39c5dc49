//! Where programs cannot share a port: without the feature `share`, and on systems that are neither Unix nor Windows.

use std::convert::Infallible;
use std::sync::{Arc, Mutex};

use crate::bus::openings::Openings;
use crate::bus::port::{Ends, Port};
use crate::health::stats::Stats;
use crate::line::Opener;
use crate::options::BusOptions;
use crate::ports::key::PortKey;

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

    pub(super) fn serves(&self, _port: &Arc<Port>) {
        match self.0 {}
    }

    pub(super) fn serves_no_more(&self) {
        match self.0 {}
    }

    pub(super) fn notes(&self) -> Vec<String> {
        match self.0 {}
    }
}

impl Ends for Sharing {
    fn end(&self) {
        match self.0 {}
    }
}
