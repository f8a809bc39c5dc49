//! The queue at the line and its crew as they are shipped, on locks and threads of `shuttle`, which runs them in whatever
//! order can be. What is proved of each order stands in [`scenarios`].
//!
//! Their files are compiled in here from `crates/line`, which knows nothing of it: only `system::sync` and `system::clock`
//! are others here. No wait ends by its time unless a scenario lets time pass, so a wake-up that is lost is a deadlock, which
//! shuttle finds.

// The tests that stand in those files are `crates/line`'s.
#![cfg(not(test))]

pub mod scenarios;

mod system {
    pub(crate) mod clock;
    pub(crate) mod sync;
}

#[path = "../../../crates/line/src/turns"]
#[allow(dead_code, unreachable_pub, reason = "the whole of what is shipped, of which the scenarios need most")]
mod turns {
    pub(crate) mod crew;
    pub(crate) mod order;
    pub(crate) mod queue;
}
