//! Whether the unit at an address is what it was named as, and still the one it was.
//!
//! People name a family, and mistake one drive for another. So what the unit says of itself is asked before anything goes
//! out that moves a motor or changes a value, and where it speaks against the family, nothing goes out.
//!
//! A port that was lost and opened again may be another one: an adapter plugged in elsewhere, a cable moved to another
//! machine, where the same address is another drive. So it is asked again then. A stop waits for it only
//! where its word may start a drive of another family.
//!
//! Families that have an identification code are known by it, and others by which words they answer and which they
//! refuse: also by what they say where other families have such a code, for that is how one of those gives itself away.

mod identity;
mod not_same;
mod told;

use std::sync::Arc;

use drivebus_drives::{Entry, Evidence, Place};
use drivebus_rtu::{Instant, Meaning, UnitAddress};

pub use identity::Identity;
pub use not_same::NotSame;
pub use told::Told;

use crate::answer::Answer;
use crate::asked::answer_once;
use crate::contradiction::Contradiction;
use crate::families::Families;
use crate::family::Family;
use crate::signatures::{Asked, shown_by, wanted};
use crate::task::{LineError, Mailbox, Read};

/// A unit that was named as one of a family, and what it said of itself.
#[derive(Debug, Clone)]
pub struct SameUnit {
    unit: UnitAddress,
    family: Arc<Family>,
    identity: Identity,
    is_trusted: bool,
}

/// What a unit says against its family.
#[derive(Debug)]
pub(crate) struct Against {
    pub(crate) found: Option<Contradiction>,
    /// Whether each question brought something that counts: no silence, and not that it is busy.
    pub(crate) is_whole: bool,
}

impl SameUnit {
    /// The `unit` that was named as one of `family`, in whose words its `identity` was asked; other handles of it have the
    /// same one.
    ///
    /// Where `is_trusted`, that name is meant, whatever the unit says.
    pub fn new(unit: UnitAddress, family: &Arc<Family>, identity: &Identity, is_trusted: bool) -> Self {
        Self { unit, family: Arc::clone(family), identity: identity.clone(), is_trusted }
    }

    /// Its address.
    pub fn unit(&self) -> UnitAddress {
        self.unit
    }

    /// What it was named as.
    pub fn family(&self) -> &Arc<Family> {
        &self.family
    }

    /// What it said of itself.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Whether its name is meant, whatever it says.
    pub fn is_trusted(&self) -> bool {
        self.is_trusted
    }

    /// Takes it that the unit gave the identification code `code`, any of 0..=0xFFFF, when it was asked what it is.
    pub fn gave(&self, code: u16, now: Instant) {
        let answers: Vec<_> = self.family.code_place().map(|place| Answer::word_at(place, code)).into_iter().collect();
        let is_sure = self.is_told(&answers);
        self.identity.with(|known| {
            known.told = Some(Told::of_code(code));
            (known.spoke, known.contradicts, known.is_sure) = (true, false, is_sure);
            known.heard = Some(now);
        });
    }

    /// Asks the unit what it is, if the port was opened again or nobody has asked yet.
    ///
    /// A unit that refuses to tell is known by that. One that stays silent is not known, and is asked the next time; so
    /// is one that refuses for the moment only, as where a password locks it or a gateway does not reach it. Whether it
    /// contradicts its family is looked at only where it is to be judged, as `is_judged` says, or where it behaves as a
    /// unit of another one of `families`; where it does, it is asked each time. The reads are urgent where `is_urgent`.
    ///
    /// The result is the connection for which that holds: what is sent on it goes to the unit that was asked.
    ///
    /// # Errors
    ///
    /// [`NotSame`]: what was to follow must not be sent.
    pub async fn check<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        is_judged: bool,
        is_urgent: bool,
    ) -> Result<u64, NotSame<E>> {
        let opened = line.connection();
        // What spoke against the family may have been put right meanwhile.
        let (before, connection) = self.identity.with(|known| {
            let holds = !(is_judged && known.contradicts);
            (known.told.clone().filter(|_| holds), known.connection)
        });
        if before.is_some() && opened == connection {
            return Ok(opened);
        }
        let mut answers = Vec::new();
        let failure = match self.ask(line, &mut answers, is_urgent).await {
            Ok(()) => None,
            Err(error) if error.cause().is_of_the_line() => Some(error),
            Err(error) => return Err(NotSame::Failed(error)),
        };
        if let Some(before) = before {
            self.compare(&answers, failure, before)?;
        } else {
            let (mut against, mut is_judged) = (None, is_judged);
            if !self.is_trusted {
                against = self.family.contradiction(&answers);
                if against.is_none() && failure.is_none() {
                    let other = self.other(line, families, &answers, is_urgent).await;
                    against = other.map_err(NotSame::Failed)?.found;
                    // By the words of another maker even a reset may start the motor.
                    is_judged |= against.is_some();
                }
            }
            self.judge(&answers, failure.is_none(), against.is_some());
            if let Some(against) = against.filter(|_| is_judged) {
                return Err(NotSame::Contradicts(against));
            }
        }
        let (is_sure, now) = (self.is_told(&answers), line.now());
        self.identity.with(|known| {
            known.heard = Some(now);
            if opened != known.connection {
                (known.connection, known.is_sure) = (opened, is_sure);
                known.harmless.clear();
            }
        });
        Ok(opened)
    }

    /// What the unit says against its family; `None` if nothing. Asks it in any case, urgently where `is_urgent`.
    ///
    /// # Errors
    ///
    /// What whoever drives made of a read, but for a refusal.
    pub async fn contradiction<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        is_urgent: bool,
    ) -> Result<Option<Contradiction>, E> {
        Ok(self.against(line, families, is_urgent).await?.found)
    }

    /// The same, and whether nothing is left open.
    pub(crate) async fn against<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        is_urgent: bool,
    ) -> Result<Against, E> {
        let (mut answers, mut against);
        loop {
            let opened = line.connection();
            answers = Vec::new();
            self.ask(line, &mut answers, is_urgent).await?;
            let now = line.now();
            self.identity.with(|known| known.heard = Some(now));
            against = match self.family.contradiction(&answers) {
                None => self.other(line, families, &answers, is_urgent).await?,
                found => Against { found, is_whole: true },
            };
            // Two drives may have answered where the port was opened again in between.
            if line.connection() == opened {
                break;
            }
        }
        if against.found.is_some() {
            self.identity.is_another();
        } else if self.identity.with(|known| known.told.is_none()) {
            let connection = line.connection();
            self.identity.with(|known| known.connection = connection);
            self.judge(&answers, true, false);
        }
        Ok(against)
    }

    /// Takes what a unit said that was not known. What came before a failure of the line was said all the same, but is
    /// not whole: the unit stays unknown.
    fn judge(&self, answers: &[Answer], is_whole: bool, contradicts: bool) {
        let told = (is_whole && !self.is_put_off(answers)).then(|| self.told(answers));
        // Of some families no document prints a word that they answer, so that a refusal is all there is.
        let spoke = answers.iter().any(|answer| answer.word().is_some()) || !self.may_be_shown();
        let is_sure = !contradicts && told.is_some() && self.is_told(answers);
        self.identity.with(|known| {
            (known.told, known.spoke, known.contradicts, known.is_sure) = (told, spoke, contradicts, is_sure);
        });
    }

    /// Whether the unit still says what it said `before`.
    fn compare<E>(&self, answers: &[Answer], failure: Option<E>, before: Told) -> Result<(), NotSame<E>> {
        if let Some(failure) = failure {
            return Err(NotSame::Unsaid(failure));
        }
        let now = self.told(answers);
        if self.is_put_off(answers) {
            return Err(NotSame::PutOff(now));
        }
        if now == before { Ok(()) } else { Err(NotSame::Another { before, now }) }
    }

    /// What speaks against the family where `answers` are strange: the signature of other ones.
    async fn other<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        answers: &[Answer],
        is_urgent: bool,
    ) -> Result<Against, E> {
        if answers.iter().any(|answer| answer.passes()) || !self.family.is_suspicious(answers) {
            return Ok(Against { found: None, is_whole: !answers.iter().any(|&answer| self.is_busy(answer)) });
        }
        let told = answers.iter().filter(|answer| !self.family.is_put_off_by(**answer));
        let mut asked: Asked = told.map(|answer| (answer.place, answer.word().is_some())).collect();
        // Each question has its own place.
        let read = Read::word(self.unit, Place::from(0)).urgent(is_urgent);
        let shown = shown_by(line, families, self.family.protocol(), read, &mut asked).await?;
        Ok(Against { found: self.family.other_signature(shown), is_whole: !asked.is_wanting() })
    }

    /// Adds the unit's answers to `answers` as they come, so that a failure of the line leaves the earlier ones.
    async fn ask<E: LineError>(&self, line: &Mailbox<E>, answers: &mut Vec<Answer>, is_urgent: bool) -> Result<(), E> {
        for place in self.questions() {
            let answer = answer_once(line, Read::word(self.unit, place).urgent(is_urgent)).await?;
            answers.push(answer);
        }
        Ok(())
    }

    /// Where the unit says what it is, or else where counts whether it answers; there may be no such place.
    fn questions(&self) -> Vec<Place> {
        let family = &self.family;
        if let Some(place) = family.code_place() {
            return vec![place];
        }
        if let Some(signature) = family.signature() {
            return wanted(signature).map(|(place, _)| place).collect();
        }
        // Whether it has the words that are always asked of its family is better than nothing. What it has itself where
        // others have a code is no code.
        let others = family.codes().places().iter().copied().filter(|&place| !family.has(place));
        let known = ["state", "fault"].into_iter().filter_map(|role| family.profile().role(role));
        let asked = known.filter(|entry| entry.evidence() != Evidence::Assumed).filter_map(Entry::place);
        others.chain(asked).collect()
    }

    /// Whether `answers` have the code of the family itself, or its whole signature.
    fn is_told(&self, answers: &[Answer]) -> bool {
        let mut codes = answers.iter().filter(|answer| self.family.code_place() == Some(answer.place)).peekable();
        if codes.peek().is_none() {
            return self.family.is_signed_by(answers);
        }
        codes.all(|answer| answer.word().is_some_and(|word| self.family.is_own(answer.place, word)))
    }

    /// Whether one of `answers` is a refusal that passes, so that it is not known yet what the unit is.
    fn is_put_off(&self, answers: &[Answer]) -> bool {
        answers.iter().any(|&answer| self.family.is_put_off_by(answer))
    }

    /// Whether `answer` says that it is busy.
    fn is_busy(&self, answer: Answer) -> bool {
        answer.exception().is_some_and(|code| self.family.meaning_of(code) == Meaning::AskAgain)
    }

    /// Whether there is a word by which a unit of the family shows what it is.
    fn may_be_shown(&self) -> bool {
        let family = &self.family;
        family.is_listed() || family.signature().is_some() || family.profile().role("state").is_some()
    }

    fn told(&self, answers: &[Answer]) -> Told {
        Told::of(answers, |place, word| {
            // Elsewhere any word may change, but for a code that gives another drive away.
            self.family.code_place() == Some(place) || !self.family.codes().rows(place, word).is_empty()
        })
    }
}

#[cfg(test)]
mod tests;
