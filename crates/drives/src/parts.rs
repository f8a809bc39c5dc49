//! What a profile is made of beside its registers and parameters: each a fact of the family, with what proves it.

pub(crate) mod called;
pub(crate) mod command;
pub(crate) mod fault;
pub(crate) mod identification;
pub(crate) mod memory;
pub(crate) mod rules;
pub(crate) mod serial;
pub(crate) mod setpoint;
pub(crate) mod state;
pub(crate) mod unlock;
pub(crate) mod variant;
pub(crate) mod watchdog;
