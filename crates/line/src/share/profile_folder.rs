//! The folder in which the programs of one user meet, where the system has a folder of settings for each user.
//!
//! It is `%LOCALAPPDATA%\drivebus`. That lies in the user's profile, whose access list lets in this user, the system and those
//! who administer it; what is made in it has the same. Nothing here looks whether somebody has changed that.

use std::fs;
use std::io;
use std::path::PathBuf;

/// The variable by which the system says where a user's settings of this machine are.
const SETTINGS: &str = "LOCALAPPDATA";

/// The folder of this user's programs, made where it is missing.
///
/// # Errors
///
/// The system does not say where it is, or it cannot be made.
pub(super) fn of_user() -> io::Result<PathBuf> {
    let settings = std::env::var_os(SETTINGS).map(PathBuf::from).filter(|settings| settings.is_absolute());
    let why =
        || io::Error::new(io::ErrorKind::NotFound, format!("{SETTINGS} does not say where this user's folder is"));
    let folder = settings.ok_or_else(why)?.join("drivebus");
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// What the user with this number is called, for people: nobody is known by a number here.
pub(crate) fn user_named(user: u32) -> String {
    user.to_string()
}
