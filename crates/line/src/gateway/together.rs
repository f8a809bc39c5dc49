//! Identical reads that wait for the line are asked once: the first whose turn comes brings the answer for all of them.
//!
//! Each is left in the queue in the turn of its own client. Who asks when the read has begun is not among them: what it gets
//! is read after it asked. Nothing is kept of an answer.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::gateway::mailbox::{Answered, Mailbox};
use crate::system::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What is asked: a unit and a PDU.
pub(super) type Question = (u8, Vec<u8>);

/// The reads that wait for the line.
#[derive(Debug, Default)]
pub(super) struct Together {
    waiting: Mutex<HashMap<Question, Vec<Arc<Asker>>>>,
}

/// One request of one client.
#[derive(Debug)]
pub(super) struct Asker {
    question: Question,
    mailbox: Arc<Mailbox>,
    number: u64,
    /// The read that has begun, for this and for others.
    read: OnceLock<Arc<Read>>,
}

/// A read that has begun.
#[derive(Debug)]
struct Read {
    /// Whether anybody still waits for it, as the line asks.
    wanted: Arc<AtomicBool>,
    /// How many do.
    askers: AtomicUsize,
}

impl Together {
    fn lock(&self) -> MutexGuard<'_, HashMap<Question, Vec<Arc<Asker>>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Request `number` of the client behind `mailbox` waits from now on.
    pub(super) fn wait(&self, question: Question, mailbox: Arc<Mailbox>, number: u64) -> Arc<Asker> {
        let asker = Arc::new(Asker { question: question.clone(), mailbox, number, read: OnceLock::new() });
        self.lock().entry(question).or_default().push(Arc::clone(&asker));
        asker
    }

    /// The turn of `asker` has come, and `wanted` tells the line whether anybody waits: who gets the answer. Nobody, where
    /// another read brings it, or it was taken back.
    pub(super) fn begin(&self, asker: &Arc<Asker>, wanted: &Arc<AtomicBool>) -> Vec<Arc<Asker>> {
        let mut waiting = self.lock();
        let is_there = |askers: &Vec<Arc<Asker>>| askers.iter().any(|one| Arc::ptr_eq(one, asker));
        if !waiting.get(&asker.question).is_some_and(is_there) {
            return Vec::new();
        }
        let askers = waiting.remove(&asker.question).unwrap_or_default();
        let read = Arc::new(Read { wanted: Arc::clone(wanted), askers: AtomicUsize::new(askers.len()) });
        for one in &askers {
            // Who has one already does not wait any more.
            let _ = one.read.set(Arc::clone(&read));
        }
        askers
    }

    /// `asker` does not want it any more. True: its turn has not come, so that it may be taken out of the queue.
    pub(super) fn take_back(&self, asker: &Arc<Asker>) -> bool {
        let mut waiting = self.lock();
        let was_waiting = waiting.get_mut(&asker.question).is_some_and(|askers| {
            let before = askers.len();
            askers.retain(|one| !Arc::ptr_eq(one, asker));
            askers.len() < before
        });
        if was_waiting && waiting.get(&asker.question).is_some_and(Vec::is_empty) {
            waiting.remove(&asker.question);
        }
        if let Some(read) = asker.read.get()
            && read.askers.fetch_sub(1, Ordering::AcqRel) == 1
        {
            read.wanted.store(false, Ordering::Release);
        }
        was_waiting
    }
}

impl Asker {
    /// Hears what came of it.
    pub(super) fn hear(&self, answered: Answered) {
        self.mailbox.come(self.number, answered);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(together: &Together, word: u8, number: u64) -> Arc<Asker> {
        together.wait((1, vec![3, 0, word, 0, 1]), Arc::default(), number)
    }

    fn numbers(askers: &[Arc<Asker>]) -> Vec<u64> {
        askers.iter().map(|one| one.number).collect()
    }

    #[test]
    fn the_first_whose_turn_comes_asks_for_all_who_wait_for_the_same() {
        let (together, wanted) = (Together::default(), Arc::new(AtomicBool::new(true)));
        let [first, second, other] = [(0, 1), (0, 2), (9, 3)].map(|(word, number)| asked(&together, word, number));
        assert_eq!(numbers(&together.begin(&second, &wanted)), [1, 2]);
        let late = asked(&together, 0, 4);
        assert!(together.begin(&first, &wanted).is_empty(), "its answer is on its way");
        assert_eq!(numbers(&together.begin(&late, &wanted)), [4], "it was asked after that read had begun");
        assert_eq!(numbers(&together.begin(&other, &wanted)), [3]);
        assert!(together.lock().is_empty());
    }

    #[test]
    fn a_read_is_wanted_until_the_last_who_waits_takes_it_back() {
        let (together, wanted) = (Together::default(), Arc::new(AtomicBool::new(true)));
        let [first, second, third] = [1, 2, 3].map(|number| asked(&together, 0, number));
        assert!(together.take_back(&third), "it waits");
        assert_eq!(numbers(&together.begin(&first, &wanted)), [1, 2]);
        assert!(!together.take_back(&first), "it is on the wire");
        assert!(wanted.load(Ordering::Acquire));
        assert!(!together.take_back(&second));
        assert!(!wanted.load(Ordering::Acquire));
        assert!(together.begin(&third, &wanted).is_empty());
    }
}
