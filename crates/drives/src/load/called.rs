//! Which shipped profile is meant by what stands on a drive.

use std::sync::OnceLock;

use super::{BUILTINS, Builtin};
use crate::profile::Profile;
use crate::text::folded;

/// Each name of the shipped drives, folded, with where its profile stands among the shipped ones.
///
/// Only who names a drive otherwise than its profile pays for it: all of them are loaded.
fn known() -> &'static [(String, usize)] {
    static KNOWN: OnceLock<Vec<(String, usize)>> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let names = |(index, builtin): (usize, &Builtin)| {
            let profile = Profile::builtin(builtin.name).ok()?;
            let names = profile.called().names(profile.title()).chain([builtin.name]);
            Some(names.map(|name| (folded(name), index)).collect::<Vec<_>>())
        };
        BUILTINS.iter().enumerate().filter_map(names).flatten().collect()
    })
}

/// The shipped profile of the drives that are called `name`; `None` where there is none, or several are.
pub(super) fn shipped(name: &str) -> Option<&'static Builtin> {
    let wanted = folded(name);
    let mut found = known().iter().filter(|(known, _)| *known == wanted).map(|&(_, index)| index);
    let first = found.next()?;
    found.all(|other| other == first).then(|| BUILTINS.get(first))?
}
