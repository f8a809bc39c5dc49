//! What only the drive knows of a write: whether its motor stands, and how far its own parameters narrow the range.

use std::collections::BTreeMap;

use drivebus_drives::{Access, Entry, Kind, Profile, Value};

use super::not_kept::{Beyond, Held, WhyNotKept};
use super::plan::Planned;
use crate::task::{LineError, Mailbox, Notice};
use crate::unit::Unit;

type Why<E> = WhyNotKept<E>;

/// Another parameter that narrows a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Limit<'p> {
    /// Its code.
    pub(super) other: &'p str,
    is_low: bool,
}

/// The parameters that narrow the range of `entry`, by its own row or by theirs.
pub(super) fn limits<'p>(profile: &'p Profile, entry: &Entry) -> Vec<Limit<'p>> {
    let named = |name: Option<&str>| name.and_then(|name| profile.find(name).ok());
    let quantity = entry.quantity();
    let own = [(quantity.low_from(), true), (quantity.high_from(), false)];
    let mut limits: Vec<_> = own
        .into_iter()
        .filter_map(|(name, is_low)| named(name).map(|entry| Limit { other: entry.name(), is_low }))
        .collect();
    if entry.kind() == Kind::Parameter {
        for other in profile.entries().filter(|other| other.kind() == Kind::Parameter) {
            let theirs = [(other.quantity().low_from(), false), (other.quantity().high_from(), true)];
            for (name, is_low) in theirs {
                let is_narrowed = named(name).is_some_and(|narrowed| narrowed.name() == entry.name());
                // What its own row has stands as it has it.
                if is_narrowed && !limits.iter().any(|limit| limit.other == other.name()) {
                    limits.push(Limit { other: other.name(), is_low });
                }
            }
        }
    }
    limits
}

impl Unit {
    /// Checks what only the drive knows, in the fewest reads; none where nothing depends on it.
    pub(crate) async fn check_now<E: LineError>(
        &self,
        line: &Mailbox<E>,
        planned: &[Planned<'_>],
    ) -> Result<(), Why<E>> {
        let profile = self.profile();
        let only_stopped: Vec<_> = planned.iter().filter(|item| item.entry.access() == Access::Stop).collect();
        // Where no state is known the drive has to refuse by itself.
        let is_told = !only_stopped.is_empty() && self.tells_its_state();
        let state = profile.role("state").filter(|_| is_told).map(Entry::name);
        let mut names: Vec<_> = state.into_iter().collect();
        let mut others = Vec::new();
        for limit in planned.iter().flat_map(|item| limits(profile, &item.entry)) {
            let is_readable = profile.find(limit.other).is_ok_and(|entry| self.rule().read(entry).is_ok());
            if is_readable && !others.contains(&limit.other) {
                others.push(limit.other);
            }
        }
        names.extend(&others);
        if names.is_empty() {
            return Ok(());
        }
        let unit = self.settled(line, &names).await.map_err(Why::NotSettled)?;
        let entries: Vec<_> = names.iter().filter_map(|name| unit.profile().find(name).ok()).collect();
        let mut values = unit.values(line, &entries).await.map_err(Why::Failed)?.into_iter();
        if let Some(word) = state.and_then(|_| values.next()) {
            let state = profile.state(word.word());
            line.taken_for(self.address(), self.family()).tell(Notice::Shows(state)).await;
            if state.is_running() {
                let names = only_stopped.iter().map(|item| item.name.to_owned()).collect();
                return Err(Why::Running { names, state });
            }
        }
        let mut in_force: BTreeMap<_, _> = others.into_iter().zip(values).collect();
        for item in planned {
            unit.check_range(item, &in_force).map_err(Why::Beyond)?;
            in_force.insert(item.key(), item.value());
        }
        Ok(())
    }

    /// Whether `item` may be written while the parameters that are `in_force` have these values.
    fn check_range(&self, item: &Planned<'_>, in_force: &BTreeMap<&str, Value>) -> Result<(), Box<Beyond>> {
        let value = item.value().to_f64();
        for Limit { other, is_low } in limits(self.profile(), &item.entry) {
            let Some((limit, &bound)) = self.profile().find(other).ok().zip(in_force.get(other)) else { continue };
            let is_within = if is_low { value >= bound.to_f64() } else { value <= bound.to_f64() };
            if !is_within {
                let limit = Held::of(other, limit, bound);
                return Err(Box::new(Beyond { wanted: item.held(&item.words), limit, is_below: is_low }));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
