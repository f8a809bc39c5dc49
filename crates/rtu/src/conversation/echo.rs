//! Adapters that send our own bytes back.
//!
//! A write and an echo are confirmed by the very bytes of the request, so an adapter that echoes would confirm what no
//! unit has heard.

/// How often one attempt looks whether the adapter echoes, where noise hides it.
pub(super) const LOOKS: u32 = 3;

/// What is known about the adapter sending our own bytes back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OwnEcho {
    /// Nothing yet: it is found out.
    Unknown,
    /// It does: the request is taken off before every answer.
    Present,
    /// It does not.
    Absent,
}
