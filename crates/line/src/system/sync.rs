//! The locks and threads of the queue. A test (`tests/schedules`) compiles the queue with others in their place, which run it
//! in whatever order can be.

pub(crate) use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, atomic};
pub(crate) use std::thread;
