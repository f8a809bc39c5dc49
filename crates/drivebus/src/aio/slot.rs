//! Where another thread leaves what a future waits for.

use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Poll, Waker};

/// What will be there, and who is woken then.
#[derive(Debug)]
pub(super) struct Slot<T>(Mutex<State<T>>);

#[derive(Debug)]
struct State<T> {
    value: Option<T>,
    waker: Option<Waker>,
}

impl<T> Slot<T> {
    pub(super) fn new() -> Arc<Self> {
        Arc::new(Self(Mutex::new(State { value: None, waker: None })))
    }

    /// Leaves `value`, and wakes who waits.
    pub(super) fn put(&self, value: T) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.value = Some(value);
        let waker = state.waker.take();
        drop(state);
        if let Some(waker) = waker {
            waker.wake();
        }
    }

    /// Takes what is there; else has `waker` woken when it comes.
    pub(super) fn poll(&self, waker: &Waker) -> Poll<T> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = state.value.take() {
            return Poll::Ready(value);
        }
        state.waker = Some(waker.clone());
        Poll::Pending
    }
}
