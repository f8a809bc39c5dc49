//! The word that stores all that a drive has in RAM, where a family has one: sent once, after the last value.

use std::time::Duration;

use drivebus_drives::Place;

use super::not_kept::{WhyNotKept, WhyNotStored};
use super::plan::Planned;
use crate::families::Families;
use crate::look::POLL_INTERVAL;
use crate::task::{LineError, Mailbox, Payload, Read};
use crate::unit::Unit;
use crate::writing::Words;

/// How long a drive may take to store all that was set. Assumption: no manual at hand says how long that is.
const STORED_WITHIN: Duration = Duration::from_secs(5);

impl Unit {
    /// Stores all that the drive has in RAM, by whomever it was set, where its family has a word for that; else nothing is sent.
    ///
    /// # Errors
    ///
    /// [`WhyNotStored`]: what was set stays in force, and may be lost with the power.
    pub async fn store_all<E: LineError>(&self, line: &Mailbox<E>, families: &Families) -> Result<(), WhyNotStored<E>> {
        let Some((store, place)) = self.profile().store_word() else { return Ok(()) };
        self.rule().stores().map_err(|why| WhyNotStored::MayNot(why.to_string()))?;
        if let Some(idle) = store.idle {
            let found = self.word_at(line, place).await.map_err(WhyNotStored::Unread)?;
            if found != idle {
                return Err(WhyNotStored::NotIdle { found, idle });
            }
        }
        let words = Words::value(place, Payload::Word(store.word), None);
        self.write(line, families, &words).await.map_err(WhyNotStored::NotWritten)?;
        if let Some(idle) = store.idle {
            self.see_stored(line, place, idle).await?;
        }
        for key in self.record().in_ram() {
            self.note_stored(line, &key).await;
        }
        Ok(())
    }

    /// The same where one of `planned` is in RAM alone.
    pub(super) async fn store_written<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        planned: &[Planned<'_>],
    ) -> Result<(), WhyNotKept<E>> {
        let Some((store, _)) = self.profile().store_word() else { return Ok(()) };
        if !planned.iter().any(|item| item.is_parameter() && self.record().is_in_ram(item.key())) {
            return Ok(());
        }
        let stored = self.store_all(line, families).await;
        stored.map_err(|why| WhyNotKept::NotStored { register: store.register.clone(), why })
    }

    /// Waits until the word at `place` is back at `idle`: the drive has stored all then.
    async fn see_stored<E: LineError>(
        &self,
        line: &Mailbox<E>,
        place: Place,
        idle: u16,
    ) -> Result<(), WhyNotStored<E>> {
        let deadline = line.now() + STORED_WITHIN;
        loop {
            let found = self.word_at(line, place).await.map_err(WhyNotStored::Unseen)?;
            if found == idle {
                return Ok(());
            }
            if line.now() >= deadline {
                return Err(WhyNotStored::Late(found));
            }
            line.sleep(POLL_INTERVAL).await.map_err(WhyNotStored::Unseen)?;
        }
    }

    async fn word_at<E>(&self, line: &Mailbox<E>, place: Place) -> Result<u16, E> {
        let read = Read::words(self.address(), place, 1);
        let words = line.taken_for(self.address(), self.family()).read(read).await?;
        Ok(words.first().copied().unwrap_or_default())
    }
}
