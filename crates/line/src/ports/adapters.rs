//! What the system tells of the adapter behind a port: which one it is, who has it, and how long it keeps what it receives.

pub(crate) mod facts;
pub(crate) mod holder;
pub(crate) mod identity;
pub(crate) mod latency;
