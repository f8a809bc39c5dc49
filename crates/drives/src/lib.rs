//! What variable-frequency drives mean by their registers: pure data and arithmetic.
//!
//! A drive speaks in 16-bit words. This crate knows, for a family of drives, which word is the output current and that
//! it counts tenths of an ampere; that 5 stops the motor and 6 lets it coast; that fault 11 is a motor overload; and how
//! to ask for many values in the fewest reads. It opens no port, sends nothing and reads no clock. The only input it
//! does is [`Profile::load`], which reads a folder.
//!
//! ```
//! use drivebus_drives::{Command, Profile, State};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let gd350 = Profile::builtin("gd350")?;
//!
//! let current = gd350.find("output_current")?;
//! assert_eq!(current.address(), Some(0x3004));
//! assert_eq!(current.decode(57).to_string(), "5.7");
//! assert_eq!(current.quantity().unit(), "A");
//!
//! assert_eq!(gd350.find("p00.11")?.encode(5.0)?, 50);
//! assert_eq!(gd350.find("set_frequency")?.encode("12.34")?, 1234);
//! assert!(gd350.find("set_frequency")?.encode(10.005).is_err(), "the drive counts hundredths");
//!
//! assert_eq!(gd350.command(Command::Coast), Some((0x2000.into(), 6)));
//! assert_eq!(gd350.state(3), State::Stopped);
//! assert_eq!(gd350.fault(11).label, "Motor overload");
//! # Ok(())
//! # }
//! ```
//!
//! # Profiles
//!
//! A family is a folder: `profile.toml` holds the rules, `registers.csv`, `parameters.csv` and `faults.csv` the long
//! tables, each row with its source. Shipped profiles are part of the program; [`Profile::builtin_names`] lists them.
//!
//! # Features
//!
//! `builtin-profiles`, on by default: the shipped profiles are part of the program. Without it [`Profile::load`] is the only
//! way to one.
//!
//! # Limits
//!
//! - A profile says what manuals say. What no manual prints is unknown here, and `evidence` says how well the rest is proved.
//! - A value takes one word or two. Texts and longer values of some drives have no form here.
//!
//! # Rooms
//!
//! Each rests on those before it.
//!
//! | room | what is in it |
//! | --- | --- |
//! | `decimal`, `text`, `evidence` | exact numbers, text as people write it, how well a fact is proved |
//! | `value`, `quantity`, `bits`, `entry` | what a word means, and the register or parameter that holds it |
//! | `place` | an address, and which of a drive's tables it is one of |
//! | `plan` | many words in the cheapest reads |
//! | `parts` | what a profile is made of beside its entries: commands, states, faults, … |
//! | `profile` | all that is known of a family, and the questions it answers |
//! | `load` | how a profile comes into being: read from a folder, and checked |
//!
//! # Decisions
//!
//! * Scaling is decimal arithmetic on digits. A float goes in by its shortest decimal form, so `0.29` means 0.29, and
//!   no product of floats decides what a motor does.
//! * What a manual does not print stays empty. Where the scale is missing, the quantity is in counts: its unit is
//!   `"raw"`, whatever it measures. Rows that rest on another family's manual or on inference are not `verified`.
//! * A bound that is another parameter (`P00.03` for frequencies) is checked at its own limit here, because this crate
//!   knows no drive's settings, and named, so that a caller who read the parameter can check further.

#![forbid(unsafe_code)]

mod bits;
mod decimal;
mod entry;
mod evidence;
mod load;
mod parts;
mod place;
mod plan;
mod profile;
mod quantity;
mod scale;
mod sheet;
mod text;
mod value;

pub use bits::BitField;
pub use entry::{Access, AccessError, Entry, Kind, Store};
pub use evidence::Evidence;
pub use load::ProfileError;
pub use parts::called::{Alias, Called};
pub use parts::command::{Command, CommandCode, Control, OtherWords, ParseCommandError, StartWord, Until};
pub use parts::fault::{Exception, Fault, Means};
pub use parts::identification::{Identification, Signature};
pub use parts::memory::{Memory, MemoryBit, StoreWord, ToldBy};
pub use parts::rules::{Protocol, Requests, UnitKind};
pub use parts::serial::SerialDefaults;
pub use parts::setpoint::{Setpoint, SetpointRole};
pub use parts::state::{State, StateRule, StateWord};
pub use parts::unlock::Unlock;
pub use parts::variant::{Share, Variant, VariantChoice, VariantError};
pub use parts::watchdog::Watchdog;
pub use place::{Place, Table};
pub use plan::{ReadCost, ReadSpan, plan_reads};
pub use profile::Profile;
pub use profile::counts::Counts;
pub use profile::lookup::NameError;
pub use profile::read_plan::ReadPlan;
pub use quantity::Quantity;
pub use sheet::{Sheet, SheetError, decode, whole_lines};
pub use value::{Input, Limits, OwnedInput, Value, ValueError};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
