// A door without a folder: who has its listener knocks.

use std::sync::Arc;

use crate::share::proof::Secret;
use crate::system::inherited::Kept;
use crate::system::sockets::Listener;

/// Nobody looks for a door by its place.
#[derive(Debug)]
pub(crate) struct Place;

impl Place {
    pub(crate) fn has(&self, _door: &Door) -> bool {
        true
    }
}

#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) entrances: Arc<[Entrance]>,
}

#[derive(Debug, Clone)]
pub(crate) enum ReachedBy {
    ThisUser,
    Group,
    Anybody,
    Strangers(Secret),
}

#[derive(Debug)]
pub(crate) struct Entrance {
    pub(crate) listener: Kept<Listener>,
    pub(crate) reached_by: ReachedBy,
}

impl Door {
    pub(crate) fn new(listener: Listener) -> Self {
        Self { entrances: Arc::new([Entrance { listener: Kept::new(listener), reached_by: ReachedBy::ThisUser }]) }
    }
}
