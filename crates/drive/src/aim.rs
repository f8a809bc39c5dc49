//! As what a unit is halted: by the command of its name, or where it may be another drive by that of what it shows.
//!
//! The code that stops one family starts another. A unit that this line has identified is taken for what it is. Of any
//! other a few words are asked first, before everything that waits for the line, and none of them again: [`Apart`] says
//! which, and what they tell. A unit that says nothing at all is taken for what it was named as, since silence is no
//! evidence; what it is is then asked behind the halt.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use drivebus_drives::{Command, Place};
use drivebus_rtu::Instant;
use thiserror::Error;

use crate::apart::{Apart, Verdict};
use crate::asked::{NotTold, answer_at, answer_once};
use crate::families::Families;
use crate::family::Family;
use crate::harm::What;
use crate::huanyang::may_be_of;
use crate::same_unit::SameUnit;
use crate::set_otherwise::{Dialect, SetOtherwise, dialect};
use crate::task::{LineError, Mailbox, Read};

/// For so long a unit is given to answer what is asked before a halt, and the halt itself.
pub const ANSWER_WITHIN: Duration = Duration::from_millis(100);

/// Most questions about one unit: more than there are words by which the shipped families are told.
pub(crate) const QUESTIONS: usize = 120;

/// How often a unit that this line has identified is asked once more which words it takes.
const AGAIN: u32 = 2;

/// What is sent to halt a unit.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Target {
    /// The family that it is taken for.
    pub family: Arc<Family>,
    /// The command of that family.
    pub command: Command,
    /// What gives the words of that family another meaning; then it is the word of that which is sent.
    pub otherwise: Option<Box<SetOtherwise>>,
}

impl Target {
    fn of(family: &Arc<Family>, command: Command) -> Self {
        Self { family: Arc::clone(family), command, otherwise: None }
    }

    /// What is written, and where: first the word that comes before a command of some families.
    pub fn words(&self) -> impl Iterator<Item = (Place, u16)> {
        let profile = self.family.profile();
        let (first, own) = (profile.command_first(self.command), profile.command(self.command));
        let (first, word) = match &self.otherwise {
            None => (first, own),
            Some(otherwise) => (None, own.and_then(|(place, _)| Some((place, otherwise.halt(self.command)?)))),
        };
        first.into_iter().chain(word)
    }
}

/// Why a unit is not halted by what was meant, or nothing is written to it. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotTaken<E> {
    /// It did not say what it is, or was not asked.
    #[error("the unit does not say what it is ({0})")]
    NotTold(NotTold<E>),
    /// It may be any of these, which what was meant may start or change; where there are none, it fits no family.
    #[error("by what the unit answers it may be {}", titles(.0))]
    MayBe(Vec<Arc<Family>>),
    /// It is set to take other words, and what was meant is none of those that are known to halt then.
    #[error("the command words of the unit mean something else: {0}")]
    SetOtherwise(Box<SetOtherwise>),
}

fn titles(families: &[Arc<Family>]) -> String {
    let titles: Vec<_> = families.iter().map(|family| family.profile().title()).collect();
    if titles.is_empty() { "a drive of another family".to_owned() } else { titles.join(", ") }
}

/// The look at one unit that comes before a halt. What was answered is kept between two tries over one connection.
#[derive(Debug)]
pub struct Aim {
    same: SameUnit,
    look: Mutex<Look>,
}

#[derive(Debug)]
struct Look {
    apart: Apart,
    is_doubted: bool,
    /// Whether it answered anything over this connection that came whole: also that it is busy.
    has_spoken: bool,
    heard: Instant,
    /// How often the port had been opened again when it was asked last.
    connection: u64,
    /// A family other than the named one whose words it takes, as it said over this connection.
    own_words: Option<Arc<Family>>,
    /// How often it was silent when it was asked for that.
    lost: u32,
}

impl Aim {
    /// Nothing was asked yet of the unit, as it was named, which may be one of `families` as well.
    pub fn new(same: SameUnit, families: &Families, now: Instant) -> Self {
        let apart = Apart::new(same.family(), families, same.is_trusted());
        let connection = same.identity().connection();
        Self {
            same,
            look: Mutex::new(Look {
                apart,
                is_doubted: false,
                has_spoken: false,
                heard: now,
                connection,
                own_words: None,
                lost: 0,
            }),
        }
    }

    /// The line's clock when the unit last answered what it was asked, or may have; at first when this was made.
    pub fn heard(&self) -> Instant {
        self.with(|look| look.heard)
    }

    /// Puts in doubt what it was halted as: what it says now decides, and silence says nothing. Not so where it was.
    pub fn doubt(&self, families: &Families) -> bool {
        self.with(|look| {
            let is_new = !look.is_doubted;
            if is_new {
                (look.apart, look.is_doubted) = (self.apart(families, true), true);
            }
            is_new
        })
    }

    /// The unit, of which nothing was answered yet.
    fn apart(&self, families: &Families, is_doubted: bool) -> Apart {
        let apart = Apart::new(self.same.family(), families, self.same.is_trusted());
        if is_doubted { apart.doubting() } else { apart }
    }

    /// Forgets what was answered where the port was opened again since: behind it another drive may answer.
    fn keep_to(&self, connection: u64, families: &Families) {
        self.with(|look| {
            if look.connection != connection {
                (look.apart, look.connection) = (self.apart(families, look.is_doubted), connection);
                (look.has_spoken, look.own_words, look.lost) = (false, None, 0);
            }
        });
    }

    /// As what to halt the unit by `command`; `None` where it did not say yet.
    ///
    /// # Errors
    ///
    /// [`NotTaken::MayBe`] where it may be one of several families that want different words, or fits none. What whoever
    /// drives made of a question, but for a refusal and silence. Nothing but reads was wished for.
    pub async fn take<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        command: Command,
    ) -> Result<Option<Target>, NotTaken<E>> {
        match self.taken(line, families, command).await? {
            Some((target, true)) => self.in_its_words(line, families, target).await,
            silent => Ok(silent.map(|(target, _)| target)),
        }
    }

    /// The same, whatever words it takes, and whether it may be asked for those: not where it was silent just now.
    async fn taken<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        command: Command,
    ) -> Result<Option<(Target, bool)>, NotTaken<E>> {
        let (what, unit) = (What::Command(command), self.same.unit());
        let is_doubted = || self.with(|look| look.is_doubted);
        let named = |is_heard| Some((Target::of(self.same.family(), command), is_heard));
        if !is_doubted() && is_identified(&self.same, families, what, line.connection()) {
            return Ok(named(true));
        }
        for _ in 0..QUESTIONS {
            self.keep_to(line.connection(), families);
            let place = match self.with(|look| look.apart.verdict(what)) {
                Verdict::Ask(place) => place,
                Verdict::Take(family) => return self.target(line, family, command).map(|target| Some((target, true))),
                Verdict::Undecided(others) => return Err(NotTaken::MayBe(others)),
            };
            let read = Read::word(unit, place).urgent(true).once_within(ANSWER_WITHIN);
            let answer = match answer_once(line, read).await {
                Ok(answer) => answer,
                Err(error) if !error.cause().is_no_answer() => {
                    return Err(NotTaken::NotTold(NotTold::Failed(error)));
                }
                Err(error) if may_be_of(unit, error.raw()) => {
                    self.with(|look| look.heard = line.now());
                    return Ok(None);
                }
                // Silence is no evidence. Where it spoke before, or against its name, the line lost this one.
                Err(_) if is_doubted() || self.has_spoken() => return Ok(None),
                Err(_) => return Ok(named(false)),
            };
            self.keep_to(line.connection(), families);
            let is_telling = self.with(|look| {
                (look.has_spoken, look.heard) = (true, line.now());
                look.apart.heard(answer)
            });
            if !is_telling {
                return Ok(None);
            }
        }
        Err(NotTaken::MayBe(Vec::new()))
    }

    /// The `target`, in the words that the unit is set to take; `None` where it did not say yet.
    async fn in_its_words<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        target: Target,
    ) -> Result<Option<Target>, NotTaken<E>> {
        let (unit, family) = (self.same.unit(), &target.family);
        let is_named = Arc::ptr_eq(family, self.same.family());
        self.keep_to(line.connection(), families);
        let opened = line.connection();
        let is_known = if is_named {
            self.same.identity().takes_own_words(opened)
        } else {
            self.with(|look| look.own_words.as_ref().is_some_and(|known| Arc::ptr_eq(known, family)))
        };
        if is_known || !family.has_dialects() {
            return Ok(Some(target));
        }
        let asked = dialect(line, unit, family, |read| read.urgent(true).once_within(ANSWER_WITHIN)).await;
        let heard = || self.with(|look| (look.has_spoken, look.heard) = (true, line.now()));
        match asked {
            // What was asked before the port was opened again may be another drive.
            Ok(_) if line.connection() != opened => Ok(None),
            Ok(Dialect::Own) => {
                heard();
                if is_named {
                    self.same.identity().found_own_words(opened);
                } else {
                    self.with(|look| look.own_words = Some(Arc::clone(family)));
                }
                Ok(Some(target))
            }
            Ok(Dialect::Other(otherwise)) => {
                heard();
                match otherwise.halt(target.command) {
                    Some(_) => Ok(Some(Target { otherwise: Some(otherwise), ..target })),
                    None => Err(NotTaken::SetOtherwise(otherwise)),
                }
            }
            Ok(Dialect::Untold) => {
                heard();
                Ok(None)
            }
            Err(error) if !error.cause().is_no_answer() => Err(NotTaken::NotTold(NotTold::Failed(error))),
            // Silence is no evidence. Where it spoke before, the line lost this one.
            Err(_) if self.has_spoken() => Ok(None),
            Err(_) if self.same.identity().is_known(opened) && self.with(|look| look.lost) < AGAIN => {
                self.with(|look| look.lost += 1);
                Ok(None)
            }
            Err(_) => Ok(Some(target)),
        }
    }

    /// Whether it spoke yet, or spoke against its name when it was asked last.
    fn has_spoken(&self) -> bool {
        self.same.identity().contradicts() || self.with(|look| look.has_spoken)
    }

    /// The unit as one of `family`.
    fn target<E>(&self, line: &Mailbox<E>, family: Arc<Family>, command: Command) -> Result<Target, NotTaken<E>> {
        if Arc::ptr_eq(&family, self.same.family()) {
            if self.with(|look| look.apart.shows_named()) {
                self.same.identity().settle(line.connection(), line.now());
            }
            return Ok(Target::of(&family, command));
        }
        match family.halt_for(command) {
            // That its own papers are thin is no reason to let it run: nothing else halts what shows this family.
            Some(command) => Ok(Target::of(&family, command)),
            None => Err(NotTaken::MayBe(vec![family])),
        }
    }

    fn with<T>(&self, f: impl FnOnce(&mut Look) -> T) -> T {
        f(&mut self.look.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Whether nothing is asked before `what` is sent: the line has identified the unit over this connection, or it harms no
/// family; and where its drive may take other words, it said that it takes those of its profile.
pub fn goes_out_at_once(same: &SameUnit, families: &Families, what: What, connection: u64) -> bool {
    !is_in_doubt(same, what, connection) && is_identified(same, families, what, connection)
}

/// Whether `what` may mean something else to the unit, which did not say yet which words it takes.
fn is_in_doubt(same: &SameUnit, what: What, connection: u64) -> bool {
    let family = same.family();
    let is_command = match what {
        What::Command(_) => true,
        What::Word(place) => !same.is_trusted() && family.commands_at(place),
    };
    is_command && family.has_dialects() && !same.identity().takes_own_words(connection)
}

/// Whether what the unit is is asked of nobody before `what` is sent.
///
/// Where a name is said to be meant, only what the unit itself shows counts for a command. What speaks against a name is
/// known of `families` alone: a unit of somebody's own one has to show it.
fn is_identified(same: &SameUnit, families: &Families, what: What, connection: u64) -> bool {
    let (identity, is_trusted) = (same.identity(), same.is_trusted());
    if identity.is_sure(connection) {
        return true;
    }
    if let What::Word(place) = what
        && (is_trusted || identity.is_harmless(place, connection))
    {
        return true;
    }
    let is_listed = || families.named(same.family().profile().family()).is_some();
    let is_known = identity.is_known(connection) && !is_trusted && is_listed();
    is_known || families.harmed(what, same.family()).is_empty()
}

/// Makes sure that `what` is not sent to a unit of a family that it would do harm to: a command that does not halt, or any
/// word. Only reads, and only where the line has not identified the unit.
///
/// # Errors
///
/// [`NotTaken`]: what was to follow must not be sent.
pub async fn check_harmless<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    same: &SameUnit,
    what: What,
) -> Result<(), NotTaken<E>> {
    if !is_identified(same, families, what, line.connection()) {
        check_family(line, families, same, what).await?;
    }
    let opened = line.connection();
    if !is_in_doubt(same, what, opened) {
        return Ok(());
    }
    for (place, row) in same.family().deciding() {
        let answer = answer_at(line, Read::word(same.unit(), place)).await.map_err(NotTaken::NotTold)?;
        match same.family().dialect_by(row, answer) {
            Some(Dialect::Other(otherwise)) => return Err(NotTaken::SetOtherwise(otherwise)),
            Some(Dialect::Untold) => return Err(NotTaken::MayBe(Vec::new())),
            Some(Dialect::Own) | None => {}
        }
    }
    same.identity().found_own_words(opened);
    Ok(())
}

/// The same, of what the unit is.
async fn check_family<E: LineError>(
    line: &Mailbox<E>,
    families: &Families,
    same: &SameUnit,
    what: What,
) -> Result<(), NotTaken<E>> {
    let named = same.family();
    let mut apart = Apart::new(named, families, same.is_trusted());
    for _ in 0..QUESTIONS {
        let place = match apart.verdict(what) {
            Verdict::Ask(place) => place,
            Verdict::Undecided(others) => return Err(NotTaken::MayBe(others)),
            Verdict::Take(family) if !Arc::ptr_eq(&family, named) && family.is_harmed_by(what, named) => {
                return Err(NotTaken::MayBe(vec![family]));
            }
            Verdict::Take(_) => {
                if let What::Word(place) = what {
                    // Whoever would take harm from some word there, would from none that halts.
                    if apart.shows_named() && named.profile().is_command(place) {
                        same.identity().settle(line.connection(), line.now());
                    }
                    same.identity().found_harmless(place, line.connection());
                }
                return Ok(());
            }
        };
        let answer = answer_at(line, Read::word(same.unit(), place)).await.map_err(NotTaken::NotTold)?;
        if !apart.heard(answer) {
            break;
        }
    }
    Err(NotTaken::MayBe(Vec::new()))
}

#[cfg(test)]
mod tests;
