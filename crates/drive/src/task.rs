//! Operations that wait for a line, without one: each is an `async fn` over a [`Mailbox`], and a [`Task`] drives it by hand.
//!
//! An operation puts what it wants done into its mailbox, as a [`Wish`], and waits. Whoever drives it does that, and brings
//! the [`Outcome`] to its next step. So an operation is written once, from its beginning to its end, and needs no clock, no
//! port, no thread and no runtime: a thread that blocks drives it, and so do an event loop, another language and a test.

mod line_error;
mod wish;

use std::fmt;
use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use drivebus_rtu::{Instant, UnitAddress};
use thiserror::Error;

pub use line_error::{Cause, LineError};
pub use wish::{Link, Notice, Payload, Read, Stamped, Wish, Write};

use crate::family::Family;

/// What is seen of the line before a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    /// Now, on the line's clock.
    pub now: Instant,
    /// How often its port was opened again after it was lost.
    pub connection: u64,
    /// Whether it was closed for good.
    pub is_closed: bool,
}

/// What came of a wish. `E` is the error of whoever drives.
#[derive(Debug)]
#[non_exhaustive]
pub enum Outcome<E> {
    /// The words that were read, as many as were asked for.
    Words(Vec<u16>),
    /// The same of a read that is to be stamped.
    Stamped(Stamped),
    /// The unit confirmed what was written.
    Written,
    /// The time is over.
    Slept,
    /// How well the unit could be reached.
    Link(Link),
    /// How often the unit was told to halt; `None` where the line does not count that.
    Halts(Option<u64>),
    /// Whoever drives has heard it.
    Heard,
    /// It failed.
    Failed(E),
}

/// What a step came to.
#[derive(Debug)]
pub enum Step<T> {
    /// The operation wants this, and waits.
    Wish(Wish),
    /// It is done.
    Done(T),
}

/// A step that could not be made. The task is as it was before, and may be given another one.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Misuse {
    /// An outcome came, and nothing was wished for.
    #[error("an outcome came that nothing was wished for")]
    NotWished,
    /// Nothing came of the last wish.
    #[error("the last wish has no outcome yet: {0}")]
    NoOutcome(Wish),
    /// What came is not what was wished for.
    #[error("what came does not fit the last wish: {0}")]
    Unfit(Wish),
    /// Time went back.
    #[error("the clock went back by {0:?}")]
    WentBack(Duration),
    /// The operation is done.
    #[error("the operation is done")]
    Over,
    /// The operation waits for something that is no outcome of its mailbox.
    #[error("the operation waits for something else than its mailbox")]
    Stuck,
}

/// Where an operation puts what it wants done, and finds what came of it.
pub struct Mailbox<E> {
    desk: Arc<Mutex<Desk<E>>>,
    taken: Option<(UnitAddress, Arc<Family>)>,
}

/// What lies between an operation and who drives it.
struct Desk<E> {
    seen: Seen,
    wish: Option<Wished>,
    outcome: Option<Outcome<E>>,
}

/// A wish, of which unit it is, and as one of which family that is taken.
struct Wished {
    wish: Wish,
    taken: Option<(UnitAddress, Arc<Family>)>,
}

impl<E> Mailbox<E> {
    /// Now, on the line's clock, as it was before this step.
    pub fn now(&self) -> Instant {
        self.desk().seen.now
    }

    /// How often the port was opened again: while this number stays the same, whoever answered still does.
    pub fn connection(&self) -> u64 {
        self.desk().seen.connection
    }

    /// Whether the line was closed for good.
    pub fn is_closed(&self) -> bool {
        self.desk().seen.is_closed
    }

    /// The same, for what is wished of `unit`, which is taken for one of `family`: see [`Task::taken_for`].
    #[must_use]
    pub fn taken_for(&self, unit: UnitAddress, family: &Arc<Family>) -> Self {
        Self { desk: Arc::clone(&self.desk), taken: Some((unit, Arc::clone(family))) }
    }

    /// Reads words.
    ///
    /// # Errors
    ///
    /// What whoever drives made of it.
    pub async fn read(&self, read: Read) -> Result<Vec<u16>, E> {
        let words = |outcome| if let Outcome::Words(words) = outcome { Some(words) } else { None };
        self.ask(Wish::Read(Read { is_stamped: false, ..read }), words).await
    }

    /// Reads words, with the moments at which that was.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read) has them.
    pub async fn read_stamped(&self, read: Read) -> Result<Stamped, E> {
        let stamped = |outcome| if let Outcome::Stamped(stamped) = outcome { Some(stamped) } else { None };
        self.ask(Wish::Read(Read { is_stamped: true, ..read }), stamped).await
    }

    /// Waits on the line's clock; others may use the line meanwhile.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read) has them.
    pub async fn sleep(&self, time: Duration) -> Result<(), E> {
        self.ask(Wish::Sleep(time), |outcome| matches!(outcome, Outcome::Slept).then_some(())).await
    }

    /// Writes words, once.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read) has them.
    pub async fn write(&self, write: Write) -> Result<(), E> {
        self.ask(Wish::Write(write), |outcome| matches!(outcome, Outcome::Written).then_some(())).await
    }

    /// How well `unit` could be reached lately.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read) has them.
    pub async fn link(&self, unit: UnitAddress) -> Result<Link, E> {
        self.ask(Wish::Link(unit), |outcome| if let Outcome::Link(link) = outcome { Some(link) } else { None }).await
    }

    /// How often `unit` was told to halt over this line; `None` where that is not counted.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read) has them.
    pub async fn halts(&self, unit: UnitAddress) -> Result<Option<u64>, E> {
        self.ask(Wish::Halts(unit), |outcome| if let Outcome::Halts(halts) = outcome { Some(halts) } else { None })
            .await
    }

    /// Tells whoever drives what has just come about.
    pub async fn tell(&self, notice: Notice) {
        self.wait(Wish::Tell(notice), |outcome| matches!(outcome, Outcome::Heard).then_some(())).await;
    }

    /// What comes of a wish that may fail.
    async fn ask<T>(&self, wish: Wish, take: fn(Outcome<E>) -> Option<T>) -> Result<T, E> {
        self.wait(wish, |outcome| match outcome {
            Outcome::Failed(error) => Some(Err(error)),
            outcome => take(outcome).map(Ok),
        })
        .await
    }

    async fn wait<T>(&self, wish: Wish, take: impl Fn(Outcome<E>) -> Option<T>) -> T {
        let mut wish = Some(Wished { wish, taken: self.taken.clone() });
        poll_fn(|_| {
            let mut desk = self.desk();
            if let Some(wish) = wish.take() {
                desk.wish = Some(wish);
                return Poll::Pending;
            }
            // What does not fit was refused at the door of the step.
            desk.outcome.take().and_then(&take).map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }

    fn desk(&self) -> MutexGuard<'_, Desk<E>> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<E> Clone for Mailbox<E> {
    fn clone(&self) -> Self {
        Self { desk: Arc::clone(&self.desk), taken: self.taken.clone() }
    }
}

impl<E> fmt::Debug for Mailbox<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mailbox").field("seen", &self.desk().seen).finish_non_exhaustive()
    }
}

/// An operation on its way.
///
/// ```
/// use drivebus_drive::task::{Outcome, Read, Seen, Step, Task, Wish};
/// use drivebus_rtu::{Instant, UnitAddress};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let unit = UnitAddress::new(1)?;
/// // What unit 1 says twice in a row at 2100H.
/// let mut task = Task::new(async move |line| {
///     let mut last = line.read(Read::word(unit, 0x2100.into())).await?;
///     loop {
///         let next = line.read(Read::word(unit, 0x2100.into())).await?;
///         if next == last {
///             return Ok::<_, &str>(next);
///         }
///         last = next;
///     }
/// });
/// let mut answers = [[1], [3], [3]].into_iter();
/// let seen = Seen { now: Instant::ZERO, connection: 0, is_closed: false };
/// let mut outcome = None;
/// let told = loop {
///     outcome = match task.step(seen, outcome)? {
///         Step::Wish(Wish::Read(_)) => answers.next().map(|words| Outcome::Words(words.to_vec())),
///         Step::Wish(_) => Some(Outcome::Slept),
///         Step::Done(told) => break told,
///     };
/// };
/// assert_eq!(told, Ok(vec![3]));
/// # Ok(())
/// # }
/// ```
#[must_use = "an operation does nothing until it is stepped"]
pub struct Task<T, E> {
    /// `None` once it is done.
    operation: Option<Pin<Box<dyn Future<Output = T> + Send>>>,
    mailbox: Mailbox<E>,
    /// What is waited for.
    wished: Option<Wished>,
}

impl<T, E> Task<T, E> {
    /// An operation that waits for nothing but its mailbox. Nothing of it is done yet.
    pub fn new<F>(operation: impl FnOnce(Mailbox<E>) -> F) -> Self
    where
        F: Future<Output = T> + Send + 'static,
    {
        let seen = Seen { now: Instant::ZERO, connection: 0, is_closed: false };
        let desk = Arc::new(Mutex::new(Desk { seen, wish: None, outcome: None }));
        let mailbox = Mailbox { desk, taken: None };
        Self { operation: Some(Box::pin(operation(mailbox.clone()))), mailbox, wished: None }
    }

    /// Goes on until the operation wants something, or is done.
    ///
    /// `outcome` is what came of the last wish, and `None` at the first step. Moments must not go back.
    ///
    /// # Errors
    ///
    /// [`Misuse`]: the step was not made, or, as [`Misuse::Stuck`], came to nothing.
    pub fn step(&mut self, seen: Seen, outcome: Option<Outcome<E>>) -> Result<Step<T>, Misuse> {
        let operation = self.operation.as_mut().ok_or(Misuse::Over)?;
        let mut desk = self.mailbox.desk();
        if seen.now < desk.seen.now {
            return Err(Misuse::WentBack(desk.seen.now.saturating_duration_since(seen.now)));
        }
        match (self.wished.as_ref().map(|wished| &wished.wish), &outcome) {
            (None, Some(_)) => return Err(Misuse::NotWished),
            (Some(wish), None) => return Err(Misuse::NoOutcome(wish.clone())),
            (Some(wish), Some(outcome)) if !wish.is_met_by(outcome) => return Err(Misuse::Unfit(wish.clone())),
            _ => {}
        }
        desk.seen = seen;
        desk.outcome = outcome;
        drop(desk);
        self.wished = None;
        if let Poll::Ready(done) = operation.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            self.operation = None;
            return Ok(Step::Done(done));
        }
        self.wished = self.mailbox.desk().wish.take();
        self.pending().cloned().map(Step::Wish).ok_or(Misuse::Stuck)
    }

    /// What is wished for and has no outcome yet: what a task that is dropped now leaves open. `None` before its first
    /// step, and where it is done.
    pub fn pending(&self) -> Option<&Wish> {
        self.wished.as_ref().map(|wished| &wished.wish)
    }

    /// Of which unit that wish is, and as one of which family that is taken, so that a refusal is told in the words of that;
    /// `None` where nobody says yet what it is, and each answer counts alone. A notice is of a unit always.
    pub fn taken_for(&self) -> Option<(UnitAddress, &Arc<Family>)> {
        let (unit, family) = self.wished.as_ref()?.taken.as_ref()?;
        Some((*unit, family))
    }
}

impl<T, E> fmt::Debug for Task<T, E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Task")
            .field("is_done", &self.operation.is_none())
            .field("pending", &self.pending())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
