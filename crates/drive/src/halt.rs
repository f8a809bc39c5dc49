//! A halt on its way: sent until the unit takes it, one frame after another, for as long as was said; and then proved.
//!
//! A halt that was lost, refused because a frame arrived damaged, or put off by a drive that is busy, halts nothing. So it
//! is sent again: every halt is an absolute word, and a motor that was told twice to stop stops once. What ends it is a
//! confirmation, or the time. Nothing else that moves a motor is ever repeated.
//!
//! What proves it is what the drive shows afterwards: standstill, or a [`Fall`](crate::Fall) along its ramp. Where the family
//! has no state that may be used, the confirmation is all there is.

mod not_halted;
mod proof;
mod several;
mod vouching;

use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::Command;
use drivebus_rtu::{Instant, Meaning};

pub use not_halted::{After, LastLook, NotHalted, Tries, Why};
pub use several::halt_all;

use crate::aim::{ANSWER_WITHIN, Aim, NotTaken, Target};
use crate::asked::NotTold;
use crate::families::Families;
use crate::huanyang::may_be_of;
use crate::record::Record;
use crate::set_otherwise::SetOtherwise;
use crate::taken::Taken;
use crate::task::{Cause, LineError, Mailbox, Notice, Payload, Read, Write};
use crate::unlock::{key_after, unlock};
use proof::Proof;
use vouching::Anew;

/// Time between a frame that came to nothing at once, and the next.
const PAUSE: Duration = Duration::from_millis(40);

/// Time in which a unit says what it is, on a line that was just opened and loses an answer. One question alone takes a
/// second there.
const TO_SAY: Duration = Duration::from_secs(2);

/// How a unit is to be halted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Order {
    /// What is sent first.
    pub command: Command,
    /// What is sent besides, where that was not taken.
    pub besides: Besides,
    /// How long it is sent until the unit takes it, an hour at most. A unit that answers, but has not said yet what it is, is
    /// asked for two seconds in any case.
    pub within: Duration,
    /// How long its state is looked at for the proof; zero does not look. A frequency that falls is looked at longer.
    pub confirm: Duration,
}

impl Order {
    /// How long a halt is sent where nothing else is said.
    pub const WITHIN: Duration = Duration::from_secs(10);

    fn nth(&self, frame: usize) -> Command {
        match self.besides {
            Besides::Coast if frame % 4 == 3 => Command::Coast,
            Besides::InTurns(other) if frame % 2 == 1 => other,
            _ => self.command,
        }
    }
}

/// What is sent besides a command that was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Besides {
    /// Nothing.
    Nothing,
    /// A coast, each fourth frame.
    Coast,
    /// This, each second frame.
    InTurns(Command),
}

/// What follows from a look at a unit that took a halt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Judged {
    /// It is looked at again.
    Open,
    /// It is halted.
    Proved,
    /// It only acknowledged the halt, and is told again.
    Untaken,
    /// It was halted as another family meanwhile, and that is to be proved.
    Anew,
}

/// Whether a unit has to be unlocked before it takes a halt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Lock {
    /// Nothing speaks for that.
    #[default]
    Open,
    /// It may be so: a frame came to nothing, and its family locks itself.
    Perhaps,
}

/// One unit that is to be halted.
#[derive(Debug)]
pub struct Halt<E> {
    named: Taken,
    /// The same, as the family that it is taken for.
    unit: Taken,
    record: Record,
    order: Order,
    aim: Aim,
    /// What was sent last.
    command: Command,
    /// What gives its words another meaning: it is halted by a word of that.
    otherwise: Option<Box<SetOtherwise>>,
    lock: Lock,
    told: Vec<Command>,
    began: Instant,
    until: Instant,
    /// The moment before the frame that was taken.
    sent: Instant,
    /// How often the port had been opened again when it went out.
    connection: u64,
    /// When it was.
    confirmed: Instant,
    is_taken: bool,
    /// Whether it confirmed that; a unit may also say that it is still at it, and show nothing.
    is_confirmed: bool,
    /// Whether any frame went out that was not refused.
    was_sent: bool,
    heard: Option<Instant>,
    failure: Option<E>,
    /// When the last look ended.
    looked: Instant,
    proof: Option<Proof>,
}

impl<E: LineError> Halt<E> {
    /// A halt of `unit` as `order` says. Nothing is sent yet.
    pub fn new(unit: Taken, record: &Record, order: Order, families: &Families, now: Instant) -> Self {
        Self {
            connection: unit.same().identity().connection(),
            aim: Aim::new(unit.same().clone(), families, now),
            named: unit.clone(),
            unit,
            record: record.clone(),
            command: order.command,
            otherwise: None,
            lock: Lock::Open,
            told: Vec::new(),
            began: now,
            until: now + order.within,
            order,
            sent: now,
            confirmed: now,
            is_taken: false,
            is_confirmed: false,
            was_sent: false,
            heard: None,
            failure: None,
            looked: now,
            proof: None,
        }
    }

    /// Halts the unit, and proves it.
    ///
    /// # Errors
    ///
    /// [`NotHalted`]: the motor may still turn. Its `was_sent` says whether the drive may have taken a halt.
    pub async fn carry_out(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), NotHalted<E>> {
        match self.until_proved(line, families).await {
            Ok(()) => Ok(()),
            Err(why) => Err(self.not_halted(line, why)),
        }
    }

    /// As what the unit is taken: what it was named as, until it shows that it is another one.
    pub fn taken_as(&self) -> &Taken {
        &self.unit
    }

    async fn until_proved(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), Why<E>> {
        self.check_order()?;
        self.until_taken(line, families).await?;
        loop {
            let mut proof = self.prove(line, families).await?;
            let next = loop {
                let looked = proof.look(line, &self.unit, &self.record).await;
                match self.judged(line, families, looked).await? {
                    Judged::Open => line.sleep(proof.pause(line.now())).await.map_err(Why::Failed)?,
                    judged => break judged,
                }
            };
            match next {
                Judged::Proved => return Ok(()),
                Judged::Untaken => self.until_taken(line, families).await?,
                Judged::Open | Judged::Anew => {}
            }
        }
    }

    /// What follows from a look that is over.
    async fn judged(
        &mut self,
        line: &Mailbox<E>,
        families: &Families,
        looked: Result<bool, Why<E>>,
    ) -> Result<Judged, Why<E>> {
        self.looked = line.now();
        match looked {
            Ok(false) => Ok(Judged::Open),
            Ok(true) if self.order.confirm.is_zero() || !self.was_another(line, families).await? => Ok(Judged::Proved),
            Err(why) if !why.is_unproved() => Err(why),
            // What was only acknowledged may not have been carried out.
            Err(_) if !self.is_confirmed && !self.is_over(line) => Ok(Judged::Untaken),
            Err(why) if self.vouch_anew(line, families).await? != Anew::Another => Err(why),
            Ok(true) | Err(_) => Ok(Judged::Anew),
        }
    }

    /// Whether its time has passed. A unit that speaks, and did not say yet what it is, is given the time to.
    fn is_over(&self, line: &Mailbox<E>) -> bool {
        let is_asked = self.heard.is_some() && self.told.is_empty() && !line.is_closed();
        let until = if is_asked { self.until.max(self.began + TO_SAY) } else { self.until };
        line.now() >= until
    }

    /// Whether the `unit` may be given `command`.
    fn check(unit: &Taken, command: Command) -> Result<(), Why<E>> {
        unit.rule().command(command).map_err(|why| Why::MayNot(why.to_string()))
    }

    fn check_order(&self) -> Result<(), Why<E>> {
        Self::check(&self.named, self.order.command)
    }

    async fn until_taken(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), Why<E>> {
        while !self.step(line, families).await? {
            if self.is_over(line) {
                return Err(self.failure(line).await);
            }
            line.sleep(PAUSE).await.map_err(Why::Failed)?;
        }
        Ok(())
    }

    /// Sends once. Whether the unit took it.
    async fn step(&mut self, line: &Mailbox<E>, families: &Families) -> Result<bool, Why<E>> {
        let wanted = self.order.nth(self.told.len());
        let came = match self.aim.take(line, families, wanted).await {
            Ok(Some(target)) => {
                self.take_for(line, &target);
                Self::check(&self.unit, self.command)?;
                self.send(line, &target).await
            }
            Ok(None) | Err(NotTaken::NotTold(NotTold::Unreached { .. })) => {
                self.heard = Some(line.now());
                return Ok(false);
            }
            Err(NotTaken::MayBe(families)) => return Err(Why::Undecided { wanted, families }),
            Err(NotTaken::SetOtherwise(otherwise)) => return Err(Why::SetOtherwise { wanted, otherwise }),
            Err(NotTaken::NotTold(NotTold::Failed(error) | NotTold::Busy { last: error, .. })) => Err(error),
        };
        match came {
            Ok(()) => self.is_taken = true,
            Err(error) => self.failed(line, families, error)?,
        }
        Ok(self.is_taken)
    }

    /// From now on it is the `target`, whose command was chosen.
    fn take_for(&mut self, line: &Mailbox<E>, target: &Target) {
        self.unit = self.named.taken_for(&target.family, &self.record, line.connection());
        self.command = target.command;
        self.otherwise.clone_from(&target.otherwise);
    }

    /// A frame came to nothing.
    fn failed(&mut self, line: &Mailbox<E>, families: &Families, error: E) -> Result<(), Why<E>> {
        match error.cause() {
            Cause::Refused(..) => {
                self.heard = Some(line.now());
                self.failure = Some(error);
                self.doubt_named(line, families);
                return Ok(());
            }
            Cause::Other | Cause::Halted => return Err(Why::Failed(error)),
            Cause::BadAnswer if may_be_of(self.unit.same().unit(), error.raw()) => self.heard = Some(line.now()),
            Cause::Port if line.is_closed() => self.until = line.now(),
            Cause::NoAnswer | Cause::BadAnswer | Cause::Port => {}
        }
        // That one went out tells more than that a later one could not.
        if error.was_sent() || self.failure.as_ref().is_none_or(|known| !known.was_sent()) {
            self.failure = Some(error);
        }
        Ok(())
    }

    /// A halt was refused. A unit that did not say yet what it is may refuse it because it is of another family.
    fn doubt_named(&self, line: &Mailbox<E>, families: &Families) {
        if self.is_as_named() && !self.unit.same().identity().is_known(line.connection()) {
            self.aim.doubt(families);
        }
    }

    fn is_as_named(&self) -> bool {
        Arc::ptr_eq(self.unit.same().family(), self.named.same().family())
    }

    async fn send(&mut self, line: &Mailbox<E>, target: &Target) -> Result<(), E> {
        let (address, family) = (self.unit.same().unit(), Arc::clone(self.unit.same().family()));
        let line = &line.taken_for(address, &family);
        self.record.note(|sent| sent.halts_begun += 1);
        self.told.push(self.command);
        (self.sent, self.connection) = (line.now(), line.connection());
        self.is_confirmed = true;
        let profile = family.profile();
        for (place, word) in target.words() {
            let payload = Payload::Word(word).as_written(profile);
            let write = Write {
                is_urgent: true,
                // The line knows the unit by its name, and would hold back the words of another family, or of another setting.
                is_forced: !self.is_as_named() || target.otherwise.is_some(),
                timeout: Some(ANSWER_WITHIN),
                // Behind a port that was opened again another drive may be, which has to say what it is.
                connection: Some(self.connection),
                ..Write::new(address, place, payload)
            };
            let came = self.put(line, write).await;
            let Err(error) = came else {
                self.was_sent = true;
                continue;
            };
            self.was_sent |= error.was_sent() && !error.cause().is_refusal();
            match error.cause() {
                // Who says that it took it got it, whatever else is known of the request.
                Cause::Refused(code, _) if family.meaning_of(code) == Meaning::Taken => {
                    (self.was_sent, self.is_confirmed) = (true, false);
                }
                _ => {
                    self.record.note(|sent| sent.halts += u64::from(error.was_sent()));
                    return Err(error);
                }
            }
        }
        self.record.note(|sent| sent.halts += 1);
        self.confirmed = line.now();
        line.tell(Notice::Took(self.command)).await;
        if let (Some(otherwise), Some((_, word))) = (&target.otherwise, target.words().last()) {
            line.tell(Notice::TookOther { command: self.command, word, otherwise: otherwise.clone() }).await;
        }
        Ok(())
    }

    /// Writes, and once more where the unit refuses it as one that is locked, and lets itself be unlocked.
    async fn put(&mut self, line: &Mailbox<E>, write: Write) -> Result<(), E> {
        if std::mem::take(&mut self.lock) == Lock::Perhaps {
            // Whatever comes of it, the halt goes out.
            self.unlock(line, &write).await?;
        }
        let Err(error) = line.write(write.clone()).await else { return Ok(()) };
        let profile = self.unit.same().family().profile();
        self.lock = if profile.unlock().is_some() { Lock::Perhaps } else { Lock::Open };
        let is_locked = key_after(profile, error.cause()).is_some();
        if is_locked && self.unlock(line, &write).await? { line.write(write).await } else { Err(error) }
    }

    /// Unlocks the unit that is to take `write`, if its family wants that. Whether it was.
    async fn unlock(&self, line: &Mailbox<E>, write: &Write) -> Result<bool, E> {
        let profile = self.unit.same().family().profile();
        let Some(key) = profile.unlock() else { return Ok(false) };
        let how = |read: Read| read.urgent(true).once_within(ANSWER_WITHIN);
        match unlock(line, key, profile, write, how).await {
            Err(error) if matches!(error.cause(), Cause::Other | Cause::Halted) => Err(error),
            came => Ok(came.unwrap_or(false)),
        }
    }

    /// Why nothing was taken.
    async fn failure(&mut self, line: &Mailbox<E>) -> Why<E> {
        let now = line.now();
        let since = |moment| now.saturating_duration_since(moment);
        let Some(last) = self.failure.take() else { return Why::Unsaid };
        let is_refused = matches!(last.cause(), Cause::Refused(..));
        if !is_refused && !last.was_sent() {
            return Why::NotSent(last);
        }
        let tries = Tries { told: self.told.clone(), took: since(self.began), heard: self.heard.map(since) };
        let after = match self.unit.look(line, true).await {
            Ok(look) => After::Seen(look),
            Err(error) if matches!(error.cause(), Cause::Other | Cause::Halted) => return Why::Failed(error),
            Err(error) => After::Unread(error),
        };
        if is_refused { Why::Refused { last, tries, after } } else { Why::Unanswered { last, tries, after } }
    }

    fn not_halted(&self, line: &Mailbox<E>, why: Why<E>) -> NotHalted<E> {
        let same = self.unit.same();
        let family = Arc::clone(same.family());
        let found = if why.is_unproved() { self.looked } else { line.now() };
        NotHalted { unit: same.unit(), family, command: self.command, was_sent: self.was_sent, found, why }
    }
}

#[cfg(test)]
mod tests;
