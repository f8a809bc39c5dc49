//! Whose turn it is at the line: the order of those who wait, the queue they wait in, and the crew for work without a
//! thread.

pub(crate) mod crew;
pub(crate) mod order;
pub(crate) mod queue;
