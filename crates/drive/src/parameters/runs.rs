//! Which of several writes may share a request.

use std::collections::BTreeSet;

use drivebus_drives::{Access, Entry, Profile};

use super::bounds::limits;
use super::plan::Planned;

/// The writes in their order; those that may share a request stand together.
pub(super) fn runs<'r, 'p>(profile: &Profile, planned: &'r [Planned<'p>]) -> Vec<&'r [Planned<'p>]> {
    let mut runs = Vec::new();
    let mut from = 0;
    for (at, item) in planned.iter().enumerate() {
        if at > from && !may_follow(profile, &planned[from..at], item) {
            runs.push(&planned[from..at]);
            from = at;
        }
    }
    if from < planned.len() {
        runs.push(&planned[from..]);
    }
    runs
}

/// Whether `item` may be written by the request that writes `run`.
///
/// What narrows another one's range does not share its request: in which order a drive checks the words is not printed.
fn may_follow(profile: &Profile, run: &[Planned<'_>], item: &Planned<'_>) -> bool {
    let Some(last) = run.last() else { return false };
    let is_next = item.place.table == last.place.table && last.place.address.checked_add(1) == Some(item.place.address);
    if !is_next || run.len() >= usize::from(profile.requests().max_written) || profile.requests().joined.is_none() {
        return false;
    }
    let alone = alone(profile);
    if ![last, item].into_iter().all(|each| is_plain(profile, each) && !alone.contains(each.key())) {
        return false;
    }
    let is_bound_by = |one: &Planned<'_>, other: &Planned<'_>| {
        limits(profile, &one.entry).iter().any(|limit| limit.other == other.key())
    };
    !run.iter().any(|each| is_bound_by(item, each) || is_bound_by(each, item))
}

/// Whether `item` is a parameter that is simply kept, while the drive runs too.
fn is_plain(profile: &Profile, item: &Planned<'_>) -> bool {
    item.is_parameter()
        && item.words.len() == 1
        && item.entry.access() == Access::Run
        && profile.read_back(&item.entry).is_some()
}

/// Parameters that decide who commands the drive, or how the line is set.
fn alone(profile: &Profile) -> BTreeSet<&str> {
    let control = profile.control().iter().filter_map(|row| profile.find(&row.code).ok());
    profile.serial_parameters().chain(control).map(Entry::name).collect()
}
