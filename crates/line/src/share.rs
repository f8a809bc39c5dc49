//! One port, several programs of one user or of a group: what they say to each other, and where they meet.
//!
//! | room | what is in it |
//! | --- | --- |
//! | `key` | which port it is, whatever people call it |
//! | `folder` | the folders in which programs meet |
//! | `secret`, `proof` | what programs of one user know, and how they show it where the system tells nobody who is who |
//! | `place` | what stands in a folder for a port, and who may use it |
//! | `message`, `failure` | what is said |
//! | `channel` | one connection: messages in and out, with limits |
//! | `guest` | the side of a program that uses a port through another |
//! | `will` | what is left to be done for a program that is gone |
//!
//! The side of the program that has the port is `bus::host`.

pub(crate) mod channel;
pub(crate) mod failure;
#[cfg_attr(not(unix), path = "share/profile_folder.rs")]
pub(crate) mod folder;
pub(crate) mod guest;
pub(crate) mod message;
pub(crate) mod place;
pub(crate) mod proof;
pub(crate) mod secret;
#[cfg(unix)]
pub(crate) mod will;

use std::time::Duration;

/// A time as it travels: nanoseconds, and the most that fit where they do not.
pub(crate) fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
