//! What may be asked of a drive where its documents are silent.
//!
//! What documents of the very family print may be used. What they print in part, or for a sister series, may be read;
//! written it is only for who [trusts](Rule::trusting) what is not verified, and so is whatever they do not print at all.
//! What has no address cannot be asked for in any case. Profiles know which is which, and why; here the rule stands.
//!
//! It decides, and does nothing: no port is opened, no clock is read, and the same question has the same answer always.
//!
//! ```
//! use drivebus_drive::{Rule, WhyNot};
//! use drivebus_drives::Profile;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let gd350 = Profile::builtin("gd350")?;
//! let rule = Rule::printed(&gd350);
//!
//! // The manual of the GD350 prints its acceleration time, and its answer's delay only those of sister series.
//! assert_eq!(rule.write(gd350.find("P00.11")?), Ok(()));
//! let delay = gd350.find("P14.03")?;
//! assert_eq!(rule.read(delay), Ok(()));
//! let why = rule.write(delay).unwrap_err();
//! assert!(matches!(why, WhyNot::NotPrinted(_)));
//! println!("{why}");
//! # Ok(())
//! # }
//! ```
//!
//! # Rooms
//!
//! | room | what is in it |
//! | --- | --- |
//! | `rule` | may it be read, written, commanded; and why not |

#![forbid(unsafe_code)]

mod rule;

pub use rule::{Rule, WhyNot};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
