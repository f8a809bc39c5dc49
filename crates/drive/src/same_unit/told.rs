//! What a unit told, as it is compared with what it tells later.

use std::fmt;

use drivebus_drives::Place;
use drivebus_rtu::ExceptionCode;

use crate::answer::{Answer, Said};

/// What a unit told of itself: of a word that may change only that it was answered, and not with what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Told(Vec<(Option<Place>, Shown)>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shown {
    Code(u16),
    Answered,
    Refused(ExceptionCode),
}

impl Told {
    /// The code alone, wherever it was asked for.
    pub(super) fn of_code(code: u16) -> Self {
        Self(vec![(None, Shown::Code(code))])
    }

    /// What `answers` tell, of which `is_code` knows whether a word at a place does not change.
    pub(super) fn of(answers: &[Answer], is_code: impl Fn(Place, u16) -> bool) -> Self {
        let mut told: Vec<(Option<Place>, Shown)> = Vec::new();
        for &Answer { place, said } in answers {
            let shown = match said {
                Said::Refused(code) => Shown::Refused(code),
                Said::Word(word) if is_code(place, word) => Shown::Code(word),
                Said::Word(_) => Shown::Answered,
            };
            // Of two answers to one question the later one counts.
            match told.iter_mut().find(|(known, _)| *known == Some(place)) {
                Some(known) => known.1 = shown,
                None => told.push((Some(place), shown)),
            }
        }
        // One answer alone says the same wherever it was asked for.
        if let [only] = told.as_mut_slice() {
            only.0 = None;
        }
        Self(told)
    }
}

impl fmt::Display for Told {
    /// `01A0H`, or `2103H refused with exception 02H, 2100H answered`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (nth, (place, shown)) in self.0.iter().enumerate() {
            f.write_str(if nth == 0 { "" } else { ", " })?;
            if let Some(place) = place {
                write!(f, "{place} ")?;
            }
            match shown {
                Shown::Code(word) => write!(f, "{word:04X}H")?,
                Shown::Answered => f.write_str("answered")?,
                Shown::Refused(code) => write!(f, "refused with exception {:02X}H", code.0)?,
            }
        }
        Ok(())
    }
}
