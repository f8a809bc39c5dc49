//! Evidence: how well a fact is documented, and so whether it may be used without being asked for by name.

/// How well documents of the family prove a fact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Evidence {
    /// Documents of this family print it.
    Verified,
    /// It is printed in part, or for a sister series. It may be read; to write it is for who says so.
    Unverified,
    /// No document of the family prints it. Reading and writing it are for who says so.
    Assumed,
}

impl Evidence {
    /// Every level, the best first.
    pub const ALL: [Self; 3] = [Self::Verified, Self::Unverified, Self::Assumed];

    /// Its name in programs: `verified`, `unverified`, `assumed`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Verified => "verified",
            Self::Unverified => "unverified",
            Self::Assumed => "assumed",
        }
    }

    /// Its name in the tables of a profile: `yes`, `no`, `assumed`.
    pub(crate) const fn cell(self) -> &'static str {
        match self {
            Self::Verified => "yes",
            Self::Unverified => "no",
            Self::Assumed => "assumed",
        }
    }
}
