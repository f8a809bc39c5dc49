//! What a unit is and why, in plain words.

use std::fmt;

use super::{Certainty, Identification, Reason};
use crate::answer::{Answer, LOCKED, Said};

impl Certainty {
    /// All of them, the surest first.
    pub const ALL: [Self; 5] = [Self::Certain, Self::Shared, Self::Unverified, Self::ByAnswers, Self::Unknown];

    /// The certainty of that [`name`](Self::name).
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|certainty| certainty.name() == name)
    }

    /// As programs write it: `by answers`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Certain => "certain",
            Self::Shared => "shared",
            Self::Unverified => "unverified",
            Self::ByAnswers => "by answers",
            Self::Unknown => "unknown",
        }
    }
}

impl fmt::Display for Certainty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Identification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unit {}: ", self.unit.get())?;
        if self.titles.is_empty() {
            f.write_str("not known")?;
        }
        joined(f, &self.titles, " or ")?;
        write!(f, " ({}: ", self.certainty)?;
        match &self.reason {
            Reason::Code { place, alone, source, against } => {
                write!(f, "it reports {:04X}H at {place}", self.code.unwrap_or_default())?;
                match alone {
                    Certainty::Unverified => write!(f, ", which no document prints, only {source}")?,
                    Certainty::Shared => {
                        f.write_str(", which several share: ")?;
                        joined(f, &self.candidates, " and ")?;
                    }
                    _ => write!(f, ", printed in {source}")?,
                }
                if let Some(against) = against {
                    f.write_str("; but ")?;
                    said(f, *against)?;
                    f.write_str(", where such a drive has its state")?;
                }
            }
            Reason::Answers(seen) => {
                f.write_str("it has no known code, and answers like such a unit")?;
                for (nth, (place, is_answered)) in seen.iter().enumerate() {
                    let before = if nth == 0 { ": " } else { ", " };
                    write!(f, "{before}{place} {}", if *is_answered { "answered" } else { "refused" })?;
                }
            }
            Reason::Nothing(told) => {
                for answer in told {
                    said(f, *answer)?;
                    f.write_str("; ")?;
                }
                f.write_str("what it answers fits no known family")?;
            }
        }
        f.write_str(")")
    }
}

fn said(f: &mut fmt::Formatter<'_>, answer: Answer) -> fmt::Result {
    let place = answer.place;
    match answer.said {
        Said::Word(word) => write!(f, "it says {word:04X}H at {place}"),
        Said::Refused(LOCKED) => write!(f, "it refuses {place} (exception 09H: a user password may lock it)"),
        Said::Refused(code) => write!(f, "it refuses {place} (exception {:02X}H)", code.0),
    }
}

/// `A, B or C`, where `last` is ` or `.
fn joined(f: &mut fmt::Formatter<'_>, names: &[String], last: &str) -> fmt::Result {
    for (nth, name) in names.iter().enumerate() {
        let before = match nth {
            0 => "",
            _ if nth + 1 == names.len() => last,
            _ => ", ",
        };
        write!(f, "{before}{name}")?;
    }
    Ok(())
}
