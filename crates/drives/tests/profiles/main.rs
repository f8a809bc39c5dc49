//! What profiles say, and what is said of a profile that is wrong: the shipped ones, and others that tests write.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod broken;
mod control_words;
mod folder;
mod gd350;
mod listed;
mod names;
mod over;
mod plan;
mod rows;
mod scales;
mod scaling;
mod search;
mod two_ways;
mod unlisted;
mod vfd500;
