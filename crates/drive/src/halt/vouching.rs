//! Whether what was halted is what the unit says it is. Where it is not, it is halted as that.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::Command;

use super::not_halted::Why;
use super::proof::Proof;
use super::{Halt, PAUSE};
use crate::aim::NotTaken;
use crate::asked::NotTold;
use crate::contradiction::Contradiction;
use crate::families::Families;
use crate::harm::What;
use crate::same_unit::Against;
use crate::set_otherwise::{Dialect, dialect};
use crate::task::{Cause, LineError, Mailbox};

/// Time for which a unit that does not show a halt is asked what it is, while it is not heard.
const ASKED_FOR: Duration = Duration::from_secs(1);

/// What came of it where a unit had to say anew what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anew {
    /// It is another one, and was halted as that.
    Another,
    /// It is what was halted.
    Same,
    /// It did not say, or had to say it before.
    Unsaid,
}

/// How often a unit is asked once more what it is that answered in part only.
const AGAIN: u32 = 4;

impl<E: LineError> Halt<E> {
    /// The looks that prove the halt that was taken, once the unit has said that it is what was halted.
    ///
    /// One that says it is something else is halted as that first.
    pub(super) async fn prove(&mut self, line: &Mailbox<E>, families: &Families) -> Result<Proof, Why<E>> {
        self.vouch(line, families).await?;
        let moments = (self.sent, self.confirmed);
        // By which ramp a word of another setting stops it, nobody knows.
        let command = if self.otherwise.is_some() { Command::Coast } else { self.command };
        Ok(Proof::new(&self.unit, command, moments, self.order.confirm, line.now()))
    }

    /// Asks nothing of a unit that this line has identified, or that was halted as what it showed.
    async fn vouch(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), Why<E>> {
        if !self.is_as_named() || self.unit.same().identity().is_known(line.connection()) {
            return self.vouch_words(line, families).await;
        }
        let Some(against) = self.contradiction(line, families).await? else {
            return self.vouch_words(line, families).await;
        };
        // One that speaks against its name again and again is not given time again and again: it would never end.
        if self.aim.doubt(families) {
            self.until = line.now() + self.order.within;
        }
        match self.once_more(line, families).await {
            Err(why) if why.is_forbidden() => {
                Err(Why::Another { against: Some(Box::new(against)), then: Box::new(why) })
            }
            done => done,
        }
    }

    /// Asks which words it takes of a unit that was silent when it was to say so. One that takes others is halted once more, by those.
    async fn vouch_words(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), Why<E>> {
        let (same, connection) = (self.unit.same(), line.connection());
        let (family, is_told) = (same.family(), same.identity().takes_own_words(connection));
        if is_told || self.otherwise.is_some() || !self.is_as_named() || !family.has_dialects() {
            return Ok(());
        }
        for _ in 0..=AGAIN {
            match dialect(line, same.unit(), family, |read| read.urgent(true)).await {
                Ok(Dialect::Own) => {
                    same.identity().found_own_words(connection);
                    return Ok(());
                }
                Ok(Dialect::Other(_)) => {
                    self.until = line.now() + self.order.within;
                    return match self.once_more(line, families).await {
                        Err(why) if why.is_forbidden() => Err(Why::Another { against: None, then: Box::new(why) }),
                        done => done,
                    };
                }
                Ok(Dialect::Untold) => {}
                Err(error) if error.cause().is_of_the_line() => {}
                Err(error) => return Err(Why::Failed(error)),
            }
            line.sleep(PAUSE).await.map_err(Why::Failed)?;
        }
        Ok(())
    }

    /// Has the unit say anew what it is. One that shows another family is halted once more, as that.
    ///
    /// A port that stayed open may have another drive behind it, whatever the line knew of the one before. Where no answer
    /// comes it is asked again, until none has come for a second: an answer that was lost is no reason to let it run.
    pub(super) async fn vouch_anew(&mut self, line: &Mailbox<E>, families: &Families) -> Result<Anew, Why<E>> {
        if !self.aim.doubt(families) {
            return Ok(Anew::Unsaid);
        }
        let began = line.now();
        let mut heard = began;
        let target = loop {
            let failed = match self.aim.take(line, families, self.command).await {
                Ok(Some(target)) => break target,
                Ok(None) | Err(NotTaken::NotTold(NotTold::Unreached { .. } | NotTold::Busy { .. })) => {
                    // One question alone may take seconds: what it heard before the last counts.
                    let is_silent = self.aim.heard() <= heard && line.now() >= heard + ASKED_FOR;
                    if is_silent || line.now() >= began + self.order.within {
                        return Ok(Anew::Unsaid);
                    }
                    heard = heard.max(self.aim.heard());
                    line.sleep(PAUSE).await
                }
                Err(NotTaken::MayBe(families)) => {
                    let then = Box::new(Why::Undecided { wanted: self.command, families });
                    return Err(Why::Another { against: None, then });
                }
                Err(NotTaken::SetOtherwise(otherwise)) => {
                    let then = Box::new(Why::SetOtherwise { wanted: self.command, otherwise });
                    return Err(Why::Another { against: None, then });
                }
                Err(NotTaken::NotTold(NotTold::Failed(error))) => Err(error),
            };
            if let Err(error) = failed {
                return match error.cause() {
                    Cause::Port => Ok(Anew::Unsaid),
                    Cause::Other | Cause::Halted => {
                        Err(Why::Another { against: None, then: Box::new(Why::Failed(error)) })
                    }
                    _ => Err(Why::Failed(error)),
                };
            }
        };
        let taken = self.named.taken_for(&target.family, &self.record, line.connection());
        let is_same = Arc::ptr_eq(taken.same().family(), self.unit.same().family());
        if is_same && target.otherwise == self.otherwise {
            return Ok(Anew::Same);
        }
        if !is_same {
            self.unit.same().identity().is_another();
        }
        self.until = line.now() + self.order.within;
        self.once_more(line, families).await?;
        Ok(Anew::Another)
    }

    /// Whether it was halted once more, as another family, although it showed the halt: in the words of that one.
    ///
    /// Asks nothing of a unit that said lately what it is, nor where the halt does no harm to any family. Behind a port that
    /// was opened again since, what showed the halt may be a drive that never got it: that has to say what it is.
    pub(super) async fn was_another(&mut self, line: &Mailbox<E>, families: &Families) -> Result<bool, Why<E>> {
        let same = self.unit.same();
        let against = if line.connection() == self.connection {
            let is_harmless = || families.harmed(What::Command(self.command), same.family()).is_empty();
            if !same.identity().is_old(line.now()) || is_harmless() {
                return Ok(false);
            }
            match same.contradiction(line, families, true).await {
                Ok(against) => against,
                // What it showed stands: nothing speaks against it.
                Err(error) if error.cause().is_of_the_line() => None,
                Err(error) => return Err(Why::Failed(error)),
            }
        } else {
            self.contradiction(line, families).await?
        };
        let Some(against) = against else { return Ok(false) };
        match self.vouch_anew(line, families).await? {
            Anew::Another => Ok(true),
            Anew::Same => Ok(false),
            Anew::Unsaid => Err(Why::Another { against: Some(Box::new(against)), then: Box::new(Why::Unsaid) }),
        }
    }

    /// Sends it anew, as long as there is time.
    async fn once_more(&mut self, line: &Mailbox<E>, families: &Families) -> Result<(), Why<E>> {
        self.is_taken = false;
        self.until_taken(line, families).await
    }

    /// What the unit says against its name; asked for until it is answered, for as long as a halt is sent.
    ///
    /// Where a question brought nothing, all are put again; but not for long, since a drive may never answer one.
    async fn contradiction(&self, line: &Mailbox<E>, families: &Families) -> Result<Option<Contradiction>, Why<E>> {
        let (same, until) = (self.unit.same(), line.now() + self.order.within);
        let mut times = 0;
        loop {
            let is_over = || line.now() >= until || line.is_closed();
            match same.against(line, families, true).await {
                Ok(Against { found: None, is_whole: false }) if times < AGAIN && !line.is_closed() => times += 1,
                Ok(Against { found, .. }) => return Ok(found),
                Err(error) if !error.cause().is_of_the_line() => return Err(Why::Failed(error)),
                Err(error) if is_over() => return Err(Why::Unasked(error)),
                Err(_) => {}
            }
            line.sleep(PAUSE).await.map_err(Why::Failed)?;
        }
    }
}
