//! A drive that refuses whatever is written to it until it is unlocked: a halt too.
//!
//! What starts a motor is sent once, so such a drive is unlocked before. So it is before the first value over a connection. Later
//! ones, and each halt, go out at once, and once more where the drive refuses them as one that is locked: what it refused has
//! done nothing. Where nobody knows why a halt was not taken, it is unlocked before the next one: on a line that was just opened
//! a refusal may be taken for the answer to another program.
//!
//! Another drive may have a parameter where this one is unlocked, kept in its EEPROM. So each time the unit is asked first for
//! the word by which its family is told from all others.

use drivebus_drives::{Profile, Unlock};

use crate::asked::answer_once;
use crate::task::{Cause, LineError, Mailbox, Payload, Read, Write};

/// How a drive of `profile` is unlocked that refused a write for this `cause`; `None` where it did not do so as one that is
/// locked.
pub(crate) fn key_after(profile: &Profile, cause: Cause) -> Option<&Unlock> {
    let unlock = profile.unlock()?;
    matches!(cause, Cause::Refused(code, _) if code.0 == unlock.exception).then_some(unlock)
}

/// Unlocks the unit that is to take `write`, if it shows that it is one of the family; whether it does. The question is asked
/// as `how` makes it.
///
/// # Errors
///
/// What whoever drives made of the question, but for a refusal, or of the word that unlocks.
pub(crate) async fn unlock<E: LineError>(
    line: &Mailbox<E>,
    unlock: &Unlock,
    profile: &Profile,
    write: &Write,
    how: impl Fn(Read) -> Read,
) -> Result<bool, E> {
    let (place, word) = unlock.shown_by;
    let answer = answer_once(line, how(Read::word(write.unit, place))).await?;
    if answer.word() != Some(word) {
        return Ok(false);
    }
    let payload = Payload::Word(unlock.word).as_written(profile);
    line.write(Write { place: unlock.place, payload, read_back: None, ..write.clone() }).await?;
    Ok(true)
}

#[cfg(test)]
mod tests;
