//! A poll whose samples are awaited.

use std::future::poll_fn;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use drivebus_line::PollCounts;

use super::asked::Asked;
use super::slot::Slot;
use crate::poll::{Poll as Blocking, Sample};

/// A poll under way, whose samples are awaited. It ends when it is dropped.
#[derive(Debug)]
pub struct Poll(Blocking);

impl Poll {
    pub(super) fn new(poll: Blocking) -> Self {
        Self(poll)
    }

    /// The next sample; `None` when the poll has ended.
    ///
    /// Who drops it while it waits has lost no sample.
    pub async fn next(&self) -> Option<Sample> {
        loop {
            if let Some(sample) = self.0.take() {
                return Some(sample);
            }
            if self.0.is_over() {
                // One may have come in between.
                return self.0.take();
            }
            self.wait().await;
        }
    }

    /// Waits until there is a sample, or the poll has ended.
    async fn wait(&self) {
        if self.0.is_virtual {
            // Somebody has to wait, for time to move.
            let core = Arc::clone(&self.0.core);
            let waited = Asked::apart(move |wanted| {
                // It fails only where the poll is over for this process.
                let _ = core.wait(1, None, &mut || !wanted.load(Ordering::Acquire));
                Ok(())
            });
            let _ = waited.await;
            return;
        }
        let slot = Slot::new();
        let (wanted, there) = (StillWanted::new(), Arc::clone(&slot));
        self.0.core.call_when(1, Arc::clone(&wanted.0), move || there.put(()));
        poll_fn(|context| slot.poll(context.waker())).await;
    }

    /// What was done so far.
    pub fn counts(&self) -> PollCounts {
        self.0.counts()
    }

    /// Ends the poll; what is under way ends by itself.
    pub fn stop(&self) {
        self.0.core.stop();
    }
}

/// Says so when nobody waits any more.
struct StillWanted(Arc<AtomicBool>);

impl StillWanted {
    fn new() -> Self {
        Self(Arc::new(AtomicBool::new(true)))
    }
}

impl Drop for StillWanted {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}
