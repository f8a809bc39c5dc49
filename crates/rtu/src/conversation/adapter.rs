//! What an exchange has shown about the adapter: whether it sends our own bytes back.

use super::echo::OwnEcho;
use super::known::{Ask, Known};
use super::outcome::Unanswered;
use crate::{Destination, Tally};

impl<const U: usize, const P: usize> Known<U, P> {
    /// Keeps what an exchange has shown about the adapter and the line: why `ask` was not answered, if it was not, so many
    /// bytes that `begun` an answer which did not end, and what was seen beside it.
    pub(super) fn learn(&mut self, ask: &Ask<'_>, failure: Option<Unanswered>, begun: usize, tally: Tally) {
        if self.given_echo != OwnEcho::Unknown {
            return;
        }
        let is_broadcast = ask.destination == Destination::Broadcast;
        if tally.own_echo > 0 && (self.echo == OwnEcho::Unknown || !is_broadcast) {
            self.echo = OwnEcho::Present;
            self.master.strip_echo(true);
            self.master.never_echoes(false);
            return;
        }
        if self.echo == OwnEcho::Absent || is_broadcast || ask.request.expected().may_repeat_request() {
            return;
        }
        let silent = usize::try_from(tally.noise).is_ok_and(|noise| 4 * noise <= ask.request.adu_len());
        // Bytes that may be what is left of the request may be left of an echo. Others are noise, however many, as long as
        // an answer shows that the line carries more than noise.
        let clean = tally.own_remnant == 0
            && match failure {
                None | Some(Unanswered::Refused { .. } | Unanswered::Unreached) => true,
                Some(Unanswered::NoAnswer { .. }) => silent && begun == 0,
                Some(_) => false,
            };
        match self.echo {
            OwnEcho::Unknown if clean => {
                self.echo = OwnEcho::Absent;
                self.master.never_echoes(true);
            }
            // It did not echo this time: to be looked at again before anything depends on it.
            OwnEcho::Present if clean && failure.is_none() => {
                self.echo = OwnEcho::Unknown;
                self.master.strip_echo(false);
            }
            _ => {}
        }
    }
}
