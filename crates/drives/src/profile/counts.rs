//! Counts: how much of a profile is documented.

use crate::entry::{Entry, Kind};
use crate::evidence::Evidence;
use crate::profile::Profile;

/// How many rows of one table there are, and on what they rest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// All rows.
    pub total: usize,
    /// Rows that name a source.
    pub sourced: usize,
    /// Rows that are printed in part or for a sister series.
    pub unverified: usize,
    /// Rows that no document of the family prints.
    pub assumed: usize,
}

impl Counts {
    fn of<'a>(rows: impl Iterator<Item = (Evidence, &'a str)>) -> Self {
        let mut counts = Self::default();
        for (evidence, source) in rows {
            counts.total += 1;
            counts.sourced += usize::from(!source.is_empty());
            counts.unverified += usize::from(evidence == Evidence::Unverified);
            counts.assumed += usize::from(evidence == Evidence::Assumed);
        }
        counts
    }
}

impl Profile {
    /// How much is documented of the registers or of the parameters.
    pub fn count_entries(&self, kind: Kind) -> Counts {
        let of_kind = self.entries().filter(|entry| entry.kind() == kind);
        Counts::of(of_kind.map(|entry: &Entry| (entry.evidence(), entry.source())))
    }

    /// How much is documented of the faults.
    pub fn count_faults(&self) -> Counts {
        Counts::of(self.faults().map(|fault| (fault.evidence, fault.source.as_str())))
    }
}
