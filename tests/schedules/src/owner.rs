//! Who has the line asks it once, and is answered, unless nobody waits for that any more. What is asked, and how often, is
//! decided elsewhere (`drivebus_rtu`), and not here.

#[path = "../../../crates/line/src/owner/meanings.rs"]
#[allow(dead_code, reason = "the whole of what is shipped")]
pub(crate) mod meanings;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_rtu::{Answer, Instant, OwnEcho, SerialFormat};

use crate::error::Failure;
use crate::health::link::Links;
use crate::health::stats::Stats;
use crate::line::{Line, Opener};
use crate::owner::exchange::{Talk, Then};
use crate::owner::meanings::UnitMeanings;
use crate::system::clock::monotonic;
use crate::trace::Trace;

pub(crate) mod exchange {
    //! One call, and how far it has come.

    use drivebus_rtu::{Conversation, Instant};

    use crate::ask::{Ask, Done};
    use crate::error::{CallError, Failure};
    use crate::owner::Owner;

    pub(crate) struct Talk<'a, 'r> {
        pub(crate) call: Conversation<'r>,
        pub(crate) ask: &'a Ask<'r>,
        pub(super) cut: Option<Failure>,
        pub(super) has_let_pass: bool,
    }

    impl<'a, 'r> Talk<'a, 'r> {
        pub(crate) fn new(call: Conversation<'r>, ask: &'a Ask<'r>, _: &'a dyn Fn() -> bool) -> Self {
            Self { call, ask, cut: None, has_let_pass: false }
        }

        pub(crate) fn cut_short(&mut self, _: &mut Owner, _: Instant, failure: Failure) {
            self.cut = Some(failure);
        }
    }

    /// What is to be done next.
    pub(crate) enum Then {
        Done(Result<Done, Box<CallError>>),
        LetPass,
        #[expect(dead_code, reason = "no unit here is waited for off the line")]
        StandBy(Instant),
    }
}

/// The line.
#[derive(Debug)]
pub(crate) struct Owner {
    line: Option<Box<dyn Line>>,
    opener: Opens,
    pub(crate) meanings: Arc<UnitMeanings>,
    links: Arc<Mutex<Links>>,
    stats: Arc<Mutex<Stats>>,
}

/// What opens it.
struct Opens(Opener);

impl std::fmt::Debug for Opens {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Opens")
    }
}

impl Owner {
    pub(crate) fn new(opener: Opener, _: SerialFormat, _: OwnEcho, _: u64, stats: Arc<Mutex<Stats>>) -> Self {
        Self { line: None, opener: Opens(opener), meanings: Arc::default(), links: Arc::default(), stats }
    }

    pub(crate) fn open(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        self.prepare(give_up)
    }

    pub(crate) fn close(&mut self) {
        self.line = None;
    }

    pub(crate) fn shared_links(&self) -> Arc<Mutex<Links>> {
        Arc::clone(&self.links)
    }

    pub(crate) fn stats(&self) -> MutexGuard<'_, Stats> {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn now(&self) -> Instant {
        monotonic()
    }

    pub(crate) fn line(&mut self) -> Option<&mut (dyn Line + 'static)> {
        self.line.as_deref_mut()
    }

    pub(crate) fn stray(&mut self, _: Instant, _: &[u8]) {}

    pub(crate) fn prepare(&mut self, _: &mut dyn FnMut() -> bool) -> Result<(), Failure> {
        if self.line.is_none() {
            self.line = Some((self.opener.0)().map_err(Failure::Port)?);
        }
        Ok(())
    }

    pub(crate) fn show_to(&mut self, _: &Trace) {}

    /// Asks, once stops had the chance to go first.
    pub(crate) fn go_on(
        &mut self,
        talk: &mut Talk<'_, '_>,
        now: Instant,
        give_up: &mut dyn FnMut() -> bool,
        _: &mut dyn FnMut(Answer<'_>),
    ) -> Then {
        if let Some(failure) = talk.cut.take() {
            return Then::Done(Err(talk.ask.failed(failure, None, now, &[])));
        }
        if !std::mem::replace(&mut talk.has_let_pass, true) {
            return Then::LetPass;
        }
        let Some(line) = &mut self.line else {
            return Then::Done(Err(talk.ask.failed(Failure::Closed, None, now, &[])));
        };
        let sent = line.send(&talk.ask.frame());
        Then::Done(match sent {
            Err(error) => Err(talk.ask.failed(Failure::Port(error), Some(now), now, &[])),
            Ok(_) if give_up() => Err(talk.ask.failed(Failure::Interrupted, Some(now), now, &[])),
            Ok(ended) => Ok(crate::ask::Done { sent: now, ended }),
        })
    }
}
