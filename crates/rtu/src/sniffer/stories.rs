//! Where two stories fit a frame, what follows it decides; where that does not either, it is not told who said it.
//!
//! A story that would have a unit answer at its usual pace is believed before one that has it late by chance at just
//! that moment. It is not believed where a second answer follows, or bytes that may have been one.

use core::time::Duration;

use crate::Instant;

use super::asked::{Asked, can_ask, is_pair};
use super::role::Role;

/// So long is waited at most for the frames that decide, unless the one before waited longer.
const PATIENCE: Duration = Duration::from_secs(1);

/// A frame that may be one thing or another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) ended: Instant,
    /// How long it took.
    pub(super) length: Duration,
    /// Since the end of the request before it.
    pub(super) waited: Duration,
    /// What is soon on this line, and what is sooner than any unit answers.
    pub(super) soon: Duration,
    pub(super) too_soon: Duration,
    /// How long this master waits for an answer, as far as it has shown.
    pub(super) gives_up: Duration,
}

/// What follows on the wire, as far as it is known.
#[derive(Debug, Clone, Copy)]
pub(super) enum Next<'a> {
    Frame { bytes: &'a [u8], began: Instant },
    Noise { bytes: &'a [u8], began: Instant },
    Unknown,
}

/// What is heard behind a frame, and the moment by which that is all.
#[derive(Debug, Clone, Copy)]
pub(super) struct Behind<'a> {
    pub(super) next: [Next<'a>; 3],
    pub(super) now: Instant,
}

impl Behind<'_> {
    /// Whether a request and its answer follow.
    fn begins_with_a_pair(&self) -> bool {
        matches!(self.next, [Next::Frame { bytes: request, .. }, Next::Frame { bytes: answer, .. }, _]
            if can_ask(request) && is_pair(request, answer))
    }

    /// The first frame that follows, behind noise too; noise where nothing but noise follows.
    fn next_frame(&self) -> &Next<'_> {
        self.next.iter().find(|next| !matches!(next, Next::Noise { .. })).unwrap_or(&self.next[0])
    }

    /// Whether it is not known what follows, or what follows that.
    fn is_open_end(&self) -> bool {
        matches!(self.next, [Next::Unknown, ..] | [Next::Frame { .. }, Next::Unknown, _])
    }
}

/// What is told of a frame: who said it, or until when that has to wait for what follows.
pub(super) type Told = Result<Role, Instant>;

impl Held<'_> {
    fn is_soon(&self) -> bool {
        self.waited <= self.soon
    }

    fn follows(&self, began: Instant) -> Duration {
        began.saturating_duration_since(self.ended)
    }

    /// Whether the master waited on until `began`, as it does where nobody answers: this was not what it waited for.
    fn is_waited_on(&self, began: Instant) -> bool {
        is_alike(self.waited + self.length + self.follows(began), self.gives_up)
    }

    /// `role`, if nothing has followed for so long that nothing will.
    fn unless_more_comes(&self, now: Instant, role: Role) -> Told {
        let longest = self.waited.max(self.gives_up);
        let until = self.ended + PATIENCE.max(longest + longest / 10);
        if now >= until { Ok(role) } else { Err(until) }
    }

    /// The bytes of the open request `asked` once more: its answer, or the request repeated.
    pub(super) fn repeats(&self, asked: &Asked, behind: &Behind<'_>) -> Told {
        let usually = if self.is_soon() { Role::Answer } else { Role::Doubtful };
        Ok(match behind.next[0] {
            Next::Frame { began, .. } | Next::Noise { began, .. } if self.is_soon() && self.is_waited_on(began) => {
                Role::Doubtful
            }
            // Three times the same: the two that are near to each other belong together.
            Next::Frame { bytes, began } if bytes == self.bytes => match (self.is_soon(), self.follows(began)) {
                (false, follows) if follows <= self.soon || is_alike(self.waited, follows) => Role::Request,
                (true, follows) if follows > self.soon => Role::Answer,
                _ => Role::Doubtful,
            },
            // A refusal.
            Next::Frame { bytes, .. } if asked.is_answered_by(bytes) => Role::Request,
            Next::Frame { bytes, began } if asked.is_followed_by(bytes) || behind.begins_with_a_pair() => {
                match self.follows(began) {
                    _ if self.is_soon() => Role::Answer,
                    // Given up after as long as the first time; or gone on with, so that it was answered.
                    follows if 5 * follows >= 4 * self.waited => Role::Request,
                    follows if 2 * follows <= self.waited => Role::Answer,
                    _ => Role::Doubtful,
                }
            }
            Next::Noise { bytes, began } if !self.is_soon() && asked.is_answered_badly_by(bytes) => {
                let follows = self.follows(began);
                let is_its = follows <= self.soon || is_alike(self.waited, follows);
                if is_its { Role::Request } else { Role::Doubtful }
            }
            Next::Noise { began, .. } if self.follows(began) > self.soon => usually,
            _ if behind.is_open_end() => return self.unless_more_comes(behind.now, usually),
            _ => Role::Doubtful,
        })
    }

    /// The bytes of the open request once more, `since` some of which it is not told who said them.
    pub(super) fn repeats_once_more(&self, since: Duration, behind: &Behind<'_>) -> Told {
        let is_time = is_alike(since, self.gives_up) || is_alike(self.waited, self.gives_up);
        match behind.next[0] {
            Next::Frame { bytes, began } if is_time && bytes == self.bytes && self.follows(began) <= self.soon => {
                Ok(Role::Request)
            }
            Next::Unknown if is_time && behind.now <= self.ended + self.soon => Err(self.ended + self.soon),
            _ => Ok(Role::Doubtful),
        }
    }

    /// An answer to the open request `asked`, or to one before it that stayed open.
    pub(super) fn answers_one_of_two(&self, asked: &Asked, behind: &Behind<'_>) -> Told {
        if !self.is_soon() || self.waited < self.too_soon || asked.has_spoken() {
            return Ok(Role::Doubtful);
        }
        let [next, second, third] = behind.next;
        Ok(match next {
            Next::Frame { bytes, .. } if asked.is_answered_by(bytes) => Role::Doubtful,
            Next::Frame { began, .. } | Next::Noise { began, .. } if self.is_waited_on(began) => Role::Doubtful,
            // Had this been late, another answer would follow, behind the next request or behind its answer.
            Next::Frame { bytes: request, .. } if can_ask(request) => match (second, third) {
                (Next::Frame { bytes, .. }, _) if !asked.is_answered_by(bytes) => Role::Answer,
                (Next::Frame { bytes, .. }, _) if !is_pair(request, bytes) => Role::Doubtful,
                (Next::Frame { .. }, Next::Frame { bytes, .. }) if can_ask(bytes) => Role::Answer,
                (Next::Frame { .. }, Next::Unknown) | (Next::Unknown, _) => {
                    return self.unless_more_comes(behind.now, Role::Answer);
                }
                (Next::Noise { bytes, .. }, _) if !asked.is_answered_badly_by(bytes) => Role::Answer,
                _ => Role::Doubtful,
            },
            Next::Noise { began, .. } if self.follows(began) > self.soon => Role::Answer,
            Next::Frame { .. } | Next::Noise { .. } => Role::Doubtful,
            Next::Unknown => return self.unless_more_comes(behind.now, Role::Answer),
        })
    }

    /// An answer to a write before the open request `asked`, or that write once more.
    pub(super) fn answers_or_asks_again(&self, asked: Option<&Asked>, behind: &Behind<'_>) -> Told {
        Ok(match behind.next[0] {
            Next::Frame { bytes, .. } if bytes == self.bytes => Role::Request,
            Next::Frame { bytes, .. } if asked.is_some_and(|asked| asked.is_answered_by(bytes)) => Role::Late,
            Next::Frame { bytes, .. } if is_pair(self.bytes, bytes) => Role::Request,
            Next::Frame { .. } | Next::Noise { .. } => Role::Doubtful,
            Next::Unknown => return self.unless_more_comes(behind.now, Role::Doubtful),
        })
    }

    /// What looks like a request, so soon behind the open request `asked` that no master can have given up.
    pub(super) fn asks_or_strays(&self, asked: &Asked, behind: &Behind<'_>) -> Told {
        match *behind.next_frame() {
            Next::Frame { bytes, .. } if bytes != self.bytes && asked.is_answered_by(bytes) => Ok(Role::Stray),
            Next::Frame { .. } | Next::Noise { .. } => Ok(Role::Request),
            Next::Unknown if behind.now > self.ended + self.soon => Ok(Role::Request),
            Next::Unknown => Err(self.ended + self.soon),
        }
    }
}

/// Whether two waits are those of one time-out.
fn is_alike(one: Duration, other: Duration) -> bool {
    20 * one.abs_diff(other) <= one.max(other)
}
