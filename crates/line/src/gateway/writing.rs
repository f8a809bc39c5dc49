//! One write of a client: what is asked before it goes out, whether it still may, and what is kept of it.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use drivebus_rtu::{Destination, Instant};

use crate::bus::workers::Running;
use crate::gateway::audit::{Entry, Outcome};
use crate::gateway::common::Common;
use crate::gateway::desk::Failed;
use crate::gateway::rights::Means;
use crate::gateway::stream::Stream;
use crate::system::clock::monotonic;

/// What is next of a write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    /// The unit is asked who it is, by this read.
    Look(Vec<u8>),
    /// What the write replaces is read.
    Old(Vec<u8>),
    /// It goes out.
    Go,
}

/// A write on its way.
#[derive(Debug)]
pub(super) struct Writing {
    pub(super) pdu: Vec<u8>,
    pub(super) unit: u8,
    pub(super) destination: Destination,
    pub(super) means: Means,
    /// How often the port had been opened when the unit was asked who it is.
    pub(super) opening: u64,
    /// How often the unit had been told to halt when the client asked.
    pub(super) halts: Option<u64>,
    /// What is still to be done, the last one first.
    pub(super) steps: Vec<Step>,
    /// Answers by which the unit says that it is another one.
    pub(super) others: Vec<Vec<u8>>,
    pub(super) record: Arc<Record>,
    pub(super) running: Option<Running>,
}

impl Writing {
    /// The unit was asked who it is: what it said, or what the client is told where that tells nothing.
    pub(super) fn looked(&mut self, result: &Result<Vec<u8>, Failed>) -> Result<Vec<u8>, Failed> {
        self.steps.pop();
        match result {
            Ok(pdu) => Ok(pdu.clone()),
            // Who does not know the register, or the function, is known by that. Whatever else it refuses for may pass.
            Err(failed) if failed.is_by_unit && (0x01..=0x03).contains(&failed.code.0) => Ok(vec![failed.code.0]),
            Err(failed) => Err(Failed { may_have_acted: false, ..*failed }),
        }
    }

    /// What it replaces was read; `Err`: what the client is told where the line did not bring that.
    pub(super) fn read(&mut self, result: &Result<Vec<u8>, Failed>) -> Result<(), Failed> {
        self.steps.pop();
        match result {
            Ok(pdu) => self.record.replaces(words_of(pdu)),
            // A unit that cannot show it may take it all the same.
            Err(failed) if failed.is_by_unit => {}
            Err(failed) => return Err(Failed { may_have_acted: false, ..*failed }),
        }
        Ok(())
    }

    /// It is not wanted any more: what has not gone out does not.
    pub(super) fn take_back(&self) {
        self.record.take_back();
        // What has gone out ends by itself, and is recorded then.
        if let Some(running) = &self.running {
            running.abandon();
        }
    }
}

/// The words in the answer to a read of registers.
fn words_of(pdu: &[u8]) -> Option<Vec<u16>> {
    let [_, bytes, data @ ..] = pdu else { return None };
    let is_whole = data.len() == usize::from(*bytes) && data.len() % 2 == 0;
    is_whole.then(|| data.chunks_exact(2).map(|word| u16::from_be_bytes([word[0], word[1]])).collect())
}

const WAITS: u8 = 0;
const BEGUN: u8 = 1;
const TAKEN_BACK: u8 = 2;

/// What is kept of a write until it ended: whoever ends it writes that down, once.
#[derive(Debug)]
pub(super) struct Record {
    common: Arc<Common>,
    client: u64,
    due: Instant,
    stream: Arc<dyn Stream>,
    state: AtomicU8,
    entry: Mutex<Option<Entry>>,
}

impl Record {
    pub(super) fn new(common: Arc<Common>, client: u64, due: Instant, stream: Arc<dyn Stream>, entry: Entry) -> Self {
        Self { common, client, due, stream, state: AtomicU8::new(WAITS), entry: Mutex::new(Some(entry)) }
    }

    /// Its turn has come: whether it goes out. One that is too old does not, nor one whose client has hung up.
    pub(super) fn begins(&self) -> bool {
        monotonic() < self.due
            && !self.stream.has_hung_up()
            && self.state.compare_exchange(WAITS, BEGUN, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }

    fn take_back(&self) {
        if self.state.compare_exchange(WAITS, TAKEN_BACK, Ordering::AcqRel, Ordering::Acquire).is_ok() {
            self.ended(Outcome::NotSent);
        }
    }

    fn replaces(&self, old: Option<Vec<u16>>) {
        if let Some(entry) = &mut *self.entry.lock().unwrap_or_else(PoisonError::into_inner) {
            entry.old = old;
        }
    }

    /// It is over. Only the first one to say so counts.
    pub(super) fn ended(&self, outcome: Outcome) {
        let entry = self.entry.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(entry) = entry else { return };
        let (common, unit) = (&self.common, entry.unit);
        let wills = common.wills_of(&entry.client);
        match entry.written.means {
            Means::Moves => {
                let moves = matches!(outcome, Outcome::Done | Outcome::Unknown | Outcome::Sent);
                common.commanders.ended(self.client, unit, moves, &wills);
            }
            Means::Stops if outcome == Outcome::Done => common.commanders.stopped(unit, &wills),
            _ => {}
        }
        common.counts.written(outcome);
        common.record(common.audit.write(&entry, outcome));
    }
}

/// What became of a write of which that is known.
pub(super) fn outcome_of(result: Result<&Vec<u8>, &Failed>, to: Destination) -> Outcome {
    match (result, to) {
        (Ok(_), Destination::Broadcast) => Outcome::Sent,
        (Ok(_), _) => Outcome::Done,
        (Err(failed), _) if failed.may_have_acted => Outcome::Unknown,
        (Err(failed), _) if failed.is_by_unit => Outcome::Refused(failed.code.0),
        _ => Outcome::NotSent,
    }
}
