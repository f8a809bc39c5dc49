//! The folders in which programs meet: one of this user alone, and one of the machine for the users of a group.
//!
//! No variable says where the user's is: a program that cron starts, a service and one in a terminal have different ones, and
//! have to meet. So `/run/user`, which comes and goes with who is logged in, is not used. Only `DRIVEBUS_RUNTIME_DIR` puts it
//! elsewhere, for tests and for containers that are given another one. It is this user's alone (0700).
//!
//! The machine's is `/run/drivebus`, or where `DRIVEBUS_MACHINE_DIR` says, of the user that serves. The users of its group may
//! put files there and take away their own alone (mode 3771); others may look for a name, so that they are told why they do not
//! come in. Whoever comes from outside asks only who has that folder.

use std::fs::{self, DirBuilder, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use rustix::process::{getegid, geteuid};

/// The variables that put the folders elsewhere.
const ELSEWHERE: &str = "DRIVEBUS_RUNTIME_DIR";
const MACHINE_ELSEWHERE: &str = "DRIVEBUS_MACHINE_DIR";
/// Programs meet on the loopback, as they do where there are no Unix sockets: for the tests of that, and for nobody else.
const OVER_LOOPBACK: &str = "DRIVEBUS_TESTS_OVER_LOOPBACK";
const OF_MACHINE: &str = if cfg!(target_os = "linux") { "/run/drivebus" } else { "/var/run/drivebus" };
/// Files of it belong to its group, and only to who made them.
const MODE: u32 = 0o3771;

/// The folder for the sockets of this user's programs, made where it is missing; nobody else can look into it.
///
/// It is `/tmp/drivebus-UID` in every program, whatever its environment; `DRIVEBUS_RUNTIME_DIR` puts it elsewhere.
///
/// # Errors
///
/// It cannot be made, or is not this user's alone.
pub fn run_time_folder() -> io::Result<PathBuf> {
    of_user().map(|(folder, _)| folder)
}

/// The folder of this user's programs, and whether it is the one that is always the same.
pub(super) fn of_user() -> io::Result<(PathBuf, bool)> {
    let user = geteuid().as_raw();
    let elsewhere = std::env::var_os(ELSEWHERE).filter(|given| !given.is_empty()).map(PathBuf::from);
    let (folder, is_fixed) = match elsewhere {
        Some(given) if given.is_absolute() && is_of(&given, user) => (given.join("drivebus"), false),
        Some(given) => {
            let why = format!("{ELSEWHERE} is {}, which is no folder of this user's", given.display());
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
        }
        None => (PathBuf::from(format!("/tmp/drivebus-{user}")), true),
    };
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let is_private = fs::symlink_metadata(&folder)
        .is_ok_and(|status| status.is_dir() && status.uid() == user && status.mode() & 0o777 == 0o700);
    if !is_private {
        let why = format!("{} is not a folder of this user's alone (mode 0700)", folder.display());
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    Ok((folder, is_fixed))
}

/// Whether the programs of a user meet on the loopback.
pub(super) fn is_over_loopback() -> bool {
    std::env::var_os(OVER_LOOPBACK).is_some()
}

fn is_of(path: &Path, user: u32) -> bool {
    fs::metadata(path).is_ok_and(|status| status.is_dir() && status.uid() == user)
}

fn machine() -> PathBuf {
    let elsewhere = std::env::var_os(MACHINE_ELSEWHERE).filter(|given| !given.is_empty()).map(PathBuf::from);
    elsewhere.unwrap_or_else(|| PathBuf::from(OF_MACHINE))
}

/// The folder in which the users of a group may be served, if there is one that nobody else writes to.
pub(super) fn of_machine() -> Option<PathBuf> {
    let folder = machine();
    let is_good = |status: fs::Metadata| status.is_dir() && status.mode() & 0o002 == 0;
    fs::symlink_metadata(&folder).is_ok_and(is_good).then_some(folder)
}

/// The folder in which this program serves the users of `group`, made where it may be, and theirs.
///
/// # Errors
///
/// It cannot be made, is another user's, or cannot be given to the group.
pub(super) fn of_group(group: u32) -> io::Result<PathBuf> {
    let folder = machine();
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            let why = format!("{} cannot be made for {}: {error}", folder.display(), group_named(group));
            return Err(io::Error::new(error.kind(), why));
        }
        _ => {}
    }
    let status = fs::symlink_metadata(&folder)?;
    let user = geteuid().as_raw();
    if !status.is_dir() || status.uid() != user {
        let why = format!("{} is not a folder of this user's", folder.display());
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    if status.gid() != group {
        std::os::unix::fs::chown(&folder, None, Some(group)).map_err(|error| {
            let why = format!(
                "{} cannot be given to {}: this user has to be in it ({error})",
                folder.display(),
                group_named(group)
            );
            io::Error::new(error.kind(), why)
        })?;
    }
    if status.mode() & 0o7777 != MODE || status.gid() != group {
        fs::set_permissions(&folder, Permissions::from_mode(MODE))?;
    }
    // Who is not in the group is silently refused the bit that gives files to it.
    let is_given = fs::symlink_metadata(&folder)?.mode() & 0o2000 != 0 || getegid().as_raw() == group;
    if !is_given {
        let why = format!("{} cannot be given to {}: this user has to be in it", folder.display(), group_named(group));
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    Ok(folder)
}

/// What the group with this number is called, for people.
pub(super) fn group_named(group: u32) -> String {
    named("/etc/group", group).map_or_else(|| format!("group {group}"), |name| format!("the group {name}"))
}

/// What the user with this number is called, for people.
pub(crate) fn user_named(user: u32) -> String {
    named("/etc/passwd", user).unwrap_or_else(|| user.to_string())
}

/// The name that has this number in a file of the system: the first and the third of its fields.
fn named(file: &str, number: u32) -> Option<String> {
    let file = fs::read_to_string(file).ok()?;
    file.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(number)).then(|| name.to_owned())
    })
}
