//! Locks and threads whose order is the test's to decide.

pub(crate) use std::sync::{PoisonError, TryLockError};

pub(crate) use shuttle::sync::{Condvar, Mutex, MutexGuard, atomic};

pub(crate) mod thread {
    //! Threads that wait until they are called, or until a time is over that passes.

    use std::time::Duration;

    use shuttle::rand::{Rng, thread_rng};
    pub(crate) use shuttle::thread::*;

    use crate::system::clock;

    pub(crate) fn park_timeout(time: Duration) {
        if clock::passes() && thread_rng().r#gen() {
            clock::advance(time);
            yield_now();
        } else {
            park();
        }
    }
}
