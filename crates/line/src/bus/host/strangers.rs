//! Who has knocked and has yet to show who it is: anybody may, so only so many are waited for at a time.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::share::channel::Channel;
use crate::system::inherited::Kept;
use crate::system::sockets::{Shutdown, Stream};
use crate::system::sync::{Mutex, MutexGuard, PoisonError};

/// So many at a time. Where one more comes, the one that has waited longest is sent away: a program of this user has shown who
/// it is long before so many others have come.
const MOST: usize = 64;

/// Those who are waited for.
#[derive(Debug, Default)]
pub(super) struct Strangers(Mutex<Waiting>);

#[derive(Debug, Default)]
struct Waiting {
    came: u64,
    streams: BTreeMap<u64, Arc<Kept<Stream>>>,
}

/// One that is waited for, until this is dropped.
pub(super) struct Stranger<'a> {
    strangers: &'a Strangers,
    number: u64,
}

impl Strangers {
    /// One has come, over `channel`.
    pub(super) fn enter(&self, channel: &Channel) -> Stranger<'_> {
        let mut waiting = self.lock();
        if waiting.streams.len() >= MOST
            && let Some((_, stream)) = waiting.streams.pop_first()
        {
            // It may have gone by itself.
            let _ = stream.shutdown(Shutdown::Both);
        }
        waiting.came += 1;
        let number = waiting.came;
        waiting.streams.insert(number, channel.end());
        Stranger { strangers: self, number }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Stranger<'_> {
    fn drop(&mut self) {
        self.strangers.lock().streams.remove(&self.number);
    }
}
