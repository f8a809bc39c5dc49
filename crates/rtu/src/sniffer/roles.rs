//! Who says what: which frame is a request, which its answer, and what may be either.
//!
//! | what is heard | it is |
//! | --- | --- |
//! | what answers the open request, and no other | its answer |
//! | the same bytes as the open request, soon | its answer: a write that was taken, an echo |
//! | the same bytes as the open request, late | its answer or the request once more: what follows decides |
//! | what answers the open request and one before it that stayed open | the answer to one of them: what follows decides |
//! | what answers only one before it | a late answer |
//! | any other frame that can be a request | a request |
//! | any other frame | a stray |
//!
//! A master asks one thing at a time, so only the last request is open.

use core::time::Duration;

use crate::Instant;

use super::asked::{Asked, Spoken, can_ask, may_be_answer};
use super::role::Role;
use super::stories::{Behind, Held, Told};
use crate::functions::FrameLength;

/// How soon an answer comes, whatever is usual on this line.
const SOON: Duration = Duration::from_millis(20);
/// What is taken for the usual turnaround before any was heard.
const USUAL: Duration = Duration::from_millis(25);
/// What comes after so many times the usual turnaround is not soon.
const SLOWER: u32 = 3;
/// How slowly the usual turnaround follows what is heard.
const INERTIA: u32 = 8;
/// Later than this no answer comes any more.
const LATEST: Duration = Duration::from_secs(3);

/// What was said so far, as far as it tells what may be said next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Talk {
    /// The last request.
    last: Option<Asked>,
    /// The request before it that nobody answered.
    before: Option<Asked>,
    /// The usual turnaround, of what was surely an answer.
    usual: Duration,
    /// The longest that a frame was kept back: how long the adapter collects.
    lump: Duration,
    /// The silence between two frames.
    silence: Duration,
    /// How long the master waited when nobody answered it.
    gives_up: Duration,
}

impl Talk {
    pub(super) const fn new(silence: Duration) -> Self {
        Self { silence, last: None, before: None, usual: USUAL, lump: Duration::ZERO, gives_up: Duration::ZERO }
    }

    fn open(&self) -> Option<&Asked> {
        self.last.as_ref().filter(|asked| asked.is_open)
    }

    /// How long the answer to the open request is, if `here` begins as it.
    pub(super) fn expects(&self, here: &[u8]) -> FrameLength {
        self.open().map_or(FrameLength::Never, |asked| asked.answer_len(here))
    }

    /// Who said `frame`, which came from `began` to `ended`.
    pub(super) fn role(&self, frame: &[u8], began: Instant, ended: Instant, behind: &Behind<'_>) -> Told {
        let open = self.open();
        let waited = |asked: &Asked| began.saturating_duration_since(asked.ended);
        let held = Held {
            bytes: frame,
            ended,
            length: ended.saturating_duration_since(began),
            waited: self.last.as_ref().map_or(Duration::ZERO, waited),
            soon: self.soon(),
            // Behind an adapter that collects, there is no telling.
            too_soon: if self.lump > self.silence { Duration::ZERO } else { self.silence / 2 },
            gives_up: self.gives_up,
        };
        let before = self.before.as_ref().filter(|asked| waited(asked) < LATEST);
        let is_before = before.is_some_and(|asked| asked.is_answered_by(frame));
        // The answers to two requests that stayed open come in any order and at any time.
        let may_be_two = can_ask(frame) && before.is_some_and(|asked| asked.is_repeat && asked.is_answered_by(frame));
        match open.filter(|asked| asked.is_answered_by(frame)) {
            Some(_) | None if may_be_two => Ok(Role::Doubtful),
            Some(Asked { doubted: Some(_), .. }) if !can_ask(frame) => Ok(Role::Doubtful),
            Some(Asked { doubted: Some(doubted), .. }) => {
                held.repeats_once_more(began.saturating_duration_since(*doubted), behind)
            }
            Some(asked) if frame == asked.bytes() => match () {
                () if held.waited <= held.soon && !is_before => Ok(Role::Answer),
                () if is_before && asked.has_spoken() => Ok(Role::Doubtful),
                () if held.waited > held.soon && asked.has_spoken() => Ok(Role::Request),
                () => held.repeats(asked, behind),
            },
            Some(asked) if is_before => held.answers_one_of_two(asked, behind),
            // A unit answers once.
            Some(asked) if asked.spoken == Spoken::Badly => Ok(Role::Doubtful),
            Some(_) => Ok(Role::Answer),
            None if is_before && can_ask(frame) => held.answers_or_asks_again(open, behind),
            None if is_before => Ok(Role::Late),
            None if can_ask(frame) => {
                let strays =
                    |asked: &&Asked| asked.bytes()[0] != frame[0] && may_be_answer(frame) && waited(asked) <= held.soon;
                open.filter(strays).map_or(Ok(Role::Request), |asked| held.asks_or_strays(asked, behind))
            }
            None => Ok(Role::Stray),
        }
    }

    /// A frame was kept back for so long: moments tell no more than that.
    pub(super) fn kept_back(&mut self, kept: Duration) {
        self.lump = self.lump.max(kept);
    }

    /// Keeps what matters of `bytes`, and returns the turnaround of an answer.
    pub(super) fn heard(&mut self, bytes: &[u8], role: Role, began: Instant, ended: Instant) -> Option<Duration> {
        let soon = self.soon();
        match role {
            Role::Request => {
                let mut asked = Asked::new(bytes, ended);
                asked.is_repeat = self.open().is_some_and(|last| last.bytes() == bytes);
                let left = self.last.replace(asked).filter(|asked| asked.is_open);
                if let Some(asked) = left {
                    self.gives_up = began.saturating_duration_since(asked.ended);
                }
                self.before = left.filter(|asked| !asked.has_spoken()).or(self.before);
            }
            Role::Answer => {
                let asked = self.last.as_mut()?;
                asked.is_open = false;
                let turnaround = began.saturating_duration_since(asked.ended);
                if !can_ask(bytes) {
                    // One late answer does not make the others slow.
                    self.usual = (self.usual * (INERTIA - 1) + turnaround.min(soon)) / INERTIA;
                }
                return Some(turnaround);
            }
            Role::Late => self.before = None,
            Role::Doubtful => self.last.as_mut()?.doubted = Some(ended),
            Role::Stray | Role::Noise(_) => {
                let asked = self.last.as_mut().filter(|asked| asked.is_open)?;
                let is_its = match role {
                    Role::Stray => bytes[0] == asked.bytes()[0],
                    _ => asked.is_answered_badly_by(bytes),
                };
                let is_its = is_its && began.saturating_duration_since(asked.ended) <= soon;
                if is_its {
                    asked.spoken =
                        asked.spoken.max(if role == Role::Stray { Spoken::Something } else { Spoken::Badly });
                }
            }
        }
        None
    }

    fn soon(&self) -> Duration {
        SOON.max(SLOWER * self.usual) + self.lump
    }
}
