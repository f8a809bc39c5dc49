//! What must be set in a drive before it obeys the bus, and heeds what the bus tells it.

use std::collections::BTreeSet;

use drivebus_drives::{Control, Profile, Setpoint};

/// What must be set in any case, or the words of the profile are not where it has them.
pub(crate) fn wanted_always(profile: &Profile) -> Vec<Control> {
    profile.control().iter().filter(|row| row.always).cloned().collect()
}

/// What must be set for commands alone, whatever the setpoints.
pub(crate) fn wanted_of_commands(profile: &Profile) -> Vec<Control> {
    let of_setpoints: BTreeSet<_> =
        profile.setpoints().values().flat_map(|role| &role.needs).map(|row| row.code.as_str()).collect();
    profile.control().iter().filter(|row| !of_setpoints.contains(row.code.as_str())).cloned().collect()
}

/// What must be set for `setpoint` alone.
pub(crate) fn needs_of(profile: &Profile, setpoint: Setpoint) -> &[Control] {
    profile.setpoints().get(&setpoint).map_or(&[], |role| &role.needs)
}

/// What must be set so that only the bus commands the drive and gives it `setpoint`, in the order in which to set it.
pub(crate) fn wanted_for(profile: &Profile, setpoint: Setpoint) -> Vec<&Control> {
    let needs = needs_of(profile, setpoint);
    let told = needs_of(profile, Setpoint::Frequency).iter().chain(needs);
    let of_setpoints: BTreeSet<_> = told.map(|row| row.code.as_str()).collect();
    profile.control().iter().filter(|row| !of_setpoints.contains(row.code.as_str())).chain(needs).collect()
}
