//! Everything that is simulated: one wire, the units on it, and the masters that listen to it.
//!
//! It reads no clock. Whoever holds it says how far time has come.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use drivebus_rtu::{Destination, Frame, Instant, SerialFormat, UnitAddress};

use crate::drive::Drive;
use crate::random::Random;
use crate::wire::{Step, Wakeup, Wire};

/// Bytes kept for a master that does not read; older ones are lost, as in a serial port.
const INBOX: usize = 65_536;

/// Names one of the masters on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Listener(u64);

/// The simulated world.
#[derive(Debug)]
pub(crate) struct World {
    now: Instant,
    pub(crate) wire: Wire,
    drives: BTreeMap<u8, Drive>,
    inboxes: BTreeMap<Listener, VecDeque<u8>>,
    next_listener: u64,
}

impl World {
    pub(crate) fn new(format: SerialFormat, strict_silence: bool, seed: u64, drives: BTreeMap<u8, Drive>) -> Self {
        Self {
            now: Instant::ZERO,
            wire: Wire::new(format, strict_silence, Random::new(seed)),
            drives,
            inboxes: BTreeMap::new(),
            next_listener: 0,
        }
    }

    /// How far time has come.
    pub(crate) fn now(&self) -> Instant {
        self.now
    }

    /// Lets everything happen that is due until `to`.
    pub(crate) fn advance(&mut self, to: Instant) {
        let to = to.max(self.now);
        while let Some(step) = self.wire.step(to) {
            match step {
                Step::Delivered(byte) => self.deliver(byte),
                Step::Heard { bytes, silent } => self.hear(&bytes, silent),
            }
        }
        self.now = to;
    }

    /// A master sends at `at`; returns when its last character has left.
    pub(crate) fn transmit(&mut self, at: Instant, bytes: &[u8]) -> Instant {
        self.advance(at);
        self.wire.transmit(self.now, bytes)
    }

    /// When to [`advance`](Self::advance) next.
    pub(crate) fn next_wakeup(&self) -> Option<Wakeup> {
        self.wire.next_wakeup()
    }

    /// The drive with the address `unit`, as it is now.
    pub(crate) fn drive(&mut self, unit: UnitAddress) -> Option<&mut Drive> {
        let drive = self.drives.get_mut(&unit.get())?;
        drive.advance(self.now);
        Some(drive)
    }

    /// A master begins to listen.
    pub(crate) fn attach(&mut self) -> Listener {
        let listener = Listener(self.next_listener);
        self.next_listener += 1;
        self.inboxes.insert(listener, VecDeque::new());
        listener
    }

    /// A master is gone.
    pub(crate) fn detach(&mut self, listener: Listener) {
        self.inboxes.remove(&listener);
    }

    /// Moves what arrived for `listener` into `buffer`; returns how much.
    pub(crate) fn take(&mut self, listener: Listener, buffer: &mut [u8]) -> usize {
        let Some(inbox) = self.inboxes.get_mut(&listener) else { return 0 };
        let count = inbox.len().min(buffer.len());
        for (slot, byte) in buffer.iter_mut().zip(inbox.drain(..count)) {
            *slot = byte;
        }
        count
    }

    fn deliver(&mut self, byte: u8) {
        for inbox in self.inboxes.values_mut() {
            if inbox.len() == INBOX {
                inbox.pop_front();
            }
            inbox.push_back(byte);
        }
    }

    /// Every unit heard `bytes`; the one they are for answers. What is no frame gets silence.
    fn hear(&mut self, bytes: &[u8], silent: Instant) {
        let Ok(frame) = Frame::parse(bytes) else { return };
        match Destination::from_wire(frame.address()) {
            Ok(Destination::Broadcast) => {
                for drive in self.drives.values_mut() {
                    drive.handle(silent, frame.pdu());
                }
            }
            Ok(Destination::Unit(unit)) => {
                let Some(drive) = self.drives.get_mut(&unit.get()) else { return };
                let Some(answer) = drive.handle(silent, frame.pdu()) else { return };
                let delay: Duration = drive.response_delay();
                self.wire.answer(unit.get(), silent + delay, answer.as_bytes());
            }
            Err(_) => {}
        }
    }
}
