//! Everything that is simulated: one wire, the units on it, and the masters that listen to it.
//!
//! It reads no clock. Whoever holds it says how far time has come.

use std::collections::{BTreeMap, VecDeque};

use drivebus_rtu::{Destination, Frame, Instant, SerialFormat, UnitAddress};

use crate::drive::Drive;
use crate::faults::FaultKind;
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
    plug: Plug,
}

/// The adapter between the masters and the wire.
#[derive(Debug)]
struct Plug {
    is_in: bool,
    /// How often it was pulled out: what was opened before is lost for good.
    pulls: u64,
    /// When it comes back by itself.
    back_at: Option<Instant>,
}

impl World {
    pub(crate) fn new(format: SerialFormat, strict_silence: bool, seed: u64, drives: BTreeMap<u8, Drive>) -> Self {
        Self {
            now: Instant::ZERO,
            wire: Wire::new(format, strict_silence, seed),
            drives,
            inboxes: BTreeMap::new(),
            next_listener: 0,
            plug: Plug { is_in: true, pulls: 0, back_at: None },
        }
    }

    /// How far time has come.
    pub(crate) fn now(&self) -> Instant {
        self.now
    }

    /// Lets everything happen that is due until `to`.
    pub(crate) fn advance(&mut self, to: Instant) {
        let to = to.max(self.now);
        while let Some(back) = self.plug.back_at.filter(|&back| back <= to) {
            self.run(back);
            // Whoever pulled it out once more meanwhile has said when it comes back.
            if self.plug.back_at == Some(back) {
                self.replug();
            }
        }
        self.run(to);
    }

    fn run(&mut self, to: Instant) {
        while let Some(step) = self.wire.step(to) {
            match step {
                Step::Delivered(byte) => self.inboxes.values_mut().for_each(|inbox| put(inbox, byte)),
                Step::Echoed(to, byte) => {
                    if let Some(inbox) = self.inboxes.get_mut(&to) {
                        put(inbox, byte);
                    }
                }
                Step::Heard { bytes, silent } => self.hear(&bytes, silent),
            }
            if !self.plug.is_in {
                self.inboxes.values_mut().for_each(VecDeque::clear);
            }
        }
        self.now = self.now.max(to);
    }

    /// The master `from` sends at `at`; returns when its last character has left.
    pub(crate) fn transmit(&mut self, from: Listener, at: Instant, bytes: &[u8]) -> Instant {
        self.advance(at);
        self.wire.transmit(from, self.now, bytes)
    }

    /// When to [`advance`](Self::advance) next.
    pub(crate) fn next_wakeup(&self) -> Option<Wakeup> {
        self.wire.next_wakeup()
    }

    /// Pulls the adapter out at `at`, until [`replug`](Self::replug) or, where it is known, until `back_at`.
    pub(crate) fn unplug(&mut self, at: Instant, back_at: Option<Instant>) {
        if self.plug.is_in {
            self.plug.is_in = false;
            self.plug.pulls += 1;
            self.wire.cut_off(at);
            self.inboxes.values_mut().for_each(VecDeque::clear);
        }
        self.plug.back_at = back_at;
    }

    /// Puts the adapter back.
    pub(crate) fn replug(&mut self) {
        self.plug.is_in = true;
        self.plug.back_at = None;
    }

    pub(crate) fn is_plugged(&self) -> bool {
        self.plug.is_in
    }

    /// How often the adapter was pulled out.
    pub(crate) fn pulls(&self) -> u64 {
        self.plug.pulls
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
                let hits = self.wire.faults.next();
                if hits.has(FaultKind::Deaf) {
                    self.wire.faults.happened(FaultKind::Deaf);
                    return;
                }
                let answer = drive.handle(silent, frame.pdu());
                let ready = silent + drive.response_delay();
                if hits.has(FaultKind::Unplug) && self.plug.is_in {
                    self.wire.faults.happened(FaultKind::Unplug);
                    self.unplug(silent, Some(silent + self.wire.faults.times.replug));
                }
                if let Some(answer) = answer {
                    self.wire.answer(unit.get(), ready, answer.as_bytes(), hits);
                }
            }
            Err(_) => {}
        }
    }
}

/// A byte arrives.
fn put(inbox: &mut VecDeque<u8>, byte: u8) {
    if inbox.len() == INBOX {
        inbox.pop_front();
    }
    inbox.push_back(byte);
}
