//! Signatures: how units of a family without a code are told, by which words they answer and which they refuse.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drives::{Place, Signature};
use drivebus_rtu::huanyang::Protocol;

use crate::asked::{NotTold, answer_at};
use crate::families::Families;
use crate::family::Family;
use crate::task::{LineError, Mailbox, Read};

/// Which words a unit answered, and which it refused.
#[derive(Debug, Default)]
pub(crate) struct Asked {
    known: BTreeMap<Place, bool>,
    /// Whether a question brought neither.
    is_wanting: bool,
}

impl Asked {
    /// Whether it answered at `place`; `None` where it was not asked, or neither came.
    pub(crate) fn get(&self, place: Place) -> Option<bool> {
        self.known.get(&place).copied()
    }

    /// Whether a question brought neither an answer nor a refusal that counts.
    pub(crate) fn is_wanting(&self) -> bool {
        self.is_wanting
    }
}

impl FromIterator<(Place, bool)> for Asked {
    fn from_iter<I: IntoIterator<Item = (Place, bool)>>(known: I) -> Self {
        Self { known: known.into_iter().collect(), is_wanting: false }
    }
}

/// Those of `families` that speak `protocol` and whose signature a unit shows, which is asked for more of it as in `read`.
///
/// What was asked before stands in `asked`, and what is asked goes there. Of a signature no more is asked once the unit
/// does not show it, so that a unit of none of them is asked little.
///
/// # Errors
///
/// That the port is lost, and what is no answer of the unit. Silence shows no signature.
pub(crate) async fn shown_by<'f, E: LineError>(
    line: &Mailbox<E>,
    families: &'f Families,
    protocol: Protocol,
    read: Read,
    asked: &mut Asked,
) -> Result<Vec<&'f Arc<Family>>, E> {
    let mut shown = Vec::new();
    for family in families.speaking(protocol) {
        if let Some(signature) = family.profile().signature()
            && is_shown(line, signature, read, asked).await?
        {
            shown.push(family);
        }
    }
    Ok(shown)
}

async fn is_shown<E: LineError>(
    line: &Mailbox<E>,
    signature: &Signature,
    read: Read,
    asked: &mut Asked,
) -> Result<bool, E> {
    for (place, wanted) in wanted(signature) {
        let is_answered = match asked.get(place) {
            Some(known) => known,
            None => match answer_at(line, Read { place, ..read }).await {
                Ok(answer) if !answer.passes() => *asked.known.entry(place).or_insert(answer.word().is_some()),
                Err(NotTold::Failed(error)) if !error.cause().is_no_answer() => return Err(error),
                // No signature has it.
                Ok(_) | Err(_) => {
                    asked.is_wanting = true;
                    return Ok(false);
                }
            },
        };
        if is_answered != wanted {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The places of `signature`, and whether its units answer there.
pub(crate) fn wanted(signature: &Signature) -> impl Iterator<Item = (Place, bool)> {
    let answers = signature.answers.iter().map(|&place| (place, true));
    answers.chain(signature.refuses.iter().map(|&place| (place, false)))
}
