//! The locks and threads of the queue, and of the bus around it. A test (`tests/schedules`) compiles both with others in their
//! place, which run them in whatever order can be.

pub(crate) use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, TryLockError, atomic};
pub(crate) use std::thread;
