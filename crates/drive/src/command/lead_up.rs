//! What some drives want to be told before they run: words in an order, each sent once, and seen before the next.
//!
//! Nothing is left out because the state shows it already. Such a drive heeds the change of a word, and no state tells which
//! word it was given last; a start that is always the same costs a few exchanges and has no second way to go wrong.

use std::time::Duration;

use drivebus_drives::{Place, StartWord};

use super::not_commanded::{NotLedUp, WhyNotCommanded, WhyNotLedUp};
use crate::families::Families;
use crate::halt::LastLook;
use crate::look::{Look, POLL_INTERVAL};
use crate::task::{Cause, LineError, Mailbox, Payload};
use crate::unit::Unit;
use crate::writing::Words;

type Why<E> = WhyNotCommanded<E>;

impl Unit {
    /// Sends to `place`, where commands go, what the family wants before a start; nothing where it wants nothing.
    ///
    /// The state is looked at once after each word in any case, and again for the time `within`.
    pub(super) async fn lead_up<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        place: Place,
        within: Duration,
    ) -> Result<(), Why<E>> {
        let halts = self.record().sent().halts_begun;
        for (number, word) in self.profile().start_sequence().iter().enumerate() {
            let not_led_up = |why| Why::NotLedUp(NotLedUp { number, why });
            let words = Words::once(place, Payload::Word(word.word));
            if let Err(why) = self.write(line, families, &words).await {
                let cause = why.cause();
                return Err(match cause {
                    _ if number == 0 && !why.was_sent() => Why::NotWritten(why),
                    Cause::Halted => not_led_up(WhyNotLedUp::HaltedBefore(why)),
                    _ if cause.is_of_the_line() => not_led_up(WhyNotLedUp::NotWritten(why)),
                    _ => Why::NotWritten(why),
                });
            }
            self.see(line, word, halts, within).await.map_err(|why| match why {
                NotSeen::LedUp(why) => not_led_up(why),
                NotSeen::Failed(error) => Why::Unseen(error),
            })?;
        }
        Ok(())
    }

    /// Looks until the state shows `word`.
    async fn see<E: LineError>(
        &self,
        line: &Mailbox<E>,
        word: &StartWord,
        halts: u64,
        within: Duration,
    ) -> Result<(), NotSeen<E>> {
        let deadline = line.now() + within;
        loop {
            let last = match self.look(line).await {
                Ok(_) if self.record().sent().halts_begun != halts => return Err(NotSeen::LedUp(WhyNotLedUp::Halted)),
                Ok(look) if look.is_tripped() => return Err(NotSeen::LedUp(WhyNotLedUp::Tripped(look))),
                Ok(look) if shows(&look, word) => return Ok(()),
                Ok(look) => LastLook::Seen { look, hz: None },
                Err(error) => match error.cause() {
                    Cause::Port => return Err(NotSeen::LedUp(WhyNotLedUp::PortLost(error))),
                    Cause::Other | Cause::Halted => return Err(NotSeen::Failed(error)),
                    Cause::NoAnswer | Cause::BadAnswer | Cause::Refused(..) => LastLook::Unread(error),
                },
            };
            if line.now() >= deadline {
                return Err(NotSeen::LedUp(WhyNotLedUp::Unshown(last)));
            }
            line.sleep(POLL_INTERVAL).await.map_err(NotSeen::Failed)?;
        }
    }
}

/// Why the state does not show a word.
enum NotSeen<E> {
    LedUp(WhyNotLedUp<E>),
    Failed(E),
}

fn shows(look: &Look, wanted: &StartWord) -> bool {
    look.word.is_some_and(|word| wanted.until.iter().all(|until| word & until.mask == until.value))
}
