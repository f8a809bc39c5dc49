//! Whose a line is. A forked child inherits the descriptor, and everything here as it was at that moment; the line, and
//! what its units still owe, stay the parent's.

/// The process that something was made in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Process(u32);

impl Process {
    /// The one that runs this.
    pub(crate) fn current() -> Self {
        Self(std::process::id())
    }

    /// Whether it is the one that runs this: false in a forked child.
    pub(crate) fn is_current(self) -> bool {
        self == Self::current()
    }
}
