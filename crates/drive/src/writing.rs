//! One write to a unit: only if it still is what it was, and only where the words do no harm to what it may be instead.

use drivebus_drives::{Command, Place};
use drivebus_rtu::Meaning;
use thiserror::Error;

use crate::aim::{NotTaken, check_harmless};
use crate::asked::NotTold;
use crate::families::Families;
use crate::harm::What;
use crate::same_unit::NotSame;
use crate::task::{Cause, LineError, Mailbox, Payload, Write};
use crate::unit::Unit;
use crate::unlock::{key_after, unlock};

/// How often an absolute value is sent once more to a drive that could not take it, as it says.
const AGAIN: u32 = 4;

/// What is written, and how that is meant.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Words {
    /// Where the first word goes.
    pub place: Place,
    /// What goes there.
    pub payload: Payload,
    /// Where the same can be read: there a confirmation that is missing is looked for.
    pub read_back: Option<u16>,
    /// Whether it is a value and no command: where the drive says that it is busy or got the request damaged, so that it did
    /// not take it, it is sent again.
    pub is_absolute: bool,
    /// Whether a unit that contradicts its name gets nothing. Where not, it is a reset, which must do no harm to what that is.
    pub is_judged: bool,
    /// Whether it goes out also where the line knows the unit as one of a family that does not define it.
    pub is_forced: bool,
}

impl Words {
    /// `payload`, sent once to `place` of a unit that does not contradict its name.
    pub const fn once(place: Place, payload: Payload) -> Self {
        Self { place, payload, read_back: None, is_absolute: false, is_judged: true, is_forced: false }
    }

    /// A value, which can be read at `read_back`.
    pub fn value(place: Place, payload: Payload, read_back: Option<u16>) -> Self {
        Self { read_back, is_absolute: true, ..Self::once(place, payload) }
    }
}

/// Why a unit is not known to have taken what was written. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotWritten<E> {
    /// It is not what it was named as, or not known to be. Nothing was sent.
    #[error("nothing was written: {0}")]
    NotSame(NotSame<E>),
    /// It may be of a family that the word would do harm to. Nothing was sent.
    #[error("nothing was written: {0}")]
    Harm(NotTaken<E>),
    /// The line failed, or the unit refused.
    #[error("{0}")]
    Failed(E),
}

impl<E: LineError> NotWritten<E> {
    /// What went wrong.
    pub fn cause(&self) -> Cause {
        match self {
            Self::NotSame(NotSame::Unsaid(error) | NotSame::Failed(error)) | Self::Failed(error) => error.cause(),
            Self::Harm(NotTaken::NotTold(why)) => why.cause(),
            Self::NotSame(_) | Self::Harm(_) => Cause::Other,
        }
    }

    /// Whether the write went out: the unit may have taken it then, unless it was refused.
    pub fn was_sent(&self) -> bool {
        matches!(self, Self::Failed(error) if error.was_sent())
    }
}

impl Unit {
    /// Writes `words` to it, if it still is the one it was and, where that is judged, does not say that it is another.
    ///
    /// # Errors
    ///
    /// [`NotWritten`]: its `was_sent` says whether the unit may have taken them.
    pub async fn write<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        words: &Words,
    ) -> Result<(), NotWritten<E>> {
        let is_repeated = words.is_absolute && words.read_back.is_none();
        let mut again = if is_repeated { 0 } else { AGAIN };
        let mut connection = self.make_sure(line, families, words).await?;
        let mut is_unlocked = self.unlock_first(line, words, connection).await?;
        loop {
            let Err(error) = self.send(line, words, connection).await else { return Ok(()) };
            match error.cause() {
                // A port that was lost is opened by what comes next. That was refused, to see first who answers there.
                Cause::Port if !error.was_sent() && line.connection() != connection => {
                    connection = self.make_sure(line, families, words).await?;
                    self.unlock_first(line, words, connection).await?;
                    return self.send(line, words, connection).await.map_err(NotWritten::Failed);
                }
                cause if !is_unlocked && key_after(self.profile(), cause).is_some() => {
                    is_unlocked = true;
                    if !self.unlock(line, words, connection).await? {
                        return Err(NotWritten::Failed(error));
                    }
                }
                Cause::Refused(code, _) if again < AGAIN && self.family().meaning_of(code) == Meaning::AskAgain => {
                    again += 1;
                }
                _ => return Err(NotWritten::Failed(error)),
            }
        }
    }

    /// Unlocks the unit before `words`, unless they are a value and it took a word before: then it may refuse them, and is
    /// unlocked then. Whether it was.
    async fn unlock_first<E: LineError>(
        &self,
        line: &Mailbox<E>,
        words: &Words,
        connection: u64,
    ) -> Result<bool, NotWritten<E>> {
        let may_wait = words.is_absolute && self.same().identity().is_unlocked(connection);
        if may_wait { Ok(false) } else { self.unlock(line, words, connection).await }
    }

    /// Unlocks the unit for `words`, if its family wants that. Whether it was.
    async fn unlock<E: LineError>(
        &self,
        line: &Mailbox<E>,
        words: &Words,
        connection: u64,
    ) -> Result<bool, NotWritten<E>> {
        let Some(key) = self.profile().unlock().filter(|unlock| unlock.place != words.place) else { return Ok(false) };
        let line = &line.taken_for(self.address(), self.family());
        match unlock(line, key, self.profile(), &self.frame(words, connection), |read| read).await {
            Ok(true) => Ok(true),
            // Whoever means its name all the same has it told what they want, and nothing else.
            Ok(false) if self.same().is_trusted() => Ok(false),
            Ok(false) => Err(NotWritten::Harm(NotTaken::MayBe(Vec::new()))),
            Err(error) if error.cause() == Cause::Halted => Err(NotWritten::Failed(error)),
            // What was to follow was not sent.
            Err(error) => Err(NotWritten::Harm(NotTaken::NotTold(NotTold::Failed(error)))),
        }
    }

    /// `words` as a write to the unit that answers over this connection.
    fn frame(&self, words: &Words, connection: u64) -> Write {
        Write {
            read_back: words.read_back,
            connection: Some(connection),
            halts: self.halts(),
            is_forced: words.is_forced,
            ..Write::new(self.address(), words.place, words.payload.clone().as_written(self.profile()))
        }
    }

    /// The connection over which the unit is what it was, and takes no harm.
    async fn make_sure<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        words: &Words,
    ) -> Result<u64, NotWritten<E>> {
        let opened = line.connection();
        let harms_not = async |what| check_harmless(line, families, self.same(), what).await.map_err(NotWritten::Harm);
        // What is not judged resets a fault.
        if !words.is_judged {
            harms_not(What::Command(Command::ResetFault)).await?;
        }
        let checked = self.same().check(line, families, words.is_judged, false).await;
        let connection = checked.map_err(NotWritten::NotSame)?;
        if words.is_judged {
            harms_not(What::Word(words.place)).await?;
        }
        // What answered before the port was opened again may be another drive: nothing is sent then.
        Ok(connection.min(opened))
    }

    /// What decides which words the unit takes is asked again where it is written.
    fn forget_words_after(&self, words: &Words) {
        let first = words.place.number();
        let end = match &words.payload {
            Payload::Word(_) => first + 1,
            Payload::Words(words) => (first..).nth(words.len()).unwrap_or(u32::MAX),
        };
        let mut deciding = self.family().deciding();
        if deciding.any(|(place, _)| (first..end).contains(&place.number())) {
            self.same().identity().forget_words();
        }
    }

    /// Writes to whatever unit answers over this connection. One that says that it took it and is still at it has taken it.
    async fn send<E: LineError>(&self, line: &Mailbox<E>, words: &Words, connection: u64) -> Result<(), E> {
        self.forget_words_after(words);
        let write = self.frame(words, connection);
        if let Err(error) = line.taken_for(self.address(), self.family()).write(write).await {
            match error.cause() {
                // Where the words can be read, the bus has looked whether they are there.
                Cause::Refused(code, _) if self.family().meaning_of(code) == Meaning::Taken => {}
                _ => return Err(error),
            }
        }
        self.took_part();
        self.same().identity().found_unlocked(connection);
        Ok(())
    }
}
