//! How a line does: what is counted, how well each unit is reached, and what the figures most likely mean.

pub(crate) mod hint;
mod hint_rules;
pub(crate) mod link;
pub(crate) mod stats;
