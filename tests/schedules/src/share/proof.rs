// Nobody here has to show who it is: the system tells.

use drivebus_rtu::Instant;

use crate::share::channel::Channel;

/// There is none.
#[derive(Debug, Clone)]
pub(crate) enum Secret {}

pub(crate) const MOST: usize = 0;

pub(crate) fn of_guest(_channel: &mut Channel, secret: &Secret, _until: Instant) -> Option<u32> {
    match *secret {}
}
