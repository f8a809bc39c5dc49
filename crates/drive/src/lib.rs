//! What may be asked of a drive where its documents are silent, and which drive it is where a word may do harm.
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
//! Units are named by people, and people mistake one drive for another: the word that stops one family starts another.
//! [`Families`] knows whom a word would harm, and [`Apart`] which few words to ask a unit for before it is sent.
//! [`Families::check`] holds what is written by its address against the registers that take commands.
//!
//! A drive that was told to stop says "running" until its motor stands. [`Fall`] takes what is seen of that meanwhile, and
//! knows whether it proves that the motor obeys.
//!
//! What takes several questions is an operation, driven by hand as a [`Task`](task::Task): [`identify()`], [`SameUnit`],
//! [`Aim`], and [`Halt`], which stops a motor and proves it; [`halt_all`] those of several units.
//!
//! # Rooms
//!
//! | room | what is in it |
//! | --- | --- |
//! | `rule` | may it be read, written, commanded; and why not |
//! | `answer` | what a unit says that is asked for a word, and what its refusals tell |
//! | `codes` | identification codes: where they stand, and what is listed of each |
//! | `family`, `families` | a family by what its units answer and refuse; all that a unit may be of |
//! | `harm` | what a word that is meant for one family does to another |
//! | `guard` | what words that are written by their address would command |
//! | `contradiction` | what speaks against a family |
//! | `apart` | which family a unit may be, and what to ask it next |
//! | `fall` | what is seen of a motor that was told to stop, and whether it proves that it obeys |
//! | `asked` | questions to a unit, and which refusals are no answer yet |
//! | `signatures` | whose signature a unit shows |
//! | `identify` | what a unit of which nothing is known is |
//! | `same_unit` | whether a unit is what it was named as, and still the one it was |
//! | `huanyang` | frames of another protocol on the same wires, where others are, too |
//! | `aim` | as what a unit is halted, and whether a word may be sent to it |
//! | `record` | what was sent to a unit, and what it said of itself |
//! | `halt` | a halt: sent until the unit takes it, and proved; and those of several units, side by side |
//! | `planned` | the words of a read plan, one span after the other |
//! | `look` | what the status words of a drive say |
//! | `speed` | how fast a motor turns, and how its drive slows it down |
//! | `taken`, `unit` | a unit as the family that it is taken for, and as one call sees it |
//! | `settled` | what a parameter of the drive decides of the meaning of its words |
//! | `set_otherwise` | which words a unit takes, where a parameter of its drive decides that |
//! | `wanted`, `settings` | what must be set in a drive so that it obeys the bus, and whether it is |
//! | `writing` | one write to a unit that still is what it was |
//! | `setpoint` | the frequency that a drive is to run at |
//! | `ready` | what is looked at before a motor is started |
//! | `command` | starts and resets: checked, sent once, and proved |
//! | `parameters` | values written by name: what is allowed, and where it is kept |
//! | `prepare` | setting a drive to obey the bus |
//! | `given` | what a drive is given over the bus besides its frequency |
//! | `bits` | words whose bits are things of their own: terminals, and the special control word |
//! | `values` | values read by name |
//! | `bus_timeout` | a drive's own time-out of the bus: set, kept from running out, and given back |
//! | `status` | what a drive does at one moment |
//! | `waits` | waiting until a motor has reached its speed, or stands |
//! | `task` | operations that wait for a line, and how they are driven without one |

#![forbid(unsafe_code)]

mod aim;
mod answer;
mod apart;
mod asked;
mod bits;
mod bus_timeout;
mod codes;
mod command;
mod contradiction;
mod fall;
mod families;
mod family;
mod given;
mod guard;
mod halt;
mod harm;
pub mod huanyang;
mod identify;
mod look;
mod parameters;
mod planned;
mod prepare;
mod ready;
mod record;
mod rule;
mod same_unit;
#[cfg(test)]
mod scripted;
mod set_otherwise;
mod setpoint;
mod settings;
mod settled;
mod signatures;
mod speed;
mod status;
mod taken;
pub mod task;
mod unit;
mod unlock;
mod values;
mod waits;
mod wanted;
mod writing;

pub use aim::{ANSWER_WITHIN, Aim, NotTaken, Target, check_harmless, goes_out_at_once};
pub use answer::{Answer, Said, meanings, protocol};
pub use apart::{Apart, Verdict};
pub use asked::{NotTold, answer_at, answer_once};
pub use bits::{FieldInput, NotSetBits};
pub use bus_timeout::{Back, BusTimeout, NotArmable, NotArmed, NotAsked, NotGivenBack, OnSilence, WhyNotArmed};
pub use codes::Codes;
pub use command::{NotCommanded, NotLedUp, Start, WhyNotCommanded, WhyNotLedUp};
pub use contradiction::Contradiction;
pub use fall::{Fall, Glimpse};
pub use families::Families;
pub use family::{Family, HALTS};
pub use given::NotGiven;
pub use guard::Forbidden;
pub use halt::{After, Besides, Halt, LastLook, NotHalted, Order, Tries, Why, halt_all};
pub use harm::What;
pub use identify::{Certainty, Identification, Reason, identify};
pub use look::{Look, Looks};
pub use parameters::{Beyond, Held, InForce, NotKept, NotPlanned, WhyNotKept, WhyNotPlanned, WhyNotStored};
pub use prepare::NotPrepared;
pub use ready::{Ignores, NotReady};
pub use record::{Record, Sent};
pub use rule::{Rule, WhyNot};
pub use same_unit::{Identity, NotSame, SameUnit, Told};
pub use set_otherwise::SetOtherwise;
pub use setpoint::NotSet;
pub use settings::Setting;
pub use settled::NotSettled;
pub use speed::{Frequencies, Ramp, STANDSTILL, Speeds};
pub use status::Status;
pub use taken::Taken;
pub use unit::Unit;
pub use values::{NotRead, NotThere, Values};
pub use waits::NotReached;
pub use writing::{NotWritten, Words};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
