//! What a unit is, as far as it tells: by its identification code, or by which words it answers and which it refuses.
//!
//! Only reads are wished for here. Whether what was found is enough to command a motor by it, whoever commands decides.

mod words;

use std::collections::BTreeSet;
use std::sync::Arc;

use drivebus_drives::{Entry, Evidence, Identification as Row, Place};
use drivebus_rtu::UnitAddress;
use drivebus_rtu::huanyang::Protocol;

use crate::answer::{Answer, Said};
use crate::asked::{NotTold, answer_at, is_unreached};
use crate::families::Families;
use crate::family::Family;
use crate::signatures::{Asked, shown_by, wanted};
use crate::task::{LineError, Mailbox, Read};

/// How sure it is what a unit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Certainty {
    /// A code that documents print for the family, and nobody else reports.
    Certain,
    /// A code that several report.
    Shared,
    /// A code that no document prints, or of a unit that does not behave as such a drive.
    Unverified,
    /// No code that is known, but it answers and refuses the words that such a unit does.
    ByAnswers,
    /// Nothing is known.
    Unknown,
}

/// What a unit is, as far as it tells.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Identification {
    /// Which unit.
    pub unit: UnitAddress,
    /// The families that it may be, by the names of their profiles. Of some there is no profile yet.
    pub candidates: Vec<String>,
    /// The identification code that it gave, any of 0..=0xFFFF; `None` if it gave none.
    pub code: Option<u16>,
    /// What the unit is called by its maker, each name that it may have once; none if nothing is known.
    pub titles: Vec<String>,
    /// How sure that is.
    pub certainty: Certainty,
    /// And why.
    pub reason: Reason,
}

/// Why a unit is taken for what it is.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// It gave a code that is listed.
    Code {
        /// Where it was asked for that.
        place: Place,
        /// How sure it would be by the code alone.
        alone: Certainty,
        /// Where that stands: the document that prints it, or else what has it.
        source: String,
        /// What it said of its state that no such drive says.
        against: Option<Answer>,
    },
    /// It gave no such code, and answered these words or, where `false`, refused them, as such units do.
    Answers(Vec<(Place, bool)>),
    /// This is all that it said where units have their codes, and none is known.
    Nothing(Vec<Answer>),
}

impl Identification {
    /// The family that it is, by the name of its profile, if there is only one candidate.
    pub fn family(&self) -> Option<&str> {
        match self.candidates.as_slice() {
            [one] => Some(one),
            _ => None,
        }
    }

    /// The one of `families` that it surely enough is to command a motor by it: see [`Certainty::usable`].
    pub fn usable<'f>(&self, families: &'f Families, is_unverified: bool) -> Option<&'f Arc<Family>> {
        self.certainty.usable(&self.candidates, families, is_unverified)
    }
}

impl Certainty {
    /// The one of `families` that a unit surely enough is to command a motor by it, which may be each of `candidates`.
    ///
    /// That takes a printed code, and one candidate that is among them. Where `is_unverified`, the only candidate will do.
    pub fn usable<'f>(
        self,
        candidates: &[String],
        families: &'f Families,
        is_unverified: bool,
    ) -> Option<&'f Arc<Family>> {
        let is_sure = matches!(self, Self::Certain | Self::Shared) || is_unverified && candidates.len() == 1;
        let mut known = candidates.iter().filter_map(|name| families.named(name));
        known.next().filter(|_| is_sure && known.next().is_none())
    }
}

/// Finds out what `unit` is. Only reads, each of one word.
///
/// # Errors
///
/// [`NotTold`], from where it is asked for its code. Later silence only makes it less sure what it is; but that the port
/// is lost is told in any case.
///
/// ```
/// use drivebus_drive::task::{Cause, LineError, Outcome, Seen, Step, Task, Wish};
/// use drivebus_drive::{Certainty, Families, identify};
/// use drivebus_rtu::{Instant, UnitAddress};
///
/// struct Silence;
///
/// impl LineError for Silence {
///     fn cause(&self) -> Cause {
///         Cause::NoAnswer
///     }
///
///     fn raw(&self) -> &[u8] {
///         &[]
///     }
///
///     fn was_sent(&self) -> bool {
///         true
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let unit = UnitAddress::new(1)?;
/// let mut task = Task::new(|line| async move { identify(&line, Families::shipped(), unit).await });
/// let seen = Seen { now: Instant::ZERO, connection: 0, is_closed: false };
/// let mut outcome = None;
/// let found = loop {
///     outcome = match task.step(seen, outcome)? {
///         // A GD350 that is stopped.
///         Step::Wish(Wish::Read(read)) => Some(match read.place.address {
///             0x2103 => Outcome::Words(vec![0x01A0]),
///             0x2100 => Outcome::Words(vec![3]),
///             _ => Outcome::Failed(Silence),
///         }),
///         Step::Wish(wish) => panic!("{wish}"),
///         Step::Done(found) => break found,
///     };
/// };
/// assert!(found.is_ok_and(|found| found.family() == Some("gd350") && found.certainty == Certainty::Certain));
/// # Ok(())
/// # }
/// ```
pub async fn identify<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    unit: UnitAddress,
) -> Result<Identification, NotTold<E>> {
    let mut told = Vec::new();
    for &place in families.codes().places() {
        let answer = answer_at(line, Read::word(unit, place)).await?;
        match answer.said {
            Said::Refused(code) if is_unreached(code) => return Err(NotTold::Unreached { unit, code }),
            Said::Refused(_) => {}
            Said::Word(word) => {
                let rows = families.codes().rows(place, word);
                if !rows.is_empty() {
                    return as_it_behaves(line, families, by_code(unit, place, word, rows)).await;
                }
            }
        }
        told.push(answer);
    }
    by_answers(line, families, unit, told).await
}

/// What `unit` is by the `rows` that are listed for its code, a `word` at `place`.
fn by_code(unit: UnitAddress, place: Place, word: u16, rows: &[Row]) -> Identification {
    let names =
        |first: fn(&Row) -> &String| each_once(rows.iter().flat_map(|row| [first(row)].into_iter().chain(&row.shared)));
    let candidates = names(|row| &row.family);
    let printed = rows.iter().find(|row| row.verified);
    let certainty = match printed {
        None => Certainty::Unverified,
        Some(_) if candidates.len() > 1 => Certainty::Shared,
        Some(_) => Certainty::Certain,
    };
    let source = printed.or(rows.first()).map(|row| row.source.clone()).unwrap_or_default();
    let reason = Reason::Code { place, alone: certainty, source, against: None };
    Identification { unit, candidates, code: Some(word), titles: names(|row| &row.title), certainty, reason }
}

/// `found`, as no more than likely if the unit is in no state of such a drive.
///
/// One word is no proof: another maker's drive may keep its speed where the code stands, and turn at just that.
async fn as_it_behaves<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    mut found: Identification,
) -> Result<Identification, NotTold<E>> {
    let Some(known) = found.candidates.iter().find_map(|name| families.named(name)) else {
        return Ok(found);
    };
    let state = known.profile().role("state").filter(|entry| entry.evidence() != Evidence::Assumed);
    let Some(place) = state.and_then(Entry::place) else {
        return Ok(found);
    };
    let answer = match answer_at(line, Read::word(found.unit, place)).await {
        Ok(answer) => answer,
        Err(error) if error.cause().is_no_answer() => return Ok(found),
        Err(error) => return Err(error),
    };
    let is_none = match answer.said {
        Said::Word(word) => !known.knows_state(word),
        Said::Refused(code) => known.lacks_address(code),
    };
    if is_none && let Reason::Code { against, .. } = &mut found.reason {
        *against = Some(answer);
        found.certainty = Certainty::Unverified;
    }
    Ok(found)
}

/// What `unit` is by what it answers and refuses; `told` is what it said where units have their codes.
async fn by_answers<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    unit: UnitAddress,
    told: Vec<Answer>,
) -> Result<Identification, NotTold<E>> {
    let code = told.last().and_then(|answer| answer.word());
    let mut asked: Asked = told.iter().map(|answer| (answer.place, answer.word().is_some())).collect();
    // Each question has its own place.
    let read = Read::word(unit, Place::from(0));
    let shown = shown_by(line, families, Protocol::Modbus, read, &mut asked).await.map_err(NotTold::Failed)?;
    if shown.is_empty() {
        let (candidates, titles) = (Vec::new(), Vec::new());
        return Ok(Identification {
            unit,
            candidates,
            code,
            titles,
            certainty: Certainty::Unknown,
            reason: Reason::Nothing(told),
        });
    }
    let telling: BTreeSet<_> = shown
        .iter()
        .filter_map(|family| family.profile().signature())
        .flat_map(wanted)
        .map(|(place, _)| place)
        .collect();
    let mut seen: Vec<_> = telling.into_iter().filter_map(|place| Some((place, asked.get(place)?))).collect();
    seen.sort_unstable_by_key(|&(place, _)| place.number());
    Ok(Identification {
        unit,
        candidates: shown.iter().map(|family| family.name().to_owned()).collect(),
        code,
        titles: each_once(shown.iter().map(|family| family.profile().title())),
        certainty: Certainty::ByAnswers,
        reason: Reason::Answers(seen),
    })
}

fn each_once<S: AsRef<str>>(names: impl Iterator<Item = S>) -> Vec<String> {
    let mut once: Vec<String> = Vec::new();
    for name in names {
        if !once.iter().any(|known| known == name.as_ref()) {
            once.push(name.as_ref().to_owned());
        }
    }
    once
}

#[cfg(test)]
mod tests;
