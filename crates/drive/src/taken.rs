//! A unit as one of the family that it is taken for: what it may be told, and what a look at it reads.

use std::sync::Arc;

use drivebus_drives::Profile;

use crate::family::Family;
use crate::look::{Look, Looks};
use crate::record::Record;
use crate::rule::Rule;
use crate::same_unit::SameUnit;
use crate::speed::Speeds;
use crate::task::{Mailbox, Notice};

/// A unit as one of a family, under one trust.
#[derive(Debug, Clone)]
pub struct Taken {
    same: SameUnit,
    looks: Arc<Looks>,
    speeds: Arc<Speeds>,
}

impl Taken {
    /// The unit as it was named; `looks` and `speeds` are those of its profile, under the trust that counts for what it is
    /// told as well.
    pub fn as_named(same: SameUnit, looks: &Arc<Looks>, speeds: &Arc<Speeds>) -> Self {
        Self { same, looks: Arc::clone(looks), speeds: Arc::clone(speeds) }
    }

    /// What it is, and said of itself.
    pub fn same(&self) -> &SameUnit {
        &self.same
    }

    /// The unit as one of `family`. Of another one than it was named as, all that is known is trusted: nothing else halts it.
    pub(crate) fn taken_for(&self, family: &Arc<Family>, record: &Record, connection: u64) -> Self {
        if Arc::ptr_eq(family, self.same.family()) {
            return self.clone();
        }
        let identity = record.identity(family.name(), connection);
        Self {
            same: SameUnit::new(self.same.unit(), family, &identity, false),
            looks: Arc::new(Looks::new(family.profile(), true)),
            speeds: Arc::new(Speeds::new(family.profile(), true)),
        }
    }

    /// The same, whose words are known better: by `profile`.
    pub(crate) fn with_profile(&self, profile: &Arc<Profile>) -> Self {
        let is_trusted = self.looks.is_trusted();
        let looks = Arc::new(Looks::new(profile, is_trusted));
        Self { same: self.same.clone(), looks, speeds: Arc::new(Speeds::new(profile, is_trusted)) }
    }

    /// What its words mean.
    pub(crate) fn profile(&self) -> &Arc<Profile> {
        self.looks.profile()
    }

    /// What may be asked of it.
    pub(crate) fn rule(&self) -> Rule<'_> {
        self.looks.rule()
    }

    /// Whether the states of its family may be used.
    pub fn tells_its_state(&self) -> bool {
        self.looks.state().is_ok()
    }

    /// Whether nothing of it may be read.
    pub(crate) fn is_blind(&self) -> bool {
        self.looks.is_blind()
    }

    pub(crate) fn speeds(&self) -> &Speeds {
        &self.speeds
    }

    /// Looks at it, before all who wait where that `is_urgent`, and tells what was seen.
    pub(crate) async fn look<E>(&self, line: &Mailbox<E>, is_urgent: bool) -> Result<Look, E> {
        let unit = self.same.unit();
        let line = line.taken_for(unit, self.same.family());
        let look = self.looks.look(&line, unit, is_urgent).await?;
        if !self.is_blind() {
            line.tell(Notice::Saw(look.clone())).await;
        }
        Ok(look)
    }
}
