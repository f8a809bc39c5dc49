//! The queue at the line, its crew, the bus around them and its door as they are shipped, on locks and threads of `shuttle`,
//! which runs them in whatever order can be. What is proved of each order stands in [`scenarios`].
//!
//! Their files are compiled in here from `crates/line`, which knows nothing of it. Others here are what they rest on: locks,
//! time and sockets (`system`), connections (`share`), and a line that only notices who uses it (`owner`). No wait ends by its
//! time unless a scenario lets time pass, so a wake-up that is lost is a deadlock, which shuttle finds.

// The tests that stand in those files are `crates/line`'s.
#![cfg(not(test))]

pub mod scenarios;

#[expect(clippy::unused_self, reason = "it looks as what is shipped does")]
mod owner;
mod ports;
#[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "it looks as what is shipped does")]
mod system {
    pub(crate) mod clock;
    pub(crate) mod inherited;
    pub(crate) mod process;
    pub(crate) mod punctual;
    pub(crate) mod sockets;
    pub(crate) mod sync;
}

use shipped::{ask, by_unit, error, line, options, trace};

#[path = "../../../crates/line/src"]
#[allow(
    dead_code,
    unreachable_pub,
    unused_imports,
    reason = "the whole of what is shipped, of which the scenarios need some"
)]
mod shipped {
    pub(crate) mod ask;
    pub(crate) mod by_unit;
    pub(crate) mod error;
    pub(crate) mod line;
    pub(crate) mod options;
    pub(crate) mod trace;
}

#[path = "../../../crates/line/src/health"]
#[allow(dead_code, unreachable_pub, reason = "the whole of what is shipped, of which the scenarios need some")]
mod health {
    pub(crate) mod link;
    pub(crate) mod stats;
}

#[path = "../../../crates/line/src/turns"]
#[allow(dead_code, unreachable_pub, reason = "the whole of what is shipped, of which the scenarios need most")]
mod turns {
    pub(crate) mod crew;
    pub(crate) mod order;
    pub(crate) mod queue;
}

// What stands here in the place of a shipped file is included: a path would begin at those that are shipped.
#[path = "../../../crates/line/src/share"]
#[allow(dead_code, unreachable_pub, reason = "the whole of what is shipped, of which the scenarios need some")]
mod share {
    pub(crate) mod failure;
    pub(crate) mod message;

    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "it looks as what is shipped does")]
    pub(crate) mod channel {
        include!("share/channel.rs");
    }
    pub(crate) mod folder {
        include!("share/folder.rs");
    }
    pub(crate) mod guest {
        include!("share/guest.rs");
    }
    #[expect(clippy::unused_self, reason = "it looks as what is shipped does")]
    pub(crate) mod place {
        include!("share/place.rs");
    }

    pub(crate) mod proof {
        include!("share/proof.rs");
    }

    /// A time as it travels.
    pub(crate) fn nanos(time: std::time::Duration) -> u64 {
        u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
    }
}

#[path = "../../../crates/line/src/bus"]
#[allow(dead_code, unreachable_pub, reason = "the whole of what is shipped, of which the scenarios need most")]
mod bus {
    pub(crate) mod call;
    mod clock;
    pub(crate) mod errand;
    pub(crate) mod figures;
    mod halts_told;
    pub(crate) mod host;
    mod listen;
    mod openings;
    pub(crate) mod port;
    pub(crate) mod programs;
    pub(crate) mod shared;
    // Between the bus and its door: programs come in to the port of one that shares with nobody else.
    #[path = "no_sharing.rs"]
    mod sharing;
    pub(crate) mod spoken;
    #[path = "unshared.rs"]
    mod through;
    pub(crate) mod workers;

    mod here {
        include!("bus.rs");
    }
    #[expect(clippy::unused_self, reason = "it looks as what is shipped does")]
    pub(crate) mod wills {
        include!("wills.rs");
    }

    pub(crate) use here::{Bus, OpenDoor};
}
